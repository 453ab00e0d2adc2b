//! `Psi*` of a rig's own passes, and which reading of the paper's `w` it favours, by how many nats.
//!
//! Eq. 20 has one free number, `Psi*`. It is fitted to the forces of the passes by weighted least squares, with `mu_0` from the passes
//! without vibration. Each pass weighs by its noise and by the law's own error, which is never fitted: the exponential is an
//! approximation, and a correction of it that depends on the conditions would trade against `Psi*`. The fit is a weighted mean of what each
//! condition gives by hand, `-Psi / ln(1 - mu')`, so it lies within the range of those values.
//!
//! What is estimated is the `Psi*` that this fit gives for the same conditions without noise: where the law holds it is the law's, and
//! elsewhere it belongs to these conditions. The interval is that of the noise. Between the readings the law's error counts too:
//! 0.055 rms in units of `4 mu' (1 - mu')`, nothing where friction is whole or gone, common to all passes. That is the scatter of the finite
//! element ridge about its own best exponential (Fig. 9's study under both readings, `docs/ridge.md`).

use crate::condition::Condition;
use crate::psi::{PsiEq17, relative_friction};
use crate::quantity::PeakToPeak;
use crate::reading::Reading;
use crate::rig_file::PassNoise;
use serde::{Deserialize, Serialize};
use std::fmt;

/// `Psi*` that 'neither reading' holds for possible, evenly in its logarithm.
pub const PSI_STAR_RANGE: [f64; 2] = [0.3, 9.0];
/// `Psi` of the true stroke at which passes are asked: about one, where the readings differ most. A pass at an end has half its weight.
pub const PSI_RANGE: [f64; 2] = [0.4, 4.0];
/// Factor about each end over which the weight goes from all to nothing: a `mu_0` with noise then moves no pass in or out at once.
pub const PSI_EDGE: f64 = 1.25;
/// Ends of the search for `Psi*`.
const SEARCH: [f64; 2] = [0.03, 90.0];
/// The law's error, rms, in units of 4 mu' (1 - mu'): how far a pass may be off the fit before it weighs less.
const LAW_SD: f64 = 0.055;
/// Standard deviations at which a pass begins to weigh less: one bad pass must not decide.
const ROBUST: f64 = 5.0;
/// Nats from which a reading is said to be favoured: odds of 20 to 1.
pub const DECIDED_NATS: f64 = 2.995_732_273_553_991;
/// Standard deviation of `ln Psi*` up to which the two readings, a factor of 2 apart, are told from what lies between them.
const RESOLVED_SD: f64 = 0.25;
/// Half a width of 95 % in standard deviations.
const Z95: f64 = 1.959_963_985;

/// What the passes say of the readings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Decision {
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
    /// What may be said.
    pub decision: Decision,
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
            "Psi* = {:.2} (95 %: {:.2} to {:.2}) fits {passes} passes with vibration best; single passes give {:.2} to {} \
             (90 % of them); ",
            self.psi_star,
            self.psi_star_low,
            self.psi_star_high,
            self.passes_low,
            self.passes_high.map_or("any more".into(), |high| format!("{high:.2}"))
        )?;
        match self.decision {
            Decision::PeakToPeak => {
                write!(f, "they support that the paper's {}, {}", Reading::PeakToPeak.words(), likelier(nats))
            }
            Decision::SineAmplitude => {
                write!(f, "they support that the paper's {}, {}", Reading::SineAmplitude.words(), likelier(nats))
            }
            Decision::Between => {
                f.write_str("it lies between Psi* 1.19 and 2.38 and supports neither reading of the paper's w")
            }
            Decision::Neither => f.write_str("neither reading of the paper's w fits (Psi* 2.38 or 1.19)"),
            Decision::TooLittle => f.write_str(
                "too little data to support a reading of the paper's w (Psi* 2.38 or 1.19): run the plan 'psi-reading'",
            ),
        }
    }
}

/// Evidence in words: 'which is 60 times likelier'. Beyond a million the figure means nothing more.
fn likelier(nats: f64) -> String {
    match nats.exp() {
        odds if odds > 1e6 => "which is more than a million times likelier".into(),
        odds if odds >= 10.0 => {
            let step = 10f64.powf(odds.log10().floor() - 1.0);
            format!("which is {:.0} times likelier", (odds / step).round() * step)
        }
        odds => format!("which is {odds:.1} times likelier"),
    }
}

