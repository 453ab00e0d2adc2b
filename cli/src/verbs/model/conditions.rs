//! The flags for the condition of a model, with the paper's defaults.

use clap::Args;
use models::ridge::{RidgeCase, case};
use models::{Condition, PeakToPeak};
use realtime::safety::HARD;
use runs::format::quantity;
use runs::input::{unit_meant, unit_of};

/// One operating point. Defaults are the paper's nominal case.
#[derive(Args, Clone, Debug)]
pub struct ConditionArgs {
    /// Vibration amplitude, peak-to-peak, in m (2e-6 if left out)
    #[arg(long)]
    pub amplitude_pp_m: Option<f64>,
    /// Vibration frequency in Hz
    #[arg(long, default_value_t = 27_500.0)]
    pub frequency_hz: f64,
    /// Sliding speed in m/s
    #[arg(long, default_value_t = 0.02)]
    pub speed_m_s: f64,
    /// Normal force on the finger in N
    #[arg(long, default_value_t = 0.25)]
    pub normal_force_n: f64,
    /// Coefficient of friction without vibration
    #[arg(long, default_value_t = 0.5)]
    pub mu0: f64,
    /// Poisson's ratio of the skin
    #[arg(long, default_value_t = 0.33)]
    pub poisson_ratio: f64,
}

/// How skin and plate meet in the ridge.
#[derive(Args, Clone, Debug)]
pub struct ContactArgs {
    /// Contact penalty over the stratum corneum's modulus
    #[arg(long, default_value_t = case::PENALTY_RATIO)]
    penalty_ratio: f64,
    /// Contact penalty along the plate over that across it, up to 1
    #[arg(long, default_value_t = 1.0)]
    tangential_penalty_ratio: f64,
    /// A layer that yields along the plate, in series with the penalty: traction over slip in Pa/m
    #[arg(long)]
    tangential_stiffness_pa_m: Option<f64>,
}

impl ContactArgs {
    /// A case with this contact.
    pub fn of(&self, case: RidgeCase) -> RidgeCase {
        let ContactArgs { penalty_ratio, tangential_penalty_ratio, tangential_stiffness_pa_m } = *self;
        RidgeCase { penalty_ratio, tangential_penalty_ratio, tangential_stiffness_pa_m, ..case }
    }
}

/// Young's modulus of the stratum corneum that the ridge takes, and with it the surrogate.
pub const YOUNG_MODULUS_PA: [f64; 2] = [1e6, 1e11];

impl ConditionArgs {
    /// The first value that no rig can have; what no model is defined for is refused by the model itself. The
    /// words are the flag, its value, what is allowed, and the unit that was probably meant. `more` are values
    /// besides, with their ranges.
    pub fn check(&self, more: &[(&str, f64, [f64; 2])]) -> Result<(), String> {
        // Of any rig that vibrates a plate under a finger. The models answer for other values too, and mean
        // nothing.
        let own = [
            ("amplitude_pp_m", self.amplitude_pp_m.unwrap_or(0.0), [0.0, 1e-4]),
            ("frequency_hz", self.frequency_hz, [HARD.frequency_hz.0, HARD.frequency_hz.1]),
            ("speed_m_s", self.speed_m_s, [0.0, 10.0]),
            ("normal_force_n", self.normal_force_n, [0.0, 1000.0]),
            ("mu0", self.mu0, [0.0, 10.0]),
        ];
        for (key, value, [least, largest]) in own.iter().chain(more).copied() {
            if !((least..=largest).contains(&value) || value < 0.0 && least == 0.0) {
                let meant = unit_meant(key, value, [least.max(1e-6 * largest), largest]);
                let hint = meant.map_or_else(String::new, |meant| format!(" ({meant})"));
                let unit = unit_of(key);
                let [least, most] =
                    [least, largest].map(|v| if v == 0.0 { "0".into() } else { quantity(v, unit) });
                return Err(format!(
                    "--{} {value}: no rig has that; give {least} to {most}{hint}",
                    key.replace('_', "-")
                ));
            }
        }
        Ok(())
    }

    /// As the point models take it.
    pub fn condition(&self) -> Condition {
        let ConditionArgs { amplitude_pp_m, frequency_hz, speed_m_s, normal_force_n, mu0, .. } = *self;
        let paper = Condition::paper();
        let amplitude = amplitude_pp_m.map_or(paper.amplitude, PeakToPeak::from_metres);
        Condition { amplitude, frequency_hz, speed_m_s, normal_force_n, mu0, ..paper }
    }

    /// As the ridge takes it, with the mean pressure of the force unless given.
    pub fn ridge_case(&self, mean_pressure_pa: Option<f64>) -> RidgeCase {
        let Condition { amplitude, frequency_hz, speed_m_s, normal_force_n, mu0, .. } = self.condition();
        let hertz = || case::hertz_mean_pressure_pa(normal_force_n);
        let (poisson_ratio, mean_pressure_pa) = (self.poisson_ratio, mean_pressure_pa.unwrap_or_else(hertz));
        let paper = RidgeCase { poisson_ratio, mean_pressure_pa, ..RidgeCase::paper() };
        RidgeCase { amplitude, frequency_hz, speed_m_s, normal_force_n, mu0, ..paper }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Flags {
        #[command(flatten)]
        condition: ConditionArgs,
    }

    /// 27.5 Hz gave a mu' of a plate that no drive moves so slowly.
    #[test]
    fn a_frequency_that_no_rig_has_is_refused_with_the_unit_that_was_meant() {
        assert_eq!(Flags::parse_from(["mu"]).condition.condition().amplitude, Condition::paper().amplitude);
        let check = |hz: &str| Flags::parse_from(["mu", "--frequency-hz", hz]).condition.check(&[]);
        let why = check("27.5").unwrap_err();
        assert!(why.contains("give 5 kHz to 120 kHz (27.5 Hz: kHz meant? Then write 2.75e4"), "{why}");
        assert!(check("2.75e7").unwrap_err().ends_with("give 5 kHz to 120 kHz"));
        for hz in ["5000", "27500", "120000"] {
            check(hz).unwrap();
        }
    }

    /// MPa and N/um gave numbers that no finger has.
    #[test]
    fn a_finger_in_another_unit_is_refused_as_in_a_rig_toml() {
        let stiffness = models::rig_file::STIFFNESS_N_PER_M;
        let condition = Flags::parse_from(["mu"]).condition;
        for (key, value, range, meant) in [
            ("young_modulus_pa", 28.3, YOUNG_MODULUS_PA, "MPa meant? Then write 2.83e7"),
            ("normal_stiffness_n_per_m", 3.9, stiffness, "N/\u{b5}m meant? Then write 3.9e6"),
            ("lateral_stiffness_n_per_m", -1.5e6, stiffness, "no rig has that"),
            ("young_modulus_pa", f64::NAN, YOUNG_MODULUS_PA, "no rig has that"),
        ] {
            let why = condition.check(&[(key, value, range)]).unwrap_err();
            assert!(why.starts_with(&format!("--{}", key.replace('_', "-"))) && why.contains(meant), "{why}");
        }
        condition.check(&[("young_modulus_pa", 28.3e6, YOUNG_MODULUS_PA)]).unwrap();
    }
}
