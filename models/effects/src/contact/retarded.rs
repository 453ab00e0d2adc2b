//! The contact of a massless spring with a dashpot beside it (Kelvin-Voigt), in units of `k_n w/2` and phases
//! of the plate's sine: the skin leaves the plate where the force ends, recovers, and meets the plate again.

use std::f64::consts::PI;

/// Where contact begins, how long it lasts, and how deep the skin's mean plane lies.
#[derive(Debug, Clone, Copy)]
pub(super) struct Retarded {
    pub start: f64,
    pub arc: f64,
    pub depth: f64,
}

/// Width of a bracket, and a difference of loads, at which a root is found.
const FOUND: f64 = 1e-9;
/// Step of Newton's rule after which an angle is exact enough: the next error is its square.
const LAST_STEP: f64 = 1e-5;
/// Contact that is taken for none.
const NO_ARC: f64 = 1e-6;

impl Retarded {
    /// The contact that carries a mean load under a lag `2 pi f` times the retardation time.
    pub fn carrying(load: f64, lag: f64) -> Self {
        let reach = (1.0 + lag * lag).sqrt();
        let peak = 1f64.atan2(lag); // phase of the largest force
        let whole = Self { start: peak - PI, arc: 2.0 * PI, depth: load };
        // Full contact: the force stays positive for the whole cycle.
        if load >= reach {
            return whole;
        }
        // The load rises with the depth: Newton's rule, within a bracket.
        let (mut low, mut high) = (-reach, reach);
        let mut depth = reach * (2.0 * (load / reach).sqrt() - 1.0);
        for _ in 0..60 {
            let (contact, carried, slope) = Self::at(depth, lag, reach, peak);
            let over = carried - load;
            if over.abs() < FOUND {
                return contact;
            }
            (low, high) = if over > 0.0 { (low, depth) } else { (depth, high) };
            if high - low < FOUND {
                // Between a contact that lasts almost the whole cycle and one that never ends.
                return if reach - high < 2.0 * FOUND { whole } else { contact };
            }
            let newton = depth - over / slope;
            depth = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        }
        Self::at(depth, lag, reach, peak).0
    }

    /// The contact at a depth, the mean load that it carries, and the derivative of that.
    fn at(depth: f64, lag: f64, reach: f64, peak: f64) -> (Self, f64, f64) {
        let end = peak + (-depth / reach).clamp(-1.0, 1.0).acos();
        let (sin_end, cos_end) = end.sin_cos();
        let left = sin_end + depth; // compression at lift-off, recovering exponentially
        // The skin meets the plate again between the plate's lowest point and its next highest.
        let gap = |theta: f64| {
            let ((sin, cos), remains) = (theta.sin_cos(), left * (-(theta - end) / lag).exp());
            (sin + depth - remains, cos + remains / lag)
        };
        let lowest = if gap(1.5 * PI).0 < 0.0 { 1.5 * PI } else { end + NO_ARC };
        let none = Self { start: end - 2.0 * PI, arc: NO_ARC, depth };
        let Some(again) = meets(lowest, 2.0 * PI - depth.clamp(-1.0, 1.0).asin(), gap) else {
            // Deeper, but nobody knows how far.
            return (none, 0.0, f64::NAN);
        };
        let (sin, cos) = again.sin_cos();
        let arc = end - again + 2.0 * PI;
        let carried = (cos - cos_end + depth * arc + lag * (sin_end - sin)) / (2.0 * PI);
        // The force at touch-down jumps: the load also changes with where that is.
        let remains = (-(again - end) / lag).exp();
        let end_moves = 1.0 / (reach * reach - depth * depth).max(1e-12).sqrt();
        let gap_moves = 1.0 - remains * (1.0 + cos_end * end_moves + left * end_moves / lag);
        let again_moves = -gap_moves / (cos + remains * left / lag);
        let slope = (arc - (sin + depth + lag * cos) * again_moves) / (2.0 * PI);
        (Self { start: again - 2.0 * PI, arc, depth }, carried, slope)
    }
}

/// Where a gap with its derivative rises through zero, between an angle and the plate's next highest point;
/// the angle itself where the skin has hardly left the plate, none where it does not meet it in this cycle.
fn meets(lowest: f64, guess: f64, gap: impl Fn(f64) -> (f64, f64)) -> Option<f64> {
    let (mut low, mut high) = (lowest, 2.5 * PI);
    let mut x = if guess > low && guess < high { guess } else { 0.5 * (low + high) };
    for _ in 0..60 {
        let (value, slope) = gap(x);
        (low, high) = if value > 0.0 { (low, x) } else { (x, high) };
        let newton = x - value / slope;
        if (newton - x).abs() < LAST_STEP && newton > lowest {
            return Some(newton);
        }
        if high - low < FOUND {
            break;
        }
        x = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
    }
    (high < 2.5 * PI).then_some(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The skin in small steps from lift-off: it recovers until it meets the plate, and then carries the
    /// load.
    #[test]
    fn a_contact_carries_its_load_and_begins_where_the_recovered_skin_meets_the_plate() {
        for i in 1..40 {
            for j in 0..60 {
                let (load, lag) = (f64::from(i) / 40.0, 10f64.powf(-2.0 + 0.05 * f64::from(j)));
                let Retarded { start, arc, depth } = Retarded::carrying(load, lag);
                let steps = 20_000;
                let h = arc / f64::from(steps);
                let force = |x: f64| x.sin() + depth + lag * x.cos();
                let carried = (0..steps).map(|k| force(start + (f64::from(k) + 0.5) * h)).sum::<f64>() * h;
                let wrong = carried / (2.0 * PI) - load;
                assert!(wrong.abs() < 1e-6, "load {load}, lag {lag:.3}: carries {wrong:.1e} more");
                if arc > 2.0 * PI - 1e-3 {
                    continue;
                }
                let end = start + arc;
                assert!(force(end).abs() < 1e-6, "load {load}, lag {lag:.3}");
                let left = (end.sin() + depth) * (-(2.0 * PI - arc) / lag).exp();
                let gap = start.sin() + depth - left;
                assert!(gap.abs() < 1e-6, "load {load}, lag {lag:.3}: the skin is {gap:.1e} off the plate");
            }
        }
    }

    /// The arc falls evenly as the lag grows: no lag is taken for a contact that never ends.
    #[test]
    fn no_lag_stands_out_of_its_neighbours() {
        for i in 1..12 {
            let load = 0.02 * f64::from(i);
            let arcs: Vec<f64> = (0..300)
                .map(|j| Retarded::carrying(load, 10f64.powf(-2.0 + 0.01 * f64::from(j))).arc)
                .collect();
            assert!(arcs.windows(2).all(|w| (w[1] - w[0]).abs() < 0.05), "load {load}");
        }
    }
}
