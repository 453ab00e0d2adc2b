//! The artificial fingertip: ridges on a soft pad.
//!
//! At ultrasonic frequencies the ridges stand on an immobile backing: normal and lateral springs, perhaps
//! with mass and damping. At the stage's pace the pad is a soft lateral spring: a reversal first unwinds it.

use crate::contact::{Contact, Ridge, StretchRecovery};
use crate::noise::Noise;
use serde::{Deserialize, Serialize};

/// What the fingertip is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FingerConfig {
    /// Nominal normal stiffness at ultrasonic frequencies (N/m).
    pub normal_stiffness_n_per_m: f64,
    /// Nominal lateral stiffness at ultrasonic frequencies (N/m).
    pub lateral_stiffness_n_per_m: f64,
    /// Relative standard deviation of each true stiffness about its nominal one (-); drawn from the seed.
    pub stiffness_relative_sd: f64,
    /// Intrinsic coefficient of friction (-).
    pub mu0: f64,
    /// Mass of the ridges (kg); 0: massless.
    pub ridge_mass_kg: f64,
    /// Damping ratio of the ridges on their normal spring (-); acts with a mass only.
    pub ridge_damping_ratio: f64,
    /// Lateral recovery speed (m/s); 0: at once.
    pub lateral_recovery_m_s: f64,
    /// Where above zero, the fingertip is not a slider on springs but the paper's finite element ridge, by
    /// its table, on a plate that moves by so
    /// many times its stroke (-): 1 is the ridge as it is; 2 makes the paper's w its sine's amplitude.
    pub ridge_table_strokes: f64,
    /// Lateral stiffness of the pad at the stage's pace (N/m).
    pub pad_stiffness_n_per_m: f64,
    /// Poisson's ratio of the ridges, for rig.toml (-).
    pub poisson_ratio: f64,
    /// Young's modulus of the ridges, for rig.toml (Pa).
    pub young_modulus_pa: f64,
}

impl Default for FingerConfig {
    fn default() -> Self {
        let paper = models::finger::Finger::paper();
        Self {
            normal_stiffness_n_per_m: paper.normal_stiffness_n_per_m,
            lateral_stiffness_n_per_m: paper.lateral_stiffness_n_per_m,
            stiffness_relative_sd: 0.05,
            mu0: 0.5,
            ridge_mass_kg: 0.0,
            ridge_damping_ratio: 0.0,
            lateral_recovery_m_s: 0.0,
            ridge_table_strokes: 0.0,
            pad_stiffness_n_per_m: 1500.0,
            poisson_ratio: paper.poisson_ratio,
            young_modulus_pa: 28.3e6,
        }
    }
}

/// The one fingertip on this rig: its true properties.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VirtualFinger {
    /// True normal stiffness (N/m).
    pub normal_stiffness_n_per_m: f64,
    /// True lateral stiffness (N/m).
    pub lateral_stiffness_n_per_m: f64,
    /// True coefficient of friction (-).
    pub mu0: f64,
    ridge: Ridge,
    recovery: StretchRecovery,
}

impl VirtualFinger {
    /// The fingertip of a seed.
    pub fn new(config: &FingerConfig, seed: u64) -> Self {
        let mut noise = Noise::new(seed, "finger");
        // Three standard deviations at most: a stiffness stays positive.
        let mut factor = || 1.0 + config.stiffness_relative_sd * noise.normal().clamp(-3.0, 3.0);
        let normal = config.normal_stiffness_n_per_m * factor();
        let lateral = config.lateral_stiffness_n_per_m * factor();
        let critical = 2.0 * (normal * config.ridge_mass_kg).sqrt();
        Self {
            normal_stiffness_n_per_m: normal,
            lateral_stiffness_n_per_m: lateral,
            mu0: config.mu0,
            ridge: Ridge {
                mass_kg: config.ridge_mass_kg,
                damping_n_s_per_m: config.ridge_damping_ratio * critical,
                ..Ridge::default()
            },
            recovery: match config.lateral_recovery_m_s {
                speed if speed > 0.0 => StretchRecovery::Rate(speed),
                _ => StretchRecovery::Instant,
            },
        }
    }

    /// Its contact under steady conditions; see [`Contact`] for the units.
    pub fn contact(
        &self,
        sine_amplitude_m: f64,
        frequency_hz: f64,
        speed_m_s: f64,
        normal_force_n: f64,
    ) -> Contact {
        let (kn, kl) = (self.normal_stiffness_n_per_m, self.lateral_stiffness_n_per_m);
        let ideal =
            Contact::ideal(kn, kl, self.mu0, normal_force_n, sine_amplitude_m, frequency_hz, speed_m_s);
        Contact { ridge: self.ridge, recovery: self.recovery, ..ideal }
    }
}

/// The pad's slow lateral spring: it loads until the contact slides.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pad {
    stretch_m: f64,
}

impl Pad {
    /// The pad's lateral force (N) after `dt` seconds at a velocity, the contact carrying at most `limit_n`.
    pub fn step(&mut self, stiffness_n_per_m: f64, velocity_m_s: f64, limit_n: f64, dt: f64) -> f64 {
        // A plate that moves in its plane can push the contact forward on the average: that holds no stretch.
        let bound = limit_n.max(0.0) / stiffness_n_per_m;
        self.stretch_m = (self.stretch_m + velocity_m_s * dt).clamp(-bound, bound);
        stiffness_n_per_m * self.stretch_m
    }
}

#[cfg(test)]
mod tests {
    use super::Pad;

    #[test]
    fn a_contact_that_carries_nothing_holds_no_stretch() {
        let mut pad = Pad::default();
        assert!(pad.step(1e3, 0.02, 0.1, 1.0) > 0.09);
        assert_eq!(pad.step(1e3, 0.02, -1e-3, 1.0), 0.0);
    }
}
