//! Zeros with the finger lifted: taken explicitly, before and after a run.

use super::noise::mean_with_uncertainty;
use super::{AXES, Axis};
use crate::certificate::Certificate;

/// A zero reading of both channels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Zero {
    /// Mean counts, lateral and normal.
    pub counts: [f64; 2],
    /// Standard uncertainty of the means in counts, from the samples and their autocorrelation.
    pub standard_uncertainty: [f64; 2],
    /// Middle of the reading, in s on the run's clock.
    pub time_s: f64,
}

/// Why samples give no zero.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ZeroError {
    /// Not enough samples for a mean and its uncertainty.
    #[error("{found} samples are too few for a zero, {needed} are needed")]
    TooFew {
        /// Samples given.
        found: usize,
        /// Samples needed.
        needed: usize,
    },
    /// The channel moved while its zero was read: something still touched, or swung.
    #[error("the {axis} channel moved by {counts:.1} counts while its zero was read: is the finger lifted?")]
    Moving {
        /// The channel.
        axis: Axis,
        /// Difference of the two halves.
        counts: f64,
    },
    /// The zero after the run is too far from the one before.
    #[error("the {axis} zero moved by {counts:.1} counts over the run, {allowed:.1} are allowed")]
    Drifted {
        /// The channel.
        axis: Axis,
        /// After minus before.
        counts: f64,
        /// Limit.
        allowed: f64,
    },
    /// After is not after before.
    #[error("the second zero (at {after:.3} s) is not later than the first (at {before:.3} s)")]
    Order {
        /// Time of the first.
        before: f64,
        /// Time of the second.
        after: f64,
    },
}

impl Zero {
    /// The zero that a force certificate states, counted from its own time; `None` where it states none.
    pub fn of_certificate(certificate: &Certificate) -> Option<Self> {
        let lateral = certificate.parameter("lateral.offset")?;
        let normal = certificate.parameter("normal.offset")?;
        Some(Zero {
            counts: [lateral.value, normal.value],
            standard_uncertainty: [lateral.standard_uncertainty, normal.standard_uncertainty],
            time_s: 0.0,
        })
    }

    /// From samples with the finger lifted (counts of both channels, evenly spaced around `time_s`).
    /// The zeros of real sensors wander: `allowed_counts` is how far the second half of the reading may lie
    /// from the first, beyond five standard uncertainties of that difference.
    ///
    /// # Errors
    /// Fewer than 32 samples, or a channel that moved further than allowed.
    pub fn of_samples(
        samples: &[[f64; 2]],
        time_s: f64,
        allowed_counts: [f64; 2],
    ) -> Result<Self, ZeroError> {
        const NEEDED: usize = 32;
        if samples.len() < NEEDED {
            return Err(ZeroError::TooFew { found: samples.len(), needed: NEEDED });
        }
        let mut zero = Zero { counts: [0.0; 2], standard_uncertainty: [0.0; 2], time_s };
        for axis in AXES {
            let a = axis as usize;
            let channel: Vec<f64> = samples.iter().map(|s| s[a]).collect();
            let (mean, u) = mean_with_uncertainty(&channel);
            let (first, second) = channel.split_at(channel.len() / 2);
            let [(m1, u1), (m2, u2)] = [first, second].map(mean_with_uncertainty);
            let moved = m2 - m1;
            // The uncertainty of a half that is itself all one step would hide that step: half of it at most.
            let doubt = (5.0 * u1.hypot(u2)).min(0.5 * moved.abs());
            if moved.abs() > allowed_counts[a] + doubt {
                return Err(ZeroError::Moving { axis, counts: moved });
            }
            zero.counts[a] = mean;
            zero.standard_uncertainty[a] = u;
        }
        Ok(zero)
    }
}

/// Zeros before and after a run; between them the zero is taken to have moved in a straight line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ZeroPair {
    before: Zero,
    after: Zero,
}

impl ZeroPair {
    /// Two zeros of one run.
    ///
    /// # Errors
    /// Out of order, or further apart than `allowed_counts`.
    pub fn new(before: Zero, after: Zero, allowed_counts: [f64; 2]) -> Result<Self, ZeroError> {
        if after.time_s <= before.time_s {
            return Err(ZeroError::Order { before: before.time_s, after: after.time_s });
        }
        for axis in AXES {
            let a = axis as usize;
            let counts = after.counts[a] - before.counts[a];
            if counts.abs() > allowed_counts[a] {
                return Err(ZeroError::Drifted { axis, counts, allowed: allowed_counts[a] });
            }
        }
        Ok(ZeroPair { before, after })
    }

    /// The zero at a time. Its uncertainty is that of the two readings, and, since nobody knows how the
    /// zero moved between them, a rectangular one of half the movement in the middle of the run.
    pub fn at(&self, time_s: f64) -> Zero {
        let x = ((time_s - self.before.time_s) / (self.after.time_s - self.before.time_s)).clamp(0.0, 1.0);
        let mut zero = Zero { counts: [0.0; 2], standard_uncertainty: [0.0; 2], time_s };
        for a in 0..2 {
            let moved = self.after.counts[a] - self.before.counts[a];
            zero.counts[a] = self.before.counts[a] + x * moved;
            let read = ((1.0 - x) * self.before.standard_uncertainty[a])
                .hypot(x * self.after.standard_uncertainty[a]);
            let path = 2.0 * x * (1.0 - x) * moved.abs() / 3f64.sqrt();
            zero.standard_uncertainty[a] = read.hypot(path);
        }
        zero
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn still(level: f64, time_s: f64) -> Zero {
        Zero { counts: [level, -level], standard_uncertainty: [0.3; 2], time_s }
    }

    #[test]
    fn between_two_zeros_the_line_is_taken_and_its_doubt_stated() {
        let pair = ZeroPair::new(still(10.0, 0.0), still(14.0, 100.0), [5.0; 2]).unwrap();
        let middle = pair.at(50.0);
        assert_eq!(middle.counts, [12.0, -12.0]);
        // sqrt(0.5 (0.3)^2 + (2 / sqrt 3)^2)
        assert!((middle.standard_uncertainty[0] - (0.045f64 + 4.0 / 3.0).sqrt()).abs() < 1e-12);
        assert_eq!(pair.at(0.0), still(10.0, 0.0));
    }

    #[test]
    fn a_zero_that_moved_too_far_or_is_out_of_order_is_refused() {
        let far = ZeroPair::new(still(0.0, 0.0), still(9.0, 100.0), [5.0; 2]).unwrap_err();
        assert!(far.to_string().contains("lateral zero moved by 9.0 counts"));
        assert!(matches!(
            ZeroPair::new(still(0.0, 5.0), still(0.0, 5.0), [5.0; 2]),
            Err(ZeroError::Order { .. })
        ));
    }

    #[test]
    fn a_touching_finger_is_seen() {
        let samples: Vec<[f64; 2]> = (0..200)
            .map(|i| [f64::from(i % 3), if i < 100 { 0.0 } else { 50.0 } + f64::from(i % 2)])
            .collect();
        let error = Zero::of_samples(&samples, 1.0, [10.0; 2]).unwrap_err();
        assert!(error.to_string().contains("normal channel moved"), "{error}");
    }
}
