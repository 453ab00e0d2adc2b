//! A plate whose motion carries a second harmonic: its tops are sharper or broader than a sine's.
//!
//! The height over the cycle is `cos(psi) + ratio cos(2 psi + phase)` in units of `w/2`. Load and friction
//! follow as for a sine (the head of [`crate::contact`]), by equal steps of the phase.

use crate::contact::Contact;
use std::f64::consts::PI;
use std::sync::LazyLock;

/// Steps of the phase, a power of two. The mean force is then within 5e-3 of a sine's closed form (tested).
const STEPS: usize = 256;
/// The same where a search only looks for places to begin.
const COARSE_STEPS: usize = 64;
/// Independent sums, which the processor adds side by side.
const LANES: usize = 8;
/// Cosine and sine of the phase at each step.
static CYCLE: LazyLock<[(f64, f64); STEPS]> = LazyLock::new(|| {
    std::array::from_fn(|i| {
        let (sin, cos) = (2.0 * PI * i as f64 / STEPS as f64).sin_cos();
        (cos, sin)
    })
});

/// Second harmonic of the plate's motion.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Harmonic {
    /// Its amplitude over that of the first harmonic. 0 in the baseline.
    pub ratio: f64,
    /// Its phase at the first one's top, rad.
    pub phase: f64,
}

/// Mean friction as a share of that without the harmonic. Both are taken by the same steps, so that a small
/// harmonic changes little.
pub fn friction_ratio(c: &Contact) -> f64 {
    let [plain, distorted] = by_steps(c);
    if plain > 0.0 { distorted / plain } else { 1.0 }
}

/// Mean friction over the periodic steady state without the harmonic and with it, in units of friction
/// coefficient times normal stiffness times `w/2`.
fn by_steps(c: &Contact) -> [f64; 2] {
    let steps = if c.coarse { COARSE_STEPS } else { STEPS };
    let (cycle, stride, Harmonic { ratio, phase }) = (&*CYCLE, STEPS / steps, c.harmonic);
    let (sin_phase, cos_phase) = phase.sin_cos();
    let mut room = [[0.0; STEPS]; 2];
    for i in 0..steps {
        let ((cos, _), (cos_twice, sin_twice)) = (cycle[i * stride], cycle[(2 * i * stride) & (STEPS - 1)]);
        room[0][i] = cos;
        room[1][i] = cos + ratio * (cos_twice * cos_phase - sin_twice * sin_phase);
    }
    let heights = [&room[0][..steps], &room[1][..steps]];
    let load = c.load_ratio();
    let plain = depth(heights[0], load, load);
    // No height is lower by more than the ratio, so this depth presses at least the load.
    let depths = [plain, depth(heights[1], load, load.min(plain + ratio.abs()))];
    // A periodic force only falls along its limit: where the limit is least the force is the limit.
    let lowest = heights.map(|h| (0..steps).fold(0, |low, i| if h[i] < h[low] { i } else { low }));
    let limit = |of: usize, i: usize| (heights[of][(lowest[of] + i) & (steps - 1)] + depths[of]).max(0.0);
    let drag = c.drag() * 2.0 * PI / steps as f64;
    let (mut force, mut sum) = ([limit(0, 0), limit(1, 0)], [0.0; 2]);
    for i in 0..steps {
        for of in 0..2 {
            force[of] = (force[of] + drag).min(limit(of, i));
            sum[of] += force[of];
        }
    }
    sum.map(|sum| sum / steps as f64)
}

/// Depth of the rest position at which the mean of what the heights press is the load. The mean rises with
/// the depth, straight between heights and never less steep: Newton's steps end exactly. The first depth must
/// press at least the load.
fn depth(heights: &[f64], load: f64, start: f64) -> f64 {
    let n = heights.len() as f64;
    let mut depth = start;
    for _ in 0..heights.len() {
        let (mut sums, mut touching) = ([0.0; LANES], [0.0; LANES]);
        for some in heights.chunks_exact(LANES) {
            for (lane, h) in some.iter().enumerate() {
                let pressed = h + depth;
                sums[lane] += pressed.max(0.0);
                touching[lane] += f64::from(u8::from(pressed > 0.0));
            }
        }
        let (sum, touching) = (sums.iter().sum::<f64>(), touching.iter().sum::<f64>());
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
        let full = c.mu0 * c.normal_stiffness * c.half_amplitude();
        by_steps(&Contact { harmonic: Harmonic { ratio, phase }, ..*c })[1] * full
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
