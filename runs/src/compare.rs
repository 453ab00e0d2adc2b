//! Two runs side by side: passes paired by their condition, and whether they differ by more than their uncertainty explains.
//!
//! The passes of a run are divided by one `mu_0`, so their errors are not independent: an error of the reference moves all of
//! them in proportion. Differences therefore carry a full covariance, the scatter of passes on its diagonal and a term of rank one
//! for the references of both runs. Calibration that both runs share (gains, stiffnesses) cancels in a difference and is left out.

use crate::ambient::{OfAir, air_set, air_words, one_air, values};
use crate::format::{p_value, quantity};
use crate::report::levels;
use crate::{MeasuredPass, RunData};
use models::pass::{Pass, REVERSED, coulomb_coefficient};
use models::{Ambient, PassNoise, PeakToPeak};
use realtime::compare::VISIBLE_DEPARTURE;
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};

pub mod differences;
mod folders;
pub mod groups;

pub use folders::Compared;

/// Level of the whole answer: `mu_0`, shift, scatter and greatest difference have a quarter of it each.
pub const LEVEL: f64 = 0.05;
const EACH: f64 = LEVEL / 4.0;
/// Least number of common conditions for a conclusion on agreement.
pub const ENOUGH_CONDITIONS: usize = 5;
/// Relative distances within which two passes have the same condition: amplitude, frequency, speed, load.
const SAME: [f64; 4] = [0.03, levels::FREQUENCY, levels::SPEED, levels::FORCE];

/// `mu_0` of a run with its relative standard uncertainty from the scatter of its passes without vibration.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Reference {
    /// Friction coefficient without vibration.
    pub mu0: f64,
    /// Its relative standard uncertainty; calibration that both runs share is not in it.
    pub relative_sd: f64,
}

/// One side of a comparison.
#[derive(Clone, Debug)]
pub struct Side {
    /// The passes, each at the level of the air that its plan states.
    pub passes: Vec<Pass>,
    /// Quantities of the air that its plan sets.
    pub sets: OfAir<bool>,
    /// How passes of that rig repeat.
    pub noise: PassNoise,
}

/// The mean of a run's passes at one condition.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Mean {
    /// Relative friction.
    pub mu_relative: f64,
    /// Standard uncertainty from pass to pass; that of the reference is not in it.
    pub sd: f64,
    /// Passes.
    pub passes: usize,
}

/// A condition that both runs have.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Paired {
    /// Peak-to-peak amplitude in m.
    pub amplitude_pp_m: f64,
    /// Frequency in Hz.
    pub frequency_hz: f64,
    /// Speed in m/s.
    pub speed_m_s: f64,
    /// Direction of sliding.
    pub direction: i8,
    /// Normal force in N.
    pub normal_force_n: f64,
    /// The levels of the air that a plan sets.
    #[serde(flatten)]
    pub air: Ambient,
    /// The first run.
    pub a: Mean,
    /// The second run.
    pub b: Mean,
    /// Second less first.
    pub difference: f64,
    /// Its standard uncertainty, with that of both references.
    pub difference_sd: f64,
}

impl Paired {
    /// The condition in words.
    pub fn setting(&self) -> String {
        let speed = self.speed_m_s * f64::from(self.direction);
        let (w, f, load) = (self.amplitude_pp_m, self.frequency_hz, self.normal_force_n);
        let all = [(w, "m"), (f, "Hz"), (speed, "m/s"), (load, "N")].map(|(v, unit)| quantity(v, unit));
        all.into_iter().chain(air_words(&self.air)).collect::<Vec<_>>().join(", ")
    }

    /// The difference in standard deviations.
    pub fn deviations(&self) -> f64 {
        self.difference / self.difference_sd
    }
}

/// What the comparison comes to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ComparisonAnswer {
    /// The runs differ by more than their uncertainty explains.
    Differ,
    /// No difference was seen, and one of [`VISIBLE_DEPARTURE`] would have been.
    NoDifferenceSeen,
    /// Too few conditions in common, or too uncertain ones.
    CannotTell,
    /// One run is the other one again, or both have one seed on the virtual rig: that they are alike proves nothing.
    NotIndependent,
}

