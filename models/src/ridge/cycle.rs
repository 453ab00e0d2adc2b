//! The summary of a vibration cycle, and the judgement whether the cycles have become steady.

use serde::Serialize;

/// Bins of phase in a cycle.
pub const BINS: usize = 256;

/// One cycle in bins of equal time; phase zero is the plate's upward passage through its middle.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RidgeCycle {
    /// Mean normal force in each bin, N per metre of depth.
    pub normal: Vec<f64>,
    /// Mean lateral force in each bin, N per metre of depth.
    pub lateral: Vec<f64>,
    /// Mean vertical velocity of the skin under the vibrometer's spot, m/s, upwards (into the finger).
    pub skin_velocity: Vec<f64>,
    /// Share of the cycle in contact.
    pub contact_fraction: f64,
}

impl Default for RidgeCycle {
    fn default() -> Self {
        RidgeCycle {
            normal: vec![0.0; BINS],
            lateral: vec![0.0; BINS],
            skin_velocity: vec![0.0; BINS],
            contact_fraction: 0.0,
        }
    }
}

impl RidgeCycle {
    /// Mean normal force, N per metre.
    pub fn mean_normal(&self) -> f64 {
        mean(&self.normal)
    }

    /// Mean lateral force, N per metre.
    pub fn mean_lateral(&self) -> f64 {
        mean(&self.lateral)
    }

    /// The mean of several cycles, bin by bin.
    pub fn average(cycles: &[RidgeCycle]) -> RidgeCycle {
        let mut sum = RidgeCycle::default();
        let share = 1.0 / cycles.len() as f64;
        for cycle in cycles {
            for (field, values) in [
                (&mut sum.normal, &cycle.normal),
                (&mut sum.lateral, &cycle.lateral),
                (&mut sum.skin_velocity, &cycle.skin_velocity),
            ] {
                field.iter_mut().zip(values).for_each(|(s, v)| *s += share * v);
            }
            sum.contact_fraction += share * cycle.contact_fraction;
        }
        sum
    }

    /// Phase in degrees, 0 to 360, by which the skin's greatest acceleration follows the plate's (Eq. 1).
    /// The plate's is at its lowest point, 270 degrees.
    pub fn phase_shift_deg(&self) -> f64 {
        let v = &self.skin_velocity;
        // Half a vibrometer's bandwidth either way: a 40th of the period, 1.1 MHz at 27.5 kHz.
        const REACH: usize = BINS / 80;
        let at = |i: isize| v[i.rem_euclid(BINS as isize) as usize];
        let acceleration: Vec<f64> =
            (0..BINS as isize).map(|i| (1..=REACH as isize).map(|k| at(i + k) - at(i - k)).sum()).collect();
        let peak = (0..BINS).max_by(|a, b| acceleration[*a].total_cmp(&acceleration[*b])).unwrap_or(0);
        let around = |k: isize| acceleration[(peak as isize + k).rem_euclid(BINS as isize) as usize];
        let (before, here, after) = (around(-1), around(0), around(1));
        let bend = before - 2.0 * here + after;
        let shift = if bend < 0.0 { (0.5 * (before - after) / bend).clamp(-0.5, 0.5) } else { 0.0 };
        // Bin i is centred half a bin after its start.
        let phase = 360.0 * (peak as f64 + 0.5 + shift) / BINS as f64;
        (phase - 270.0).rem_euclid(360.0)
    }

    /// Phase in degrees, 0 to 360 after the plate's greatest acceleration, at which the longest absence of
    /// contact ends; none if contact is never lost.
    pub fn touch_down_deg(&self) -> Option<f64> {
        let open = 1e-3 * self.mean_normal();
        let away = |i: usize| self.normal[i % BINS] <= open;
        let mut best = (0, 0);
        for start in (0..BINS).filter(|i| away(*i) && !away(i + BINS - 1)) {
            let length = (0..BINS).take_while(|k| away(start + k)).count();
            if length > best.1 {
                best = (start, length);
            }
        }
        (best.1 > 0).then(|| (360.0 * (best.0 + best.1) as f64 / BINS as f64 - 270.0).rem_euclid(360.0))
    }
}

/// When to stop.
#[derive(Clone, Copy, Debug, PartialEq, serde::Deserialize, Serialize)]
pub struct Steady {
    /// Tolerance on mu'; the relative mean reaction, whose drift cancels in mu', has three times as much.
    pub tolerance: f64,
    /// Fewest cycles at full amplitude.
    pub at_least: usize,
    /// Most cycles at full amplitude; then the run ends as not steady.
    pub at_most: usize,
}

impl Default for Steady {
    fn default() -> Self {
        Steady { tolerance: 0.004, at_least: 12, at_most: 300 }
    }
}

impl Steady {
    /// Number of last cycles to average over, once they are steady: the means of both halves of the later
    /// half of the run agree within the tolerance, and so does twice the standard error of its pairs.
    /// Pairs, because a doubled period alternates.
    pub fn window(&self, values: &[[f64; 2]]) -> Option<usize> {
        let n = values.len();
        let window = (n / 2) & !1;
        if n < self.at_least || window < 4 {
            return None;
        }
        let last = &values[n - window..];
        let steady = (0..2).all(|k| {
            let pairs: Vec<f64> = last.chunks_exact(2).map(|p| 0.5 * (p[0][k] + p[1][k])).collect();
            let (early, late) = pairs.split_at(pairs.len() / 2);
            let middle = mean(&pairs);
            let variance = pairs.iter().map(|v| (v - middle).powi(2)).sum::<f64>() / (pairs.len() - 1) as f64;
            let tolerance = self.tolerance * if k == 0 { 1.0 } else { 3.0 };
            (mean(early) - mean(late)).abs() < tolerance
                && 2.0 * (variance / pairs.len() as f64).sqrt() < tolerance
        });
        steady.then_some(window)
    }
}

/// Whether the contact repeats every second cycle and not every cycle: the change of the reaction force
/// over two cycles is far smaller than over one, which is not small itself.
pub fn period_doubled(cycles: &[RidgeCycle]) -> bool {
    let distance = |lag: usize| {
        let sum: f64 = (lag..cycles.len())
            .map(|c| {
                let pairs = cycles[c].normal.iter().zip(&cycles[c - lag].normal);
                pairs.map(|(a, b)| (a - b).powi(2)).sum::<f64>()
            })
            .sum();
        (sum / ((cycles.len() - lag) * BINS) as f64).sqrt()
    };
    if cycles.len() < 6 {
        return false;
    }
    let size = mean(&cycles[0].normal);
    let (one, two) = (distance(1), distance(2));
    one > 0.1 * size && two < 0.5 * one
}

pub(crate) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}
