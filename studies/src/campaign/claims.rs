//! What the paper states, each answered from a campaign.
//!
//! The rule is one for all: the 95 % interval of the change of mu' lies beyond the margin (it falls, it
//! rises), within the margin (it does not matter), or across it (undecided). A statement is supported or
//! contradicted by that, never by a difference that is merely not significant.

use super::measured::{Driven, Measured, MeasuredChange, contrast, mean};
use models::Surrogate;
use models::covariate::{self, Covariate};
use models::prediction::{EmpiricalPsi, FrictionModel, SpringSlider, Validity};
use runs::fingertip::FingertipKind;
use runs::format::number;
use runs::report::plots::ends;
use serde::Serialize;
use std::collections::BTreeMap;

/// What a statement expects of a change, or what was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Trend {
    /// Relative friction falls by more than the margin.
    Falls,
    /// It rises by more than the margin.
    Rises,
    /// It changes by less than the margin.
    Same,
}

/// What the campaign says of a statement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ClaimAnswer {
    /// The interval lies where the statement says.
    Supported,
    /// It lies elsewhere.
    Contradicted,
    /// It lies across the margin, or nothing tells.
    Undecided,
}

/// A statement of the paper with its answer.
#[derive(Clone, Debug, Serialize)]
pub struct Claim {
    /// Short name.
    pub name: &'static str,
    /// The statement, in words of ours.
    pub statement: &'static str,
    /// Where the paper makes it.
    pub source: &'static str,
    /// What it expects.
    pub expected: Trend,
    /// The change of mu', with its interval; `None` where nothing varies what it is about.
    pub effect: Option<MeasuredChange>,
    /// What the change is of, in words.
    pub of: String,
    /// Change of mu' that does not matter.
    pub margin: f64,
    /// The answer.
    pub answer: ClaimAnswer,
    /// Least change that would have been decided: the margin and half of the interval. `None` without an
    /// effect.
    pub visible: Option<f64>,
}

/// Where an interval lies beside a margin.
pub fn trend([low, high]: [f64; 2], margin: f64) -> Option<Trend> {
    if high < -margin {
        return Some(Trend::Falls);
    }
    if low > margin { Some(Trend::Rises) } else { (low > -margin && high < margin).then_some(Trend::Same) }
}

impl Claim {
    /// The answer in a word, and whether there is a change that the margin covers.
    pub fn words(&self) -> String {
        let word = match self.answer {
            ClaimAnswer::Supported => "supported",
            ClaimAnswer::Contradicted => "contradicted",
            ClaimAnswer::Undecided => "undecided",
        };
        let covered = |e: MeasuredChange| {
            self.answer != ClaimAnswer::Undecided
                && e.ci95[0] * e.ci95[1] > 0.0
                && e.change.abs() < self.margin
        };
        let more = if self.effect.is_some_and(covered) { ", with a change within the margin" } else { "" };
        format!("{word}{more}")
    }
}

const RESULT: &str = "part 1, section 6 (ii)";
const FORCE: &str = "part 1, section 6 (iv)";
const PART2: &str = "part 1, section 1, of part 2";