impl RunComparison {
    /// The pairs, those furthest apart first.
    pub fn furthest_first(&self) -> Vec<&Paired> {
        let mut pairs: Vec<&Paired> = self.pairs.iter().collect();
        pairs.sort_by(|x, y| y.deviations().abs().total_cmp(&x.deviations().abs()));
        pairs
    }

    /// The answer; without a condition in common none can be given.
    pub fn answer(&self) -> ComparisonAnswer {
        self.judged.as_ref().map_or(ComparisonAnswer::CannotTell, |judged| judged.answer)
    }

    /// The answer in words.
    pub fn answer_words(&self) -> String {
        let Some(judged) = &self.judged else {
            return "cannot tell: the runs have no condition in common".into();
        };
        let shift = format!("a shift of mu' above {:.3} that all conditions share", judged.visible_shift);
        let mu0 = format!("a change of mu_0 above {:.1} %", 100.0 * judged.visible_mu0);
        match judged.answer {
            ComparisonAnswer::Differ => format!(
                "the runs differ in {} by more than their uncertainty explains",
                judged.differ_in.join(" and ").replace("mu_relative", "mu'")
            ),
            ComparisonAnswer::NoDifferenceSeen => format!(
                "no difference seen; with 90 % probability these would have been detected: {shift}, above {:.3} at one \
                 condition alone, {mu0}",
                judged.visible_at_one
            ),
            ComparisonAnswer::NotIndependent => {
                "cannot tell: the runs are not independent of each other".into()
            }
            ComparisonAnswer::CannotTell => format!(
                "cannot tell: {} conditions in common, and only {shift}, or {mu0}, would have been detected",
                self.pairs.len()
            ),
        }
    }

    /// The figures behind it in words: shift of `mu'` and scatter about it, or, where the differences vary,
    /// from where to where, and only then their mean; a condition that differs most; `mu_0`.
    pub fn figures_words(&self) -> Vec<String> {
        let [a, b] = self.references.map(|r| format!("{:.3} \u{b1} {:.3}", r.mu0, r.mu0 * r.relative_sd));
        let references = format!("mu_0: {a} and {b}");
        let Some(judged) = &self.judged else { return vec![references] };
        let ([low, high], conditions) = (judged.shift_interval_95, self.pairs.len());
        let shift = format!("{:+.4}, 95 % interval {low:+.4} to {high:+.4}", judged.shift);
        let (chi2, degrees) = (judged.scatter_chi2, judged.scatter_degrees);
        let scatter =
            format!("chi2 {chi2:.1} at {degrees} degrees of freedom, {}", p_value(judged.scatter_p));
        let stated =
            |p: &Paired| format!("{:+.3} +- {:.3} at {}", p.difference, p.difference_sd, p.setting());
        let by_difference = |a: &&Paired, b: &&Paired| a.difference.total_cmp(&b.difference);
        let mut all = match (self.pairs.iter().min_by(by_difference), self.pairs.iter().max_by(by_difference))
        {
            (Some(least), Some(most)) if judged.varies() => vec![
                format!(
                    "the difference of mu' varies over {conditions} conditions, from {} to {} ({scatter})",
                    stated(least),
                    stated(most)
                ),
                format!("no single shift describes that: their weighted mean is {shift}"),
            ],
            _ => vec![
                format!("{conditions} conditions: mu' shifts by {shift} ({})", p_value(judged.shift_p)),
                format!("scatter about it: {scatter}"),
            ],
        };
        let furthest = self.furthest_first().into_iter().take(usize::from(judged.furthest_p < EACH));
        all.extend(furthest.map(|p| {
            let p_value = p_value(judged.furthest_p);
            format!("furthest: {} ({p_value} as the greatest of {conditions})", stated(p))
        }));
        let change = 100.0 * (self.references[1].mu0 / self.references[0].mu0 - 1.0);
        all.push(format!("{references}, {change:+.1} % ({})", p_value(judged.mu0_p)));
        all
    }
}