/// A pass with vibration.
struct Judged {
    condition: Condition,
    force_n: f64,
}

/// What Eq. 20 says of a pass under a `Psi*`.
struct Under {
    /// Force in N.
    expected: f64,
    /// How much more of it there is for less of `ln Psi*`, in N.
    slope: f64,
    /// `4 mu' (1 - mu')` in N: what the law's error is counted in.
    law_n: f64,
    /// Variance of the pass's noise, in N^2.
    noise: f64,
    /// Its weight by its Psi, 0 to 1: [`PSI_RANGE`].
    asked: f64,
}

/// The passes of a table or a sweep, ready for the fit.
struct Passes {
    judged: Vec<Judged>,
    poisson_ratio: f64,
    noise: PassNoise,
}

/// What the passes say, in any order: each one's measured condition (whose `mu0` is ignored) and mean friction force in N, positive along
/// the sliding direction. `scale_sd` is the relative standard uncertainty of Psi that all passes share, of the gains of
/// amplitude and speed.
///
/// Left out are passes that the law says nothing of (no load, no speed, no finite force) and those whose Psi is far from one
/// ([`PSI_RANGE`]). `None` without a pass of each kind, or where friction under vibration is nowhere between none and that without.
pub fn of_passes(
    passes: impl IntoIterator<Item = (Condition, f64)>,
    poisson_ratio: f64,
    noise: PassNoise,
    scale_sd: f64,
) -> Option<ReadingFinding> {
    let usable = |v: f64| v.is_finite() && v > 0.0;
    let (mut still, mut judged) = (Vec::new(), Vec::new());
    for (c, force_n) in passes {
        let moves = usable(c.frequency_hz) && usable(c.amplitude.metres());
        if !usable(c.normal_force_n) || !usable(c.speed_m_s) || !force_n.is_finite() {
            continue;
        }
        if c.amplitude == PeakToPeak::ZERO {
            still.push((c.normal_force_n, force_n));
        } else if moves {
            judged.push(Judged { condition: c, force_n });
        }
    }
    let loads: f64 = still.iter().map(|(load, _)| load * load).sum();
    let mu0 = still.iter().map(|(load, force)| load * force).sum::<f64>() / loads;
    if !usable(mu0) {
        return None;
    }
    let force_variance = noise.force_sd_n.powi(2) * (1.0 + mu0 * mu0);
    let mu0_variance = still
        .iter()
        .map(|(load, _)| load * load * ((noise.pass_relative_sd * mu0 * load).powi(2) + force_variance))
        .sum::<f64>()
        / (mu0 * loads).powi(2);
    Passes { judged, poisson_ratio, noise }.finding(mu0, mu0_variance, scale_sd)
}

impl Passes {
    fn finding(&self, mu0: f64, mu0_variance: f64, scale_sd: f64) -> Option<ReadingFinding> {
        let ln_star = self.fit(mu0)?;
        // The slopes of the score in its unknowns, by differences: with what the passes are off by, which a linear law has not.
        let step = 1e-4;
        let slope = |f: &dyn Fn(f64) -> f64| (f(step) - f(-step)) / (2.0 * step);
        let in_star = slope(&|h| self.score(ln_star + h, mu0));
        let in_mu0 = slope(&|h| self.score(ln_star, mu0 * h.exp()));
        let mut variance = (in_mu0 / in_star).powi(2) * mu0_variance + scale_sd * scale_sd;
        let mut law = 0.0;
        for pass in &self.judged {
            let (under, weight) = self.weighed(pass, ln_star, mu0);
            let influence = under.slope * weight / in_star;
            variance += influence * influence * under.noise;
            law += influence * LAW_SD * under.law_n;
        }
        if !variance.is_finite() {
            return None;
        }
        let (judged, passes_low, passes_high) = self.each(mu0)?;
        let half = Z95 * variance.sqrt();
        let (decision, nats, neither_nats) = decide(ln_star, variance + law * law);
        Some(ReadingFinding {
            decision,
            nats,
            neither_nats,
            psi_star: ln_star.exp(),
            psi_star_low: (ln_star - half).exp(),
            psi_star_high: (ln_star + half).exp(),
            passes_low,
            passes_high,
            judged,
        })
    }

