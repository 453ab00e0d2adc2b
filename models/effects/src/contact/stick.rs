//! What a contact loses while it sticks: the integral of friction limit minus lateral force, whose end is the
//! one root of the closed form.

use std::f64::consts::PI;
use std::sync::OnceLock;

/// Distance (rad) to the root at which its correction is exact enough: the integral is stationary in the
/// root, so what is left is of the third power, below 1e-9.
const NEAR: f64 = 1e-3;

/// The integral in units of `mu0 k_n w/2` radian, for a half contact angle (pi: never leaves), its sine and
/// cosine, and the rate of stretch per radian.
#[inline]
pub(super) fn lost(phi: f64, (sin_phi, cos_phi): (f64, f64), drag: f64) -> f64 {
    // Sticking begins where the limit rises faster than the spring: at touch-down, or later if the finger
    // touches on the lower half of the plate's motion, where the limit rises slowly at first.
    if drag < sin_phi {
        let began = Began { start: -phi, sin: -sin_phi, cos: cos_phi, drag };
        return began.lost(phi * (2.0 * guesses().early(phi, drag / sin_phi) - 1.0));
    }
    if phi <= 0.5 * PI || drag >= 1.0 {
        return 0.0;
    }
    let began = Began { start: -PI + drag.asin(), sin: -drag, cos: -(1.0 - drag * drag).sqrt(), drag };
    began.lost(guesses().late(drag))
}

/// Where sticking begins (phase from the highest point, and its sine and cosine), and the rate of stretch.
struct Began {
    start: f64,
    sin: f64,
    cos: f64,
    drag: f64,
}

impl Began {
    /// `cos(x) - cos - drag (x - start)`, the limit less the pull, ends at its second root, which is sought
    /// from a guess by Halley's rule.
    fn lost(&self, guess: f64) -> f64 {
        let Self { start, sin: sin_start, cos: rise, drag } = *self;
        let (mut low, mut high) = (start, -start);
        let mut x = guess.clamp(low, high);
        for _ in 0..40 {
            let (sin, cos) = x.sin_cos();
            let span = x - start;
            let (gap, slope) = (cos - rise - drag * span, -sin - drag);
            let newton = gap / slope;
            if slope < 0.0 && newton.abs() < NEAR {
                let here = sin - sin_start - rise * span - 0.5 * drag * span * span;
                return (here - 0.5 * gap * newton).max(0.0);
            }
            // Left of the maximum the gap rises: the root lies to the right whatever its sign.
            (low, high) = if gap > 0.0 || slope >= 0.0 { (x, high) } else { (low, x) };
            let next = x - if slope < 0.0 { gap / (slope + 0.5 * newton * cos) } else { f64::NAN };
            x = if next > low && next < high { next } else { 0.5 * (low + high) };
            if high - low < 1e-9 {
                break;
            }
        }
        let span = x - start;
        (x.sin() - sin_start - rise * span - 0.5 * drag * span * span).max(0.0)
    }

    /// The root by bisection, from right of the maximum of the gap.
    fn root(&self) -> f64 {
        let gap = |x: f64| x.cos() - self.cos - self.drag * (x - self.start);
        models::root::bisection([-self.drag.min(1.0).asin(), -self.start], 50, |x| gap(x) > 0.0)
    }
}

/// Cells of the guesses in each direction.
const CELLS: usize = 64;

/// Guesses of the root, made on first use: see [`super::prepare`]. Nodes are evenly spaced in the square
/// roots of what the root is not smooth in.
pub(super) struct Guesses {
    /// Where sticking begins at touch-down: the root's share of the contact.
    early: Vec<[f32; CELLS + 1]>,
    /// Where it begins later, below and above half of the largest rate.
    late: [[f32; CELLS + 1]; 2],
}

pub(super) fn guesses() -> &'static Guesses {
    static GUESSES: OnceLock<Guesses> = OnceLock::new();
    GUESSES.get_or_init(|| {
        let share = |i: usize| i as f64 / CELLS as f64;
        let early = |i: usize, j: usize| {
            // At either end the share has a limit; close to it will do for a guess.
            let phi = (PI * (1.0 - share(i).powi(2))).clamp(1e-3, PI - 1e-6);
            let drag = share(j).powi(2).min(1.0 - 1e-9) * phi.sin();
            let began = Began { start: -phi, sin: -phi.sin(), cos: phi.cos(), drag };
            (0.5 + 0.5 * began.root() / phi) as f32
        };
        let late = |drag: f64| {
            let drag = drag.clamp(1e-9, 1.0 - 1e-9);
            let cos = -(1.0 - drag * drag).sqrt();
            Began { start: -PI + drag.asin(), sin: -drag, cos, drag }.root() as f32
        };
        Guesses {
            early: (0..=CELLS).map(|i| std::array::from_fn(|j| early(i, j))).collect(),
            late: [
                std::array::from_fn(|i| late(0.5 * share(i).powi(2))),
                std::array::from_fn(|i| late(1.0 - 0.5 * share(i).powi(2))),
            ],
        }
    })
}

impl Guesses {
    fn early(&self, phi: f64, part: f64) -> f64 {
        let ((i, a), (j, b)) = (cell((1.0 - phi / PI).max(0.0).sqrt()), cell(part.sqrt()));
        let (low, high) = (&self.early[i], &self.early[i + 1]);
        let along = |row: &[f32; CELLS + 1]| row[j] + b * (row[j + 1] - row[j]);
        f64::from(along(low) + a * (along(high) - along(low)))
    }

    fn late(&self, drag: f64) -> f64 {
        let (row, place) = if drag < 0.5 { (0, drag) } else { (1, 1.0 - drag) };
        let ((i, a), row) = (cell((2.0 * place).sqrt()), &self.late[row]);
        f64::from(row[i] + a * (row[i + 1] - row[i]))
    }
}

/// The cell of a share of the axis, and the place in it.
fn cell(share: f64) -> (usize, f32) {
    let s = share * CELLS as f64;
    let i = (s as usize).min(CELLS - 1);
    (i, (s - i as f64) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The integral over the contact in small steps, the root found by stepping: it neither guesses nor
    /// corrects.
    fn by_steps(phi: f64, drag: f64) -> f64 {
        const STEPS: usize = 200_000;
        let h = 2.0 * phi / STEPS as f64;
        let limit = |i: usize| (-phi + i as f64 * h).cos() - phi.cos();
        let (mut held, mut sum) = (0.0f64, 0.0);
        for i in 1..=STEPS {
            let before = limit(i - 1) - held;
            held = (held + drag * h).min(limit(i));
            sum += 0.5 * h * (before + limit(i) - held);
        }
        sum
    }

    #[test]
    fn what_sticking_loses_is_that_of_small_steps() {
        let mut worst = 0.0f64;
        for i in 1..40 {
            let phi = PI * f64::from(i) / 40.0;
            for drag in [1e-4, 0.003, 0.02, 0.1, 0.3, 0.6, 0.9, 0.999] {
                let expected = by_steps(phi, drag);
                worst = worst.max((lost(phi, phi.sin_cos(), drag) - expected).abs());
            }
        }
        assert!(worst < 1e-8, "{worst:.1e}");
    }
}