/// The statistics of the paired differences, and of `mu_0`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Judged {
    /// Two-sided p-value of one `mu_0`.
    pub mu0_p: f64,
    /// Shift of `mu'` that all conditions have in common, second less first (generalised least squares).
    pub shift: f64,
    /// Its standard uncertainty, references included.
    pub shift_sd: f64,
    /// Bounds of its interval of 95 %.
    pub shift_interval_95: [f64; 2],
    /// Two-sided p-value of no shift.
    pub shift_p: f64,
    /// Chi-square of the differences about that shift.
    pub scatter_chi2: f64,
    /// Its degrees of freedom.
    pub scatter_degrees: usize,
    /// p-value of scatter no larger than stated.
    pub scatter_p: f64,
    /// p-value of the greatest difference in standard deviations, corrected for the number of conditions.
    pub furthest_p: f64,
    /// Shift common to all conditions that would have been seen with a probability of 90 %.
    pub visible_shift: f64,
    /// The same of a shift at one condition, whichever it is.
    pub visible_at_one: f64,
    /// The same of a relative change of `mu_0`.
    pub visible_mu0: f64,
    /// What differs: `mu_0`, `mu_relative`, both or nothing.
    pub differ_in: Vec<&'static str>,
    /// The answer.
    pub answer: ComparisonAnswer,
}

impl Judged {
    /// Whether the differences vary from condition to condition by more than their uncertainty: then no shift describes them.
    pub fn varies(&self) -> bool {
        self.scatter_p < EACH
    }
}

/// A comparison of two runs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RunComparison {
    /// References of the first and the second run.
    pub references: [Reference; 2],
    /// Conditions in common, in the order of the first run.
    pub pairs: Vec<Paired>,
    /// Passes with vibration of either run whose condition the other one lacks.
    pub unpaired: [usize; 2],
    /// The statistics; none without a condition in common.
    pub judged: Option<Judged>,
}

impl Side {
    /// The passes of a run.
    pub fn of(run: &RunData, noise: PassNoise) -> Self {
        let at_level = |p: &MeasuredPass| {
            let [ambient_pressure_pa, temperature_c, relative_humidity_pct] = p.air([true; 3]);
            Pass { ambient_pressure_pa, temperature_c, relative_humidity_pct, ..p.pass.clone() }
        };
        let passes = run.passes.iter().map(at_level).collect();
        Side { passes, sets: air_set(&run.passes), noise }
    }

    /// `mu_0` by least squares over the passes without vibration; an error says why there is none.
    pub fn reference(&self) -> Result<Reference, &'static str> {
        let none = "the run has no pass without vibration, and mu' is friction over that of such passes";
        let mu0 = coulomb_coefficient(&self.passes).ok_or(none)?;
        if mu0.is_nan() || mu0 <= 0.0 {
            return Err(REVERSED);
        }
        let still =
            self.passes.iter().filter(|p| p.amplitude == PeakToPeak::ZERO && p.lateral_force_n.is_some());
        let loads: Vec<f64> = still.map(|p| p.normal_force_n).collect();
        let squares: f64 = loads.iter().map(|n| n * n).sum();
        let of = |n: &f64| (n * n / squares).powi(2) * self.relative_variance(1.0, mu0, *n);
        let variance: f64 = loads.iter().map(of).sum();
        Ok(Reference { mu0, relative_sd: variance.sqrt() })
    }

    /// Variance of one pass's `mu'` from pass to pass, at `mu_relative`.
    fn relative_variance(&self, mu_relative: f64, mu0: f64, normal_force_n: f64) -> f64 {
        let force = self.noise.force_sd_n / (mu0 * normal_force_n);
        // The normal force is measured too; its error moves mu' by mu' times mu_0.
        force * force * (1.0 + (mu_relative * mu0).powi(2))
            + (self.noise.pass_relative_sd * mu_relative).powi(2)
    }

    fn mean(&self, passes: &[&Pass], reference: Reference) -> Mean {
        let n = passes.len() as f64;
        let mu = |p: &Pass| p.friction_force_n().unwrap_or(f64::NAN) / (reference.mu0 * p.normal_force_n);
        let mu_relative = passes.iter().map(|p| mu(p)).sum::<f64>() / n;
        let one = |p: &&Pass| self.relative_variance(mu_relative, reference.mu0, p.normal_force_n);
        Mean { mu_relative, sd: passes.iter().map(one).sum::<f64>().sqrt() / n, passes: passes.len() }
    }
}

