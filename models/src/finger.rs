//! The fingertip as the laws see it (Tables 1 and 2 of the paper; section 4.1 for the springs).

use crate::condition::OutOfDomain;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Elastic properties of a fingertip in ultrasonic contact.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Finger {
    /// Normal stiffness `k_n` at ultrasonic frequencies in N/m.
    pub normal_stiffness_n_per_m: f64,
    /// Lateral stiffness `k_l` in N/m.
    pub lateral_stiffness_n_per_m: f64,
    /// Relative standard uncertainty of both stiffnesses, independent (one standard deviation).
    #[serde(default)]
    pub stiffness_relative_sd: f64,
    /// Poisson's ratio.
    #[serde(default = "Finger::table_1_poisson_ratio")]
    pub poisson_ratio: f64,
    /// Young's modulus of the stratum corneum in Pa, where it is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub young_modulus_pa: Option<f64>,
    /// Lateral recovery speed `v_r` of section 5.3 in m/s; `None` is the paper's infinitely fast recovery.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lateral_recovery_m_per_s: Option<f64>,
}

impl Finger {
    const fn table_1_poisson_ratio() -> f64 {
        0.33
    }

    /// The springs of Figs. 13 and 14 (`k_n` 3.9, `k_l` 1.5 MN/m) with Table 2's moist stratum corneum.
    pub const fn paper() -> Self {
        Finger {
            normal_stiffness_n_per_m: 3.9e6,
            lateral_stiffness_n_per_m: 1.5e6,
            stiffness_relative_sd: 0.0,
            poisson_ratio: Self::table_1_poisson_ratio(),
            young_modulus_pa: Some(28.3e6),
            lateral_recovery_m_per_s: None,
        }
    }

    /// The first property that no model can work with, by name, or `Ok`.
    ///
    /// # Errors
    /// Stiffnesses or recovery speed not positive, Poisson's ratio outside (-1, 0.5), negative uncertainty.
    pub fn check(&self) -> Result<(), OutOfDomain> {
        let unless = OutOfDomain::unless;
        for (name, value) in [
            ("normal_stiffness_n_per_m", self.normal_stiffness_n_per_m),
            ("lateral_stiffness_n_per_m", self.lateral_stiffness_n_per_m),
        ] {
            unless(value.is_finite() && value > 0.0, name, value, "a finite number above zero")?;
        }
        let nu = self.poisson_ratio;
        unless(nu > -1.0 && nu < 0.5, "poisson_ratio", nu, "a number between -1 and 0.5")?;
        let sd = self.stiffness_relative_sd;
        unless(sd.is_finite() && sd >= 0.0, "stiffness_relative_sd", sd, "zero or more")?;
        let speed = self.lateral_recovery_m_per_s.unwrap_or(f64::INFINITY);
        let needed = "a number above zero (leave it out for infinite)";
        unless(speed > 0.0, "lateral_recovery_m_per_s", speed, needed)
    }
}
