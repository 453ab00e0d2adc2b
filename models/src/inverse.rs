//! The law turned round: the amplitude for a wanted friction, for open-loop control (the paper's last words).
//!
//! Drive power grows with w^2 (section 5.2, after its reference 31), so the least amplitude that reaches the
//! target is the cheapest. Friction need not fall evenly with the amplitude (regimes, doubled periods): the
//! first crossing is sought on a grid and then closed by bisection.

mod quick;

use crate::condition::{Condition, OutOfDomain};
use crate::prediction::{FrictionModel, Prediction};
use crate::quantity::PeakToPeak;
pub use quick::{MOST_EVALUATIONS, QuickAnswer, Reach, quick};

/// An amplitude for a wanted friction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AmplitudeAnswer {
    /// The least amplitude that reaches the target.
    pub amplitude: PeakToPeak,
    /// What the law predicts there.
    pub prediction: Prediction,
    /// Half-width of the amplitude that one standard deviation of the law makes, peak-to-peak in m;
    /// none where the law is flat or leaves the range within one standard deviation.
    pub amplitude_sd_m: Option<f64>,
    /// Drive power over that of 1 um peak-to-peak at the same frequency: w^2.
    pub relative_drive_power: f64,
}

/// Why there is no amplitude.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the message of an error says what its fields are")]
pub enum NoAmplitude {
    /// The condition or the target makes no sense.
    #[error(transparent)]
    Domain(#[from] OutOfDomain),
    /// Not reached by the largest amplitude.
    #[error("mu' = {wanted} is not reached: {largest_um} \u{b5}m peak-to-peak gives {reached:.3} here")]
    OutOfReach { wanted: f64, largest_um: f64, reached: f64 },
}

const STEPS: usize = 400;

/// The least amplitude up to `largest` at which `law` predicts `mu_relative` or less.
///
/// # Errors
/// A target outside (0, 1], a condition outside the law's domain, or a target that is out of reach.
pub fn amplitude_for(
    law: &dyn FrictionModel,
    condition: &Condition,
    mu_relative: f64,
    largest: PeakToPeak,
) -> Result<AmplitudeAnswer, NoAmplitude> {
    let possible = mu_relative > 0.0 && mu_relative <= 1.0;
    OutOfDomain::unless(possible, "mu_relative", mu_relative, "a number above 0 and at most 1")?;
    let at = |w: f64| law.predict(&Condition { amplitude: PeakToPeak::from_metres(w), ..*condition });
    let crossing = |target: f64| -> Result<Option<f64>, OutOfDomain> {
        if at(0.0)?.mu_relative <= target {
            return Ok(Some(0.0));
        }
        let mut low = 0.0;
        for k in 1..=STEPS {
            let mut high = largest.metres() * k as f64 / STEPS as f64;
            if at(high)?.mu_relative > target {
                low = high;
                continue;
            }
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                if at(middle)?.mu_relative > target { low = middle } else { high = middle }
            }
            return Ok(Some(high));
        }
        Ok(None)
    };
    let Some(w) = crossing(mu_relative)? else {
        let (reached, largest_um) = (at(largest.metres())?.mu_relative, largest.metres() * 1e6);
        return Err(NoAmplitude::OutOfReach { wanted: mu_relative, largest_um, reached });
    };
    let prediction = at(w)?;
    let sd = prediction.mu_relative_sd;
    let early = if mu_relative + sd <= 1.0 { crossing(mu_relative + sd)? } else { None };
    let late = if mu_relative - sd > 0.0 { crossing(mu_relative - sd)? } else { None };
    Ok(AmplitudeAnswer {
        amplitude: PeakToPeak::from_metres(w),
        prediction,
        amplitude_sd_m: early.zip(late).map(|(a, b)| 0.5 * (b - a).abs()),
        relative_drive_power: (w / 1e-6).powi(2),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::finger::Finger;
    use crate::prediction::SpringSlider;

    #[test]
    fn there_and_back() {
        let law = SpringSlider::new(Finger::paper()).expect("the paper's finger");
        let c = Condition { amplitude: PeakToPeak::from_metres(1.7e-6), ..Condition::paper() };
        let mu = law.predict(&c).expect("inside").mu_relative;
        let answer = amplitude_for(&law, &c, mu, PeakToPeak::from_metres(10e-6)).expect("reached");
        assert!((answer.amplitude.metres() - 1.7e-6).abs() < 1e-12);
        assert!((answer.relative_drive_power - 1.7 * 1.7).abs() < 1e-6);
    }

    #[test]
    fn out_of_reach_and_nonsense_are_said() {
        let law = SpringSlider::new(Finger::paper()).expect("the paper's finger");
        let reach = |mu, w| amplitude_for(&law, &Condition::paper(), mu, PeakToPeak::from_metres(w));
        assert!(matches!(reach(0.05, 2e-6), Err(NoAmplitude::OutOfReach { .. })));
        for bad in [0.0, -1.0, 1.5, f64::NAN] {
            assert!(matches!(reach(bad, 2e-6), Err(NoAmplitude::Domain(_))));
        }
    }
}
