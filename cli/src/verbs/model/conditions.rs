//! The flags for the condition of a model, with the paper's defaults.

use clap::Args;
use models::condition::Condition;
use models::quantity::PeakToPeak;
use models::ridge::{RidgeCase, case};
use runs::input::unit_meant;

/// One operating point. Defaults are the paper's nominal case.
#[derive(Args, Clone, Debug)]
pub struct ConditionArgs {
    /// Vibration amplitude, peak-to-peak, in m
    #[arg(long, default_value_t = 2e-6, allow_negative_numbers = true)]
    pub amplitude_pp_m: f64,
    /// Vibration frequency in Hz
    #[arg(long, default_value_t = 27_500.0, allow_negative_numbers = true)]
    pub frequency_hz: f64,
    /// Sliding speed in m/s
    #[arg(long, default_value_t = 0.02, allow_negative_numbers = true)]
    pub speed_m_s: f64,
    /// Normal force on the finger in N
    #[arg(long, default_value_t = 0.25, allow_negative_numbers = true)]
    pub normal_force_n: f64,
    /// Coefficient of friction without vibration
    #[arg(long, default_value_t = 0.5, allow_negative_numbers = true)]
    pub mu0: f64,
    /// Poisson's ratio of the skin
    #[arg(long, default_value_t = 0.33, allow_negative_numbers = true)]
    pub poisson_ratio: f64,
}

/// How skin and plate meet in the ridge.
#[derive(Args, Clone, Debug)]
pub struct ContactArgs {
    /// Contact penalty over the stratum corneum's modulus
    #[arg(long, default_value_t = case::PENALTY_RATIO, allow_negative_numbers = true)]
    penalty_ratio: f64,
    /// Contact penalty along the plate over that across it, up to 1
    #[arg(long, default_value_t = 1.0, allow_negative_numbers = true)]
    tangential_penalty_ratio: f64,
    /// A layer that yields along the plate, in series with the penalty: traction over slip in Pa/m
    #[arg(long, allow_negative_numbers = true)]
    tangential_stiffness_pa_m: Option<f64>,
}

impl ContactArgs {
    /// A case with this contact.
    pub fn of(&self, case: RidgeCase) -> RidgeCase {
        RidgeCase {
            penalty_ratio: self.penalty_ratio,
            tangential_penalty_ratio: self.tangential_penalty_ratio,
            tangential_stiffness_pa_m: self.tangential_stiffness_pa_m,
            ..case
        }
    }
}

/// What a flag may be at most on any rig that vibrates a plate under a finger. The models answer for larger values too, and mean nothing.
const LARGEST: [(&str, f64); 5] = [
    ("amplitude_pp_m", 1e-4),
    ("frequency_hz", 1e7),
    ("speed_m_s", 10.0),
    ("normal_force_n", 1000.0),
    ("mu0", 10.0),
];

impl ConditionArgs {
    /// The first value that no rig can have; what no model is defined for is refused by the model itself.
    ///
    /// # Errors
    /// The flag, its value, what is allowed, and the unit that was probably meant.
    pub fn check(&self) -> Result<(), String> {
        let values = [self.amplitude_pp_m, self.frequency_hz, self.speed_m_s, self.normal_force_n, self.mu0];
        for ((key, largest), value) in LARGEST.into_iter().zip(values) {
            if value > largest {
                let meant = unit_meant(key, value, [1e-6 * largest, largest]);
                let hint = meant.map_or_else(String::new, |meant| format!(" ({meant})"));
                let most = runs::report::human::quantity(largest, runs::input::unit_of(key));
                return Err(format!(
                    "--{} {value}: no rig has that; give 0 to {most}{hint}",
                    key.replace('_', "-")
                ));
            }
        }
        Ok(())
    }

    /// As the point models take it.
    pub fn condition(&self) -> Condition {
        Condition {
            amplitude: PeakToPeak::from_metres(self.amplitude_pp_m),
            frequency_hz: self.frequency_hz,
            speed_m_s: self.speed_m_s,
            normal_force_n: self.normal_force_n,
            mu0: self.mu0,
            ..Condition::paper()
        }
    }

    /// As the ridge takes it, with the mean pressure of the force unless given.
    pub fn ridge_case(&self, mean_pressure_pa: Option<f64>) -> RidgeCase {
        RidgeCase {
            amplitude: PeakToPeak::from_metres(self.amplitude_pp_m),
            frequency_hz: self.frequency_hz,
            speed_m_s: self.speed_m_s,
            normal_force_n: self.normal_force_n,
            mu0: self.mu0,
            poisson_ratio: self.poisson_ratio,
            mean_pressure_pa: mean_pressure_pa
                .unwrap_or_else(|| case::hertz_mean_pressure_pa(self.normal_force_n)),
            ..RidgeCase::paper()
        }
    }
}
