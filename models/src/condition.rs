//! One operating point of the rig.

use crate::quantity::{Direction, PeakToPeak};
use serde::{Deserialize, Serialize};

/// The conditions of one pass: what a prediction needs to know besides the fingertip.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Condition {
    /// Peak-to-peak vibration amplitude `w`.
    pub amplitude: PeakToPeak,
    /// Vibration frequency `f` in Hz.
    pub frequency_hz: f64,
    /// Sliding speed `U` (magnitude) in m/s.
    pub speed_m_s: f64,
    /// Direction of sliding.
    pub direction: Direction,
    /// Normal force `F_n` in N, positive in compression.
    pub normal_force_n: f64,
    /// Coulomb friction coefficient without vibration, `mu_0`.
    pub mu0: f64,
    /// Mean position along the stroke in m.
    pub position_m: f64,
    /// Time since the start of the run in s.
    pub time_s: f64,
    /// Ambient pressure in Pa, where it was measured.
    pub ambient_pressure_pa: Option<f64>,
}

impl Condition {
    /// The paper's nominal point (Fig. 9): 2 um peak-to-peak, 27.5 kHz, 20 mm/s, 0.25 N, `mu_0` 0.5.
    pub const fn paper() -> Self {
        Condition {
            amplitude: PeakToPeak::from_metres(2e-6),
            frequency_hz: 27_500.0,
            speed_m_s: 0.02,
            direction: Direction::Forward,
            normal_force_n: 0.25,
            mu0: 0.5,
            position_m: 0.0,
            time_s: 0.0,
            ambient_pressure_pa: None,
        }
    }

    /// The first value that no model can work with, by name, or `Ok`.
    ///
    /// # Errors
    /// Amplitude or speed negative, frequency, normal force or `mu_0` not positive, or anything not finite.
    pub fn check(&self) -> Result<(), OutOfDomain> {
        let at_least_zero = [("amplitude_pp_m", self.amplitude.metres()), ("speed_m_s", self.speed_m_s)];
        let positive =
            [("frequency_hz", self.frequency_hz), ("normal_force_n", self.normal_force_n), ("mu0", self.mu0)];
        for (name, value) in at_least_zero {
            if !(value.is_finite() && value >= 0.0) {
                return Err(OutOfDomain { name, value, needed: "a finite number, zero or more" });
            }
        }
        for (name, value) in positive {
            if !(value.is_finite() && value > 0.0) {
                return Err(OutOfDomain { name, value, needed: "a finite number above zero" });
            }
        }
        Ok(())
    }
}

/// A value outside what a model is defined for.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{name} = {value}: {needed} is needed")]
pub struct OutOfDomain {
    /// The quantity, with its unit in the name.
    pub name: &'static str,
    /// What was given.
    pub value: f64,
    /// What would be accepted.
    pub needed: &'static str,
}