/// Every statement with its answer, in the order of the page.
pub fn claims(sessions: &[Measured], margin: f64) -> Vec<Claim> {
    use Trend::{Falls, Rises, Same};
    let within = |factor: &Covariate, intermittent: bool| within(sessions, factor, intermittent);
    let modulus = |s: &Measured| s.finger.young_modulus_pa;
    let ridge = Surrogate::shipped().ok();
    let ridge = |s: &Measured| Some(ridge.clone()?.for_finger(&s.finger));
    let tip = "friction does not depend on the tip's modulus";
    let air = "friction does not depend on the ambient pressure";
    let coulomb = "friction falls with the Coulomb friction coefficient";
    let intermittent = "friction does not depend on the normal force once contact is intermittent";
    let one_law = "human and artificial tips follow the same law";
    let near_slider = "measurements are consistent with the spring-slider";
    let near_ridge = "measurements are consistent with the finite element ridge";
    let slider = |s: &Measured| SpringSlider::new(s.finger).ok();
    [
        ("amplitude", "friction falls with amplitude", RESULT, Falls, within(&covariate::AMPLITUDE, false)),
        ("frequency", "friction falls with frequency", RESULT, Falls, within(&covariate::FREQUENCY, false)),
        ("speed", "friction rises with sliding speed", RESULT, Rises, within(&covariate::SPEED, false)),
        ("mu_0", coulomb, RESULT, Falls, across(sessions, "mu_0", |s| s.mu0, modulus)),
        ("normal force", intermittent, FORCE, Same, within(&covariate::NORMAL_FORCE, true)),
        ("modulus", tip, FORCE, Same, across(sessions, "Young's modulus", modulus, |s| s.mu0)),
        ("ambient pressure", air, PART2, Same, within(&covariate::AMBIENT_PRESSURE, false)),
        ("spring-slider", near_slider, PART2, Same, beside(sessions, "the spring-slider", slider)),
        ("ridge", near_ridge, PART2, Same, beside(sessions, "the ridge", ridge)),
        ("human and artificial", one_law, PART2, Same, kinds(sessions)),
    ]
    .into_iter()
    .map(|(name, statement, source, expected, found)| {
        let (effect, of) = match found {
            _ if sessions.is_empty() => (None, "no session is complete".to_string()),
            Ok((effect, of)) => (Some(effect), of),
            Err(why) => (None, why),
        };
        let answer = match effect.and_then(|e| trend(e.ci95, margin)) {
            None => ClaimAnswer::Undecided,
            Some(found) if found == expected => ClaimAnswer::Supported,
            Some(_) => ClaimAnswer::Contradicted,
        };
        let visible = effect.map(|e| margin + 0.5 * (e.ci95[1] - e.ci95[0]));
        Claim { name, statement, source, expected, effect, of, margin, answer, visible }
    })
    .collect()
}

/// The effect of a factor that is varied within sessions.
fn within(
    sessions: &[Measured],
    factor: &Covariate,
    intermittent: bool,
) -> Result<(MeasuredChange, String), String> {
    let of_session = |s: &Measured| {
        let driven: Vec<_> = s.driven.iter().filter(|d| d.intermittent || !intermittent).copied().collect();
        contrast(factor, &driven)
    };
    let found: Vec<(f64, [f64; 2])> = sessions.iter().filter_map(of_session).collect();
    if found.is_empty() {
        return Err(format!("no complete session varies the {}", factor.words));
    }
    let changes: Vec<f64> = found.iter().map(|(change, _)| *change).collect();
    let effect = MeasuredChange::mean_of(&changes, 0.0).ok_or_else(|| ONE.to_string())?;
    let (scale, unit) = factor.shown;
    let end = |i: usize| number(scale * mean(found.iter().map(|(_, e)| e[i])).unwrap_or(f64::NAN));
    Ok((effect, format!("{} {} to {} {unit}", factor.words, end(0), end(1))))
}

const ONE: &str = "one session alone does not tell how sessions differ";

/// The effect of what differs between cells, over its range; what else differs is held.
fn across(
    sessions: &[Measured],
    words: &str,
    x: impl Fn(&Measured) -> Option<f64>,
    other: impl Fn(&Measured) -> Option<f64>,
) -> Result<(MeasuredChange, String), String> {
    let row = |s: &Measured| Some([s.mean_mu()?, x(s)?.ln(), other(s).map_or(f64::NAN, f64::ln)]);
    let (rows, least) = by_cell(sessions, row);
    let column = |i: usize| rows.iter().map(|row| row[i]).collect::<Vec<f64>>();
    let (y, x, other) = (column(0), column(1), column(2));
    let [low, high] = ends(&x);
    let factor = (high - low).exp();
    if factor.is_nan() || factor < LEAST_FACTOR {
        return Err(format!("the tips' {words} differs by less than a factor of {LEAST_FACTOR}"));
    }
    let varies = ends(&other);
    let other = (varies[1] - varies[0] > LEAST_FACTOR.ln()).then_some(other.as_slice());
    let effect = MeasuredChange::slope(&x, &y, other, least)
        .ok_or_else(|| format!("too few cells, or {words} changes with something else"))?;
    Ok((effect, format!("{words} over a factor of {}", number(factor))))
}

