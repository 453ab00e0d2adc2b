//! The lateral spring and its Coulomb slider, marched in time.
//!
//! While in contact the stretch grows by the drag of the plate. Where the spring's force would exceed the
//! friction limit the slider slides: the force is the limit, and the stretch falls towards `limit / k_l`, no
//! faster than the ridge recovers. Out of contact the force is zero and the stretch recovers towards zero.
//! The recovery law binds the slip-back at touch-down too: without that a finite recovery would have no
//! effect (physics of the paper's Fig. 13).

use super::{Contact, StretchRecovery};

/// State of one lateral spring.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Lateral {
    /// Stretch (m).
    pub stretch_m: f64,
    /// Time since touch-down (s); infinite in persistent contact.
    pub dwell_s: f64,
}

impl StretchRecovery {
    /// A stretch (m) after `dt` seconds of free recovery towards zero.
    pub fn relax(&self, stretch_m: f64, dt: f64) -> f64 {
        match *self {
            StretchRecovery::Instant => 0.0,
            StretchRecovery::Rate(speed) => stretch_m.signum() * (stretch_m.abs() - speed * dt).max(0.0),
            // x' = -v tanh(x / knee) has a closed form: sinh(x / knee) decays exponentially.
            StretchRecovery::Soft { speed_m_s, knee_m } => {
                let ratio = stretch_m / knee_m;
                let decay = speed_m_s * dt / knee_m;
                if ratio.abs() > 30.0 {
                    let linear = ratio.abs() - decay;
                    if linear > 30.0 {
                        return stretch_m.signum() * linear * knee_m;
                    }
                    let left = decay - (ratio.abs() - 30.0);
                    return stretch_m.signum() * knee_m * (30.0_f64.sinh() * (-left).exp()).asinh();
                }
                knee_m * (ratio.sinh() * (-decay).exp()).asinh()
            }
        }
    }
}

impl Lateral {
    /// One step in contact: the lateral force (N) at its end.
    ///
    /// `normal_n` is the contact force at the end of the step, `drag_m_s` the plate's speed along the sliding
    /// direction during it.
    pub fn touch(&mut self, contact: &Contact, normal_n: f64, drag_m_s: f64, dt: f64) -> f64 {
        self.dwell_s += dt;
        let k = contact.lateral_stiffness_n_per_m;
        let limit = contact.limit.at(contact.friction, normal_n, self.dwell_s).max(0.0);
        let bound = limit / k;
        let dragged = self.stretch_m + drag_m_s * dt;
        if dragged.abs() <= bound {
            self.stretch_m = dragged;
            return k * dragged;
        }
        let side = dragged.signum();
        let relaxed = side * contact.recovery.relax(self.stretch_m, dt);
        self.stretch_m = side * relaxed.max(bound);
        side * limit
    }

    /// Time out of contact: the stretch recovers, the dwell starts anew.
    pub fn release(&mut self, recovery: StretchRecovery, dt: f64) {
        self.stretch_m = recovery.relax(self.stretch_m, dt);
        self.dwell_s = 0.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn soft_recovery_is_a_rate_when_large_and_exponential_when_small() {
        let law = StretchRecovery::Soft { speed_m_s: 5e-3, knee_m: 1e-8 };
        let large = law.relax(1e-6, 1e-5);
        assert!((large - (1e-6 - 5e-8)).abs() < 1e-12, "{large}");
        let small = law.relax(1e-10, 2e-6);
        assert!((small / (1e-10 * (-1.0_f64).exp()) - 1.0).abs() < 1e-3, "{small}");
        // Two half steps equal one whole step.
        let halves = law.relax(law.relax(4e-8, 5e-6), 5e-6);
        assert!((halves - law.relax(4e-8, 1e-5)).abs() < 1e-18);
    }

    #[test]
    fn a_rate_never_overshoots_zero() {
        assert_eq!(StretchRecovery::Rate(1.0).relax(-1e-6, 1.0), 0.0);
    }
}