    /// `ln Psi*` where the score is nothing. Below what every pass gives by hand the score is negative, above it positive.
    fn fit(&self, mu0: f64) -> Option<f64> {
        let [mut low, mut high] = SEARCH.map(f64::ln);
        if !(self.score(low, mu0) < 0.0 && self.score(high, mu0) > 0.0) {
            return None;
        }
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if self.score(middle, mu0) < 0.0 { low = middle } else { high = middle }
        }
        Some(0.5 * (low + high))
    }

    /// Half the slope of the weighted squares in `ln Psi*`: a pass that is far off pulls no harder than [`ROBUST`] standard deviations.
    fn score(&self, ln_star: f64, mu0: f64) -> f64 {
        let pull = |pass: &Judged| {
            let under = self.under(pass, ln_star, mu0);
            let sd = under.noise.sqrt().hypot(LAW_SD * under.law_n);
            let off = (pass.force_n - under.expected) / sd;
            under.asked * under.slope * off / (1.0 + (off / ROBUST).powi(2)).sqrt() / sd
        };
        self.judged.iter().map(pull).sum()
    }

    /// A pass under a `Psi*`, and how the score's pull by it changes with its force, without the slope (N^-2).
    fn weighed(&self, pass: &Judged, ln_star: f64, mu0: f64) -> (Under, f64) {
        let under = self.under(pass, ln_star, mu0);
        let variance = under.noise + (LAW_SD * under.law_n).powi(2);
        let off = (pass.force_n - under.expected).powi(2) / variance;
        let weight = (1.0 + off / (ROBUST * ROBUST)).powf(-1.5) / variance;
        let weight = under.asked * weight;
        (under, weight)
    }

    fn under(&self, pass: &Judged, ln_star: f64, mu0: f64) -> Under {
        let c = &Condition { mu0, ..pass.condition };
        let (psi, full) = (PsiEq17::at(c, self.poisson_ratio), mu0 * c.normal_force_n);
        let ratio = psi.0 / ln_star.exp();
        let law = relative_friction(psi, ln_star.exp());
        let [relative, own] = [self.noise.pass_relative_sd, self.noise.force_sd_n];
        Under {
            expected: full * law,
            slope: full * ratio * (-ratio).exp(),
            law_n: full * 4.0 * law * (1.0 - law),
            noise: (relative * full * law).powi(2) + own * own * (1.0 + (mu0 * law).powi(2)),
            asked: asked(psi.0),
        }
    }

    /// How many passes are asked, and between which `Psi*` nine of ten lie, each by itself; no friction below that without vibration: infinite.
    fn each(&self, mu0: f64) -> Option<(u32, f64, Option<f64>)> {
        let by_hand = |pass: &Judged| {
            let c = &Condition { mu0, ..pass.condition };
            let psi = PsiEq17::at(c, self.poisson_ratio).0;
            if !(PSI_RANGE[0]..=PSI_RANGE[1]).contains(&psi) {
                return None;
            }
            let left = 1.0 - pass.force_n / (mu0 * c.normal_force_n);
            Some(if left <= 0.0 { f64::INFINITY } else { (-psi / left.ln()).max(0.0) })
        };
        let mut each: Vec<f64> = self.judged.iter().filter_map(by_hand).collect();
        each.sort_by(f64::total_cmp);
        let beyond = each.len() / 20;
        let high = *each.get(each.len().checked_sub(1 + beyond)?)?;
        Some((
            u32::try_from(each.len()).unwrap_or(u32::MAX),
            each[beyond],
            Some(high).filter(|high| high.is_finite()),
        ))
    }
}

/// The weight of a pass by its Psi: one within [`PSI_RANGE`], nothing far outside, smooth between.
fn asked(psi: f64) -> f64 {
    let edge = |beyond: f64| {
        let t = (0.5 + beyond.ln() / (2.0 * PSI_EDGE.ln())).clamp(0.0, 1.0);
        t * t * (3.0 - 2.0 * t)
    };
    edge(psi / PSI_RANGE[0]) * edge(PSI_RANGE[1] / psi)
}

/// What is said of the readings where `ln Psi*` is known within a variance; the two logarithms of odds.
fn decide(ln_star: f64, variance: f64) -> (Decision, f64, f64) {
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
        Decision::TooLittle
    } else if neither_nats >= DECIDED_NATS && !(span[0]..=span[1]).contains(&ln_star) {
        Decision::Neither
    } else if between || nats.abs() < DECIDED_NATS || neither_nats >= DECIDED_NATS {
        Decision::Between
    } else if nats > 0.0 {
        Decision::PeakToPeak
    } else {
        Decision::SineAmplitude
    };
    (decision, nats, neither_nats)
}
