//! A wanted friction over position: what a loop renders.

use serde::{Deserialize, Serialize};

/// Wanted `mu'` over the position along the stroke: values on an even grid, read linearly between them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Target {
    /// Position of the first value in m.
    pub start_m: f64,
    /// Distance of two values in m.
    pub step_m: f64,
    /// Wanted `mu'`.
    pub mu_relative: Vec<f64>,
    /// Time in s by which the target is read ahead of the position, at the speed of the pass: what loop,
    /// amplifier and plate are known to take.
    #[serde(default, skip_serializing_if = "crate::quantity::is_zero")]
    pub lead_s: f64,
    /// Gains of a feedback on the measured friction; none: open loop.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub feedback: Option<Feedback>,
}

/// A proportional and integral correction of the wanted `mu'` by the measured one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Feedback {
    /// Proportional gain: change of the wanted `mu'` over the difference of `mu'` (-).
    pub proportional: f64,
    /// Integral gain in 1/s.
    pub integral_per_s: f64,
    /// Cycles by which a wanted `mu'` is measured later, besides the plate's ring-up.
    pub delay_cycles: usize,
    /// Time constant of the plate's ring-up in s: the measurement is compared with what was wanted that
    /// long ago.
    pub ring_time_s: f64,
}

/// Cycles of delay that a feedback can wait for.
pub const MOST_DELAY: usize = 31;

impl Target {
    /// The wanted `mu'` at a position in m; none beyond its ends.
    pub fn at(&self, position_m: f64) -> Option<f64> {
        let place = (position_m - self.start_m) / self.step_m;
        let last = self.mu_relative.len().checked_sub(1)?;
        if !(place >= 0.0 && place <= last as f64) {
            return None;
        }
        let index = (place as usize).min(last.saturating_sub(1));
        let [a, b] = [self.mu_relative[index], self.mu_relative[(index + 1).min(last)]];
        Some(a + (b - a) * (place - index as f64))
    }

    /// First and last position in m.
    pub fn span_m(&self) -> [f64; 2] {
        [self.start_m, self.start_m + self.step_m * self.mu_relative.len().saturating_sub(1) as f64]
    }
}

#[cfg(test)]
mod tests {
    use super::Target;

    #[test]
    fn it_is_read_linearly_and_ends_where_it_ends() {
        let target = Target {
            start_m: -1e-3,
            step_m: 1e-3,
            mu_relative: vec![0.2, 0.4, 1.0],
            lead_s: 0.0,
            feedback: None,
        };
        let near = |x: f64, mu: f64| assert!((target.at(x).expect("inside") - mu).abs() < 1e-12, "{x}");
        near(-1e-3, 0.2);
        near(-0.5e-3, 0.3);
        near(0.5e-3, 0.7);
        near(1e-3, 1.0);
        assert_eq!([target.at(-1.1e-3), target.at(1.1e-3), target.at(f64::NAN)], [None; 3]);
        assert_eq!(target.span_m(), [-1e-3, 1e-3]);
    }
}