/// Quantities of the air that the plan of any of these runs sets: their levels are part of a condition.
fn set_by(sides: &[&Side]) -> OfAir<bool> {
    std::array::from_fn(|at| sides.iter().any(|side| side.sets[at]))
}

/// The levels of a pass in these quantities.
fn air_of(p: &Pass, set: &OfAir<bool>) -> Ambient {
    let of = |at: usize, found: Option<f64>| found.filter(|_| set[at]);
    Ambient {
        ambient_pressure_pa: of(0, p.ambient_pressure_pa),
        temperature_c: of(1, p.temperature_c),
        relative_humidity_pct: of(2, p.relative_humidity_pct),
    }
}

fn same(a: &Pass, b: &Pass, set: &OfAir<bool>) -> bool {
    let settings = |p: &Pass| [p.amplitude.metres(), p.frequency_hz, p.speed_m_s, p.normal_force_n];
    let near = |((x, y), within): ((f64, f64), f64)| (x - y).abs() <= within * x.abs().max(y.abs());
    a.direction == b.direction
        && settings(a).into_iter().zip(settings(b)).zip(SAME).all(near)
        && one_air([a, b].map(|p| values(&air_of(p, set))))
}

/// The passes with vibration of some runs by their condition: its first pass, and the passes of each run.
fn by_condition<'a>(sides: &[&'a Side]) -> Vec<(&'a Pass, Vec<Vec<&'a Pass>>)> {
    let set = set_by(sides);
    let vibrating =
        |p: &&Pass| p.amplitude > PeakToPeak::ZERO && p.normal_force_n > 0.0 && p.lateral_force_n.is_some();
    let mut found: Vec<(&Pass, Vec<Vec<&Pass>>)> = Vec::new();
    for (i, side) in sides.iter().enumerate() {
        for pass in side.passes.iter().filter(vibrating) {
            let at = found.iter().position(|(first, _)| same(first, pass, &set)).unwrap_or_else(|| {
                found.push((pass, vec![Vec::new(); sides.len()]));
                found.len() - 1
            });
            found[at].1[i].push(pass);
        }
    }
    found
}

/// Pairs the passes of two runs and judges their differences, over the `mu_0` of each.
pub fn compare(sides: [&Side; 2], references: [Reference; 2]) -> RunComparison {
    let [a, b] = sides;
    let set = set_by(&sides);
    let (mut pairs, mut unpaired) = (Vec::new(), [0, 0]);
    for (first, of) in by_condition(&sides) {
        let (of_a, of_b) = (&of[0], &of[1]);
        if of_a.is_empty() || of_b.is_empty() {
            unpaired[0] += of_a.len();
            unpaired[1] += of_b.len();
            continue;
        }
        let means = [a.mean(of_a, references[0]), b.mean(of_b, references[1])];
        let shared = shared_variance(&references) * level(&means).powi(2);
        pairs.push(Paired {
            amplitude_pp_m: first.amplitude.metres(),
            frequency_hz: first.frequency_hz,
            speed_m_s: first.speed_m_s,
            direction: i8::from(first.direction),
            normal_force_n: first.normal_force_n,
            air: air_of(first, &set),
            a: means[0],
            b: means[1],
            difference: means[1].mu_relative - means[0].mu_relative,
            difference_sd: (means[0].sd.powi(2) + means[1].sd.powi(2) + shared).sqrt(),
        });
    }
    let judged = judge(&pairs, &references);
    RunComparison { references, pairs, unpaired, judged }
}

