//! The conclusion at the end: model and measurement agree, they disagree, or there is too little to decide.
//!
//! That no alarm came is no evidence by itself: two passes raise none, and neither does a filter that takes
//! up what it should judge. So agreement needs passes with vibration, a scatter of their residuals that is
//! the stated one, and power: the departure of `mu'` that would have been seen must be small.

use super::sequential::{BETS, PULLS};
use super::{ALARM_LEVEL, PassComparison};
use serde::{Deserialize, Serialize};

/// Passes with vibration that must have been judged.
pub const ENOUGH_PASSES: u32 = 8;
/// Departure of `mu'`, the same at all amplitudes, that must have been visible: the difference of two laws at
/// `Psi = 1` is 0.2 (0.34 against 0.55), half of it must be visible.
pub const VISIBLE_DEPARTURE: f64 = 0.1;
/// Standard deviations of the root mean square residual that are borne above one.
const SCATTER_BORNE: f64 = 3.0;
/// Standard normal deviate of a power of 90 %.
const POWER_90: f64 = 1.281_551_565_544_600_4;

/// The finding of a run's comparison.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "finding", rename_all = "snake_case")]
pub enum Agreement {
    /// The measurement disagrees with the model.
    Departed,
    /// The residuals are what they should be, and a small departure would have been seen.
    Agrees {
        /// Passes with vibration that were judged.
        judged: u32,
        /// Root mean square of their residuals, in standard deviations.
        rms_z: f64,
        /// Departure of `mu'`, the same in all of them, that would have been seen with a probability of 90 %.
        visible_departure: f64,
    },
    /// Nothing speaks against the model, and not enough for it.
    TooLittle {
        /// What is missing.
        why: Lack,
        /// Passes with vibration that were judged.
        judged: u32,
        /// Departure of `mu'` that would have been seen with a probability of 90 %; none without judged passes.
        visible_departure: Option<f64>,
    },
}

/// What agreement lacks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Lack {
    /// Too few passes with vibration were judged.
    Passes,
    /// Only a large departure would have been seen.
    Power,
    /// The residuals scatter more than the stated noise, though not so surely that the model has left.
    Scatter,
    /// The sweep did not come to its end.
    Unfinished,
}

impl Agreement {
    /// The finding after the last pass that was compared; `complete` where the sweep came to its end.
    pub fn of(last: Option<&PassComparison>, complete: bool) -> Self {
        let Some(last) = last else {
            return Agreement::TooLittle { why: Lack::Passes, judged: 0, visible_departure: None };
        };
        if last.departed {
            return Agreement::Departed;
        }
        let (judged, visible_departure) = (last.judged, last.visible_departure);
        let lack = |why| Agreement::TooLittle { why, judged, visible_departure };
        let (Some(rms_z), Some(visible)) = (last.rms_z, visible_departure) else {
            return lack(Lack::Passes);
        };
        // The root mean square of n unit deviates has a deviation of 1 / sqrt(2 n).
        let borne = 1.0 + SCATTER_BORNE / (2.0 * f64::from(judged)).sqrt();
        if judged < ENOUGH_PASSES {
            lack(Lack::Passes)
        } else if rms_z > borne {
            lack(Lack::Scatter)
        } else if visible > VISIBLE_DEPARTURE {
            lack(Lack::Power)
        } else if !complete {
            lack(Lack::Unfinished)
        } else {
            Agreement::Agrees { judged, rms_z, visible_departure: visible }
        }
    }
}

impl std::fmt::Display for Agreement {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Agreement::Departed => write!(f, "the measurement disagrees with the model"),
            Agreement::Agrees { judged, rms_z, visible_departure } => write!(
                f,
                "agrees with the model ({judged} passes, residuals of {rms_z:.2} standard deviations rms); a constant \
                 deviation of mu' above {visible_departure:.3} would have been detected"
            ),
            Agreement::TooLittle { why, judged, visible_departure } => {
                write!(f, "cannot tell whether measurement and model agree: ")?;
                match why {
                    Lack::Passes => {
                        write!(f, "{judged} passes with vibration were compared; {ENOUGH_PASSES} are needed")
                    }
                    Lack::Power => {
                        let visible = visible_departure.unwrap_or(f64::INFINITY);
                        write!(
                            f,
                            "only a constant deviation of mu' above {visible:.2} would have been detected"
                        )
                    }
                    Lack::Scatter => write!(f, "the residuals scatter more than the stated noise"),
                    Lack::Unfinished => {
                        write!(f, "the sweep did not come to its end ({judged} passes judged)")
                    }
                }
            }
        }
    }
}

/// How a departure of `mu'` that is the same in all passes with vibration would show, carried through the
/// filter: what the shared parameters take up of it is not seen.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Power {
    taken_up: [f64; 3],
    /// Mean of each bet's score under a unit departure, and the score's variance.
    shift: [f64; PULLS],
    information: [f64; PULLS],
    /// Passes with vibration that were judged.
    pub judged: u32,
    squares: f64,
}

impl Power {
    /// Takes a pass: the force of a unit departure in N, the slope of the prediction, the filter's gain and
    /// the innovation's variance; `pulls` of the bets where the pass was judged, `z` where also with
    /// vibration.
    pub(super) fn push(
        &mut self,
        unit_n: f64,
        slope: &[f64; 3],
        gain: &[f64; 3],
        variance: f64,
        pulls: Option<[f64; PULLS]>,
        z: Option<f64>,
    ) {
        let seen = unit_n - super::dot(slope, &self.taken_up);
        for (taken, gain) in self.taken_up.iter_mut().zip(gain) {
            *taken += gain / variance * seen;
        }
        for (i, pull) in pulls.into_iter().flatten().enumerate() {
            self.shift[i] += pull * seen / variance.sqrt();
            self.information[i] += pull * pull;
        }
        if let Some(z) = z {
            self.squares += z * z;
            self.judged += 1;
        }
    }

    /// Root mean square of their residuals.
    pub(super) fn rms_z(&self) -> Option<f64> {
        (self.judged > 0).then(|| (self.squares / f64::from(self.judged)).sqrt())
    }

    /// Departure of `mu'` that the best of the bets on shifts would have seen with 90 %. What the shared
    /// parameters take up turns the sign of what later passes show, so one bet alone may see little of it.
    ///
    /// A bet's score is normal with mean `departure * shift` and variance n, its information; it alarms from
    /// where `score^2 / (2 (1 + n)) - ln(1 + n) / 2` passes the logarithm of bets over level.
    pub(super) fn visible(&self) -> Option<f64> {
        let by = |(shift, n): (&f64, &f64)| {
            let needed = 2.0 * ((BETS as f64).ln() - ALARM_LEVEL.ln()) + (1.0 + n).ln();
            (((1.0 + n) * needed).sqrt() + POWER_90 * n.sqrt()) / shift.abs()
        };
        let least = self.shift.iter().zip(&self.information).map(by).fold(f64::INFINITY, f64::min);
        (self.judged > 0 && least.is_finite()).then_some(least)
    }
}
