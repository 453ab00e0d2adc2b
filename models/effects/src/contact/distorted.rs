//! A plate whose motion carries a second harmonic: its tops are sharper or broader than a sine's.
//!
//! The height over the cycle is `cos(psi) + ratio cos(2 psi + phase)` in units of `w/2`. Load and friction
//! follow as for a sine (the head of [`crate::contact`]), by equal steps of the phase.

use crate::contact::Contact;
use std::f64::consts::PI;

/// Steps of the phase. The mean force is then within 5e-3 of the closed form of a sine (tested).
const STEPS: usize = 256;
/// The same where a search only looks for places to begin.
const COARSE_STEPS: usize = 64;

/// Second harmonic of the plate's motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Harmonic {
    /// Its amplitude over that of the first harmonic. 0 in the baseline.
    pub ratio: f64,
    /// Its phase at the first one's top, rad.
    pub phase: f64,
}

/// Mean friction as a share of that without the harmonic. Both are taken by the same steps, so that a small
/// harmonic changes little.
pub fn friction_ratio(c: &Contact) -> f64 {
    let plain = by_steps(&Contact { harmonic: Harmonic { ratio: 0.0, phase: 0.0 }, ..*c });
    if plain > 0.0 { by_steps(c) / plain } else { 1.0 }
}

/// Mean friction over the periodic steady state, N.
fn by_steps(c: &Contact) -> f64 {
    let steps = if c.coarse { COARSE_STEPS } else { STEPS };
    let step = 2.0 * PI / steps as f64;
    let mut room = [0.0; STEPS];
    let heights = &mut room[..steps];
    let ((sin_phase, cos_phase), (sin_step, cos_step)) = (c.harmonic.phase.sin_cos(), step.sin_cos());
    let (mut sin, mut cos) = (0.0, 1.0);
    for h in heights.iter_mut() {
        let (sin_twice, cos_twice) = (2.0 * sin * cos, 2.0 * cos * cos - 1.0);
        *h = cos + c.harmonic.ratio * (cos_twice * cos_phase - sin_twice * sin_phase);
        (sin, cos) = (sin * cos_step + cos * sin_step, cos * cos_step - sin * sin_step);
    }
    let depth = depth(heights, c.load_ratio());
    // A periodic force only falls along its limit: where the limit is least the force is the limit.
    let lowest = (0..steps).fold(0, |low, i| if heights[i] < heights[low] { i } else { low });
    let limit = |h: &f64| (h + depth).max(0.0);
    let (drag, mut force, mut sum) = (c.drag() * step, limit(&heights[lowest]), 0.0);
    for h in heights[lowest..].iter().chain(&heights[..lowest]) {
        force = (force + drag).min(limit(h));
        sum += force;
    }
    sum / steps as f64 * c.mu0 * c.normal_stiffness * c.half_amplitude()
}

/// Depth of the rest position at which the mean of what the heights press is the load. The mean rises with
/// the depth, straight between heights and never less steep: Newton's steps from full contact end exactly.
fn depth(heights: &[f64], load: f64) -> f64 {
    let n = heights.len() as f64;
    let mut depth = load;
    for _ in 0..heights.len() {
        let touching = heights.iter().map(|h| h + depth).filter(|&d| d > 0.0);
        let (sum, touching) = touching.fold((0.0, 0.0), |s, d| (s.0 + d, s.1 + 1.0));
        let excess = sum - load * n;
        if excess < 1e-12 * load * n || touching == 0.0 {
            break;
        }
        depth -= excess / touching;
    }
    depth
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::mean_friction as mean;

    fn contact(amplitude_pp: f64, speed: f64) -> Contact {
        Contact { amplitude_pp, speed, ..crate::contact::example() }
    }

    fn with(ratio: f64, phase: f64, c: &Contact) -> f64 {
        by_steps(&Contact { harmonic: Harmonic { ratio, phase }, ..*c })
    }

    #[test]
    fn without_a_harmonic_it_is_the_closed_form_of_the_sine() {
        for amplitude_pp in [2e-7, 5e-7, 1e-6, 3e-6, 8e-6] {
            for speed in [5e-3, 0.03, 0.2] {
                let c = contact(amplitude_pp, speed);
                let full = 0.5 * c.normal_force;
                assert!((with(0.0, 1.0, &c) - mean(&c)).abs() < 5e-3 * full, "{amplitude_pp} {speed}");
            }
        }
    }

    /// Narrow contacts see the curvature of the top alone: `1 + 4 ratio` of the sine's where the harmonic is
    /// in phase. A slider that always slips carries the whole friction whatever the motion.
    #[test]
    fn narrow_contacts_see_the_curvature_and_pure_slip_nothing() {
        let c = contact(2e-4, 0.02);
        let (found, sine) = (with(0.2, 0.0, &c), mean(&Contact { amplitude_pp: 1.8 * 2e-4, ..c }));
        assert!((found / sine - 1.0).abs() < 0.03, "{found} {sine}");
        let fast = contact(3e-6, 500.0);
        for phase in [0.0, 1.0, 2.5, 4.0] {
            assert!((with(0.4, phase, &fast) / (0.5 * fast.normal_force) - 1.0).abs() < 0.02, "{phase}");
        }
    }
}