/// Least factor by which something must differ between cells.
const LEAST_FACTOR: f64 = 1.2;

/// How far measurements lie from a model, in the mean of a session.
fn beside<M: FrictionModel>(
    sessions: &[Measured],
    words: &str,
    model: impl Fn(&Measured) -> Option<M>,
) -> Result<(MeasuredChange, String), String> {
    let mut shared = 0.0f64;
    let mut of_session = |s: &Measured| {
        let model = model(s)?;
        let predicted = s.driven.iter().filter_map(|d| Some((d.mu, model.predict(&d.condition).ok()?)));
        let inside: Vec<_> = predicted.filter(|(_, p)| p.validity == Validity::Inside).collect();
        shared = shared.max(mean(inside.iter().map(|(_, p)| p.mu_relative_sd))?);
        (2 * inside.len() > s.driven.len()).then_some(())?;
        mean(inside.iter().map(|(mu, p)| mu - p.mu_relative))
    };
    let departures: Vec<f64> = sessions.iter().filter_map(&mut of_session).collect();
    if departures.is_empty() {
        return Err(format!("most passes lie beyond the range of {words}"));
    }
    let effect = MeasuredChange::mean_of(&departures, shared).ok_or_else(|| ONE.to_string())?;
    Ok((effect, format!("measured less predicted by {words}")))
}

/// The mean of a cell's sessions, for each cell: days of one tip do not tell how tips differ. And the
/// variance of such a mean of the first value by the scatter of sessions: few cells may lie closer by chance.
fn by_cell<const N: usize>(
    sessions: &[Measured],
    of: impl Fn(&Measured) -> Option<[f64; N]>,
) -> (Vec<[f64; N]>, f64) {
    let mut cells = BTreeMap::<usize, Vec<[f64; N]>>::new();
    for (cell, row) in sessions.iter().filter_map(|s| Some((s.session.cell, of(s)?))) {
        cells.entry(cell).or_default().push(row);
    }
    let mean =
        |rows: &Vec<[f64; N]>| std::array::from_fn(|i| mean(rows.iter().map(|r| r[i])).unwrap_or(f64::NAN));
    let means: Vec<[f64; N]> = cells.values().map(mean).collect();
    let squares = |(rows, mean): (&Vec<[f64; N]>, &[f64; N])| -> f64 {
        rows.iter().map(|row| (row[0] - mean[0]).powi(2)).sum()
    };
    let squares: f64 = cells.values().zip(&means).map(squares).sum();
    let (all, cells) = (cells.values().map(Vec::len).sum::<usize>() as f64, means.len() as f64);
    (means, if all > cells { squares / (all - cells) * cells / all } else { 0.0 })
}

/// How far human and artificial tips lie apart beside one law.
fn kinds(sessions: &[Measured]) -> Result<(MeasuredChange, String), String> {
    let of = |human: bool| {
        let departure = |s: &Measured| {
            let own = s.kind != FingertipKind::Probe && (s.kind == FingertipKind::Human) == human;
            let law = EmpiricalPsi::paper(s.finger).ok().filter(|_| own)?;
            let beside = |d: &Driven| Some(d.mu - law.relative_friction(&d.condition).ok()?.mu_relative);
            Some([mean(s.driven.iter().filter_map(beside))?])
        };
        by_cell(sessions, departure)
    };
    let effect = MeasuredChange::between(of(true), of(false))
        .ok_or_else(|| "two cells or more of each kind of tip are needed".to_string())?;
    Ok((effect, "human less artificial, beside Eq. 20".to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Before, the words were that most passes lay beyond the range of the spring-slider.
    #[test]
    fn without_a_complete_session_every_statement_says_so() {
        let all = claims(&[], 0.02);
        assert!(all.iter().all(|claim| claim.of == "no session is complete"), "{all:?}");
    }
}