fn shared_variance(references: &[Reference; 2]) -> f64 {
    references.iter().map(|r| r.relative_sd.powi(2)).sum()
}

fn level(means: &[Mean; 2]) -> f64 {
    0.5 * (means[0].mu_relative + means[1].mu_relative)
}

/// Generalised least squares of a common shift under `diag(v) + shared m m'`, by the formula of Sherman and Morrison.
fn judge(pairs: &[Paired], references: &[Reference; 2]) -> Option<Judged> {
    let shared = shared_variance(references);
    let own: Vec<f64> = pairs.iter().map(|p| p.a.sd.powi(2) + p.b.sd.powi(2)).collect();
    if pairs.is_empty() || own.iter().any(|v| !(v.is_finite() && *v > 0.0)) {
        return None;
    }
    let m: Vec<f64> = pairs.iter().map(|p| level(&[p.a, p.b])).collect();
    let d: Vec<f64> = pairs.iter().map(|p| p.difference).collect();
    let plain = |x: &[f64], y: &[f64]| x.iter().zip(y).zip(&own).map(|((x, y), v)| x * y / v).sum::<f64>();
    let down = 1.0 + shared * plain(&m, &m);
    let product = |x: &[f64], y: &[f64]| plain(x, y) - shared * plain(x, &m) * plain(&m, y) / down;
    let ones = vec![1.0; pairs.len()];
    let information = product(&ones, &ones);
    let shift = product(&ones, &d) / information;
    let shift_sd = information.recip().sqrt();
    let normal = Normal::standard();
    let z95 = normal.inverse_cdf(0.975);
    let scatter_degrees = pairs.len() - 1;
    let scatter_chi2 = (product(&d, &d) - shift * shift * information).max(0.0);
    let scatter_p = match scatter_degrees {
        0 => 1.0,
        n => ChiSquared::new(n as f64).map_or(f64::NAN, |law| law.sf(scatter_chi2)),
    };
    let shift_p = 2.0 * normal.sf((shift / shift_sd).abs());
    // What is seen at such a level with a probability of 90 %, in standard deviations.
    let visible = |level: f64| normal.inverse_cdf(1.0 - level / 2.0) + normal.inverse_cdf(0.9);
    let visible_shift = visible(EACH) * shift_sd;
    let visible_mu0 = (visible(EACH) * shared.sqrt()).exp_m1();
    let mu0_p = 2.0 * normal.sf(((references[1].mu0 / references[0].mu0).ln() / shared.sqrt()).abs());
    // The greatest of so many by Bonferroni's bound, which holds whatever their correlation.
    let number = pairs.len() as f64;
    let most = |of: fn(&Paired) -> f64| pairs.iter().map(of).fold(0.0, f64::max);
    let furthest_p = (2.0 * number * normal.sf(most(|p| p.deviations().abs()))).min(1.0);
    let visible_at_one = visible(EACH / number) * most(|p| p.difference_sd);
    let tested = [("mu_0", mu0_p), ("mu_relative", shift_p.min(scatter_p).min(furthest_p))];
    let differ_in: Vec<&str> = tested.into_iter().filter(|(_, p)| *p < EACH).map(|(name, _)| name).collect();
    let answer = if !differ_in.is_empty() {
        ComparisonAnswer::Differ
    } else if pairs.len() >= ENOUGH_CONDITIONS && visible_shift.max(visible_mu0) <= VISIBLE_DEPARTURE {
        ComparisonAnswer::NoDifferenceSeen
    } else {
        ComparisonAnswer::CannotTell
    };
    Some(Judged {
        mu0_p,
        shift,
        shift_sd,
        shift_interval_95: [shift - z95 * shift_sd, shift + z95 * shift_sd],
        shift_p,
        scatter_chi2,
        scatter_degrees,
        scatter_p,
        furthest_p,
        visible_shift,
        visible_at_one,
        visible_mu0,
        differ_in,
        answer,
    })
}

#[cfg(test)]
mod tests;
