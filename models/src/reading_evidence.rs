//! Which reading of the paper's `w` a rig's own passes support, by how many nats.
//!
//! [`crate::psi_star`] fits `Psi*`. Between the readings the law's own error counts as one that all conditions have in common:
//! 0.055 rms in units of `4 mu' (1 - mu')`, nothing where friction is whole or gone. That is the scatter of the finite
//! element ridge about its own best exponential (Fig. 9's study under both readings, `docs/ridge.md`).

use crate::condition::Condition;
use crate::psi_star;
use crate::reading::Reading;
use crate::rig_file::PassNoise;
use serde::{Deserialize, Serialize};
use std::fmt;

/// `Psi*` that 'neither reading' holds for possible, evenly in its logarithm.
pub const PSI_STAR_RANGE: [f64; 2] = [0.3, 9.0];
/// Nats from which a reading is favoured: odds of 20 to 1.
pub const DECIDED_NATS: f64 = 2.995_732_273_553_991;
/// Standard deviation of `ln Psi*` up to which the two readings, a factor of 2 apart, are distinct.
const RESOLVED_SD: f64 = 0.25;

/// What the passes say of the readings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ReadingDecision {
    /// `w` is the whole stroke.
    PeakToPeak,
    /// `w` is the sine's amplitude.
    SineAmplitude,
    /// `Psi*` is known well enough, and lies between the two: neither is favoured.
    Between,
    /// Another `Psi*` is favoured, outside of what the two readings span.
    Neither,
    /// Too little is known.
    TooLittle,
}

/// The weights of the readings after some passes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct ReadingFinding {
    /// The conclusion.
    pub decision: ReadingDecision,
    /// Natural logarithm of the evidence for peak-to-peak over that for the sine's amplitude: negative favours the latter.
    pub nats: f64,
    /// Natural logarithm of the evidence for any other `Psi*` over that for the better of the two readings.
    pub neither_nats: f64,
    /// `Psi*` of the true stroke (-) that fits the passes best, whatever the readings say.
    pub psi_star: f64,
    /// Its interval of 95 %, low end.
    pub psi_star_low: f64,
    /// Its interval of 95 %, high end.
    pub psi_star_high: f64,
    /// Nine of ten of those passes lie, each by itself, at a `Psi*` from here ...
    pub passes_low: f64,
    /// ... to here; `None` where more than one in twenty has no friction below that without vibration.
    pub passes_high: Option<f64>,
    /// Passes with vibration behind it.
    pub judged: u32,
}

impl fmt::Display for ReadingFinding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (passes, nats) = (self.judged, self.nats.abs());
        write!(
            f,
            "fitted to {passes} passes with vibration: Psi* = {:.2} (95 %: {:.2} to {:.2}); 90 % of single passes give {:.2} to {}. ",
            self.psi_star,
            self.psi_star_low,
            self.psi_star_high,
            self.passes_low,
            self.passes_high.map_or("any more".into(), |high| format!("{high:.2}"))
        )?;
        match self.decision {
            ReadingDecision::PeakToPeak => {
                write!(f, "The paper's 2.38 fits, if its w is peak-to-peak ({})", likelier(nats))
            }
            ReadingDecision::SineAmplitude => {
                write!(f, "The paper's 1.19 fits, if its w is the amplitude of a sine ({})", likelier(nats))
            }
            ReadingDecision::Between => {
                f.write_str("It lies between 1.19 and 2.38 and supports neither reading of the paper's w")
            }
            ReadingDecision::Neither => f.write_str("Neither reading of the paper's w fits (Psi* 2.38 or 1.19)"),
            ReadingDecision::TooLittle => f.write_str(
                "The data support no reading of the paper's w (Psi* 2.38 or 1.19): run the plan 'psi-reading'",
            ),
        }
    }
}

/// Evidence in words: '60 times likelier'. Beyond a million the figure means nothing more.
fn likelier(nats: f64) -> String {
    match nats.exp() {
        odds if odds > 1e6 => "more than a million times likelier".into(),
        odds if odds >= 10.0 => {
            let step = 10f64.powf(odds.log10().floor() - 1.0);
            format!("{:.0} times likelier", (odds / step).round() * step)
        }
        odds => format!("{odds:.1} times likelier"),
    }
}

/// What the passes say: see [`psi_star::of_passes`], which has the same arguments.
pub fn of_passes(
    passes: impl IntoIterator<Item = (Condition, f64)>,
    poisson_ratio: f64,
    noise: PassNoise,
    scale_sd: f64,
) -> Option<ReadingFinding> {
    let fit = psi_star::of_passes(passes, poisson_ratio, noise, scale_sd)?;
    let (decision, nats, neither_nats) =
        decide(fit.psi_star.ln(), fit.noise_variance + fit.law_sd * fit.law_sd);
    Some(ReadingFinding {
        decision,
        nats,
        neither_nats,
        psi_star: fit.psi_star,
        psi_star_low: fit.low,
        psi_star_high: fit.high,
        passes_low: fit.passes_low,
        passes_high: fit.passes_high,
        judged: fit.passes,
    })
}

/// The conclusion on the readings where `ln Psi*` is known within a variance, and the two logarithms of odds.
fn decide(ln_star: f64, variance: f64) -> (ReadingDecision, f64, f64) {
    let normal = |away: f64, variance: f64| {
        -0.5 * (away * away / variance + variance.ln() + std::f64::consts::TAU.ln())
    };
    let [pp, sine] = Reading::ALL.map(|reading| {
        let (psi_star, sd) = reading.psi_star();
        normal(ln_star - psi_star.ln(), variance + (sd / psi_star).powi(2))
    });
    let neither = -(PSI_STAR_RANGE[1] / PSI_STAR_RANGE[0]).ln().ln();
    let (nats, neither_nats) = (pp - sine, neither - pp.max(sine));
    let span = [Reading::SineAmplitude, Reading::PeakToPeak].map(|reading| reading.psi_star().0.ln());
    // As near to the middle of the two as to the nearer one: that is neither's.
    let between = (ln_star - 0.5 * (span[0] + span[1])).abs() < 0.25 * (span[1] - span[0]);
    let decision = if variance.sqrt() > RESOLVED_SD && nats.abs() < DECIDED_NATS {
        ReadingDecision::TooLittle
    } else if neither_nats >= DECIDED_NATS && !(span[0]..=span[1]).contains(&ln_star) {
        ReadingDecision::Neither
    } else if between || nats.abs() < DECIDED_NATS || neither_nats >= DECIDED_NATS {
        ReadingDecision::Between
    } else if nats > 0.0 {
        ReadingDecision::PeakToPeak
    } else {
        ReadingDecision::SineAmplitude
    };
    (decision, nats, neither_nats)
}
