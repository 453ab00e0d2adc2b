//! The report of a verdict: everything the diagnosis says about one table, in the shape of docs/contract.md.
//! The answer itself, [`Verdict`], is in `verdict.rs`, with the rule that gives it.

pub mod amplitude_reading;
pub mod certificates;
pub mod describe;
pub mod document;
pub mod format;
pub mod intervals;
pub mod locate;
pub mod new_run;
pub mod next;
pub mod power;
pub mod predict;
pub mod pulls;
pub mod remarks;
mod run_shifts;
pub mod saved;
pub mod shrinkage;
pub mod timing;
pub mod unstated_covariates;
pub mod with_suspects;

use crate::base_law::LawNote;
use crate::data::{RigFile, Table};
use crate::hypotheses::{Fitted, Options, fit_all};
use crate::report::describe::{Description, at_least, description, not_named};
use crate::report::format::{plain, probability};
use crate::report::intervals::{Estimate, curvature, estimates};
use crate::report::locate::{GapRegion, ledger, regions};
use crate::report::new_run::widened;
use crate::report::next::{Experiment, experiments};
use crate::report::power::{SeenFrom, seen_from};
use crate::report::predict::{Forecast, Predictor, forecast, model};
use crate::report::pulls::{Pull, pulls};
use crate::report::remarks::{of_scatter, of_table};
use crate::report::run_shifts::shifted;
use crate::report::shrinkage::{HeldOutError, held_out_error};
use crate::report::timing::{RecordPart, TimingComparison};
use crate::report::unstated_covariates::{Unstated, unstated};
use crate::report::with_suspects::{WithSuspects, with_suspects};
use crate::scatter::{PureError, Scatter};
use crate::verdict::{Decision, Verdict, decide};
use effects::{Effect, Need, imitated};
use models::Condition;
use models::reading_evidence::ReadingFinding;
use serde::Serialize;
use std::collections::BTreeMap;

/// One hypothesis with its probability.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Hypothesis {
    /// Names; none for no gap, `unknown` for the open set.
    pub effects: Vec<String>,
    /// Probability given the table.
    pub probability: f64,
    /// What the table does not tell from it; pairs are joined by `+`.
    pub alias_class: Vec<String>,
    /// Law of each effect.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub laws: Vec<String>,
    /// Parameters with their intervals.
    pub parameters: Vec<Estimate>,
}

/// Where the gap lies.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Where {
    /// Probability by place.
    pub place: BTreeMap<&'static str, f64>,
    /// Parts of the operating space.
    pub regions: Vec<GapRegion>,
}

/// An effect that the table cannot show.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct NotTestable {
    /// Name.
    pub effect: String,
    /// What is missing.
    pub because: String,
}

/// What the leader did on regions that were left out of its fit.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct LeftOut {
    /// Share of the gap closed, pooled.
    pub pooled_closure: f64,
    /// Regions that carry gap.
    pub carrying: usize,
    /// Those of them closed by more than half.
    pub closed: usize,
    /// Closure of each region that carries gap, by name.
    pub regions: Vec<(String, Option<f64>)>,
}

/// Size and fingerprint of the table.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct DataNote {
    /// Number of passes.
    pub points: usize,
    /// SHA-256 of the file.
    pub sha256: String,
}

/// Schema `muprime.verdict/1`.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Report {
    /// `muprime.verdict/1`.
    pub schema: &'static str,
    /// The answer.
    pub verdict: Verdict,
    /// In one sentence.
    pub text: String,
    /// Hypotheses, most probable first; they sum to one.
    pub hypotheses: Vec<Hypothesis>,
    /// Where the gap lies.
    #[serde(rename = "where")]
    pub location: Where,
    /// How far it shrinks.
    pub gap: HeldOutError,
    /// The leader on left-out regions.
    pub left_out: LeftOut,
    /// What the replicates show about the stated repeatability.
    pub pure_error: PureError,
    /// What the table says about its own scatter: shifts of runs, suspect passes.
    pub scatter: Scatter,
    /// The verdict if suspect passes counted as any other; none where no pass is suspect.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub with_suspects: Option<WithSuspects>,
    /// How far the verdict's model had to pull the stiffnesses from their calibration; empty for `unknown`,
    /// which has no model that holds.
    pub stiffness_pulls: Vec<Pull>,
    /// What an unknown departure looks like, best first; empty otherwise.
    pub description: Vec<Description>,
    /// Causes that are sure under an open verdict.
    pub at_least: Vec<String>,
    /// Effects that the table cannot show.
    pub not_testable: Vec<NotTestable>,
    /// Under no gap: the size of each effect from which this table would have shown it, most visible first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub seen_from: Vec<SeenFrom>,
    /// What the passes say of the two readings of the paper's w; none without passes with and without vibration.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub psi_reading: Option<ReadingFinding>,
    /// What the edges in the run's record say of lags and shifts in time; none for a table without a record.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub record: Option<RecordPart>,
    /// What to measure next.
    pub next_experiment: Vec<Experiment>,
    /// The base law, where it is another than the spring-slider.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub law: Option<LawNote>,
    /// Effects of the user's own that were among the candidates.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub own_effects: Vec<OwnNote>,
    /// Remarks: what is missing from the table, what was assumed.
    pub remarks: Vec<String>,
    /// The table.
    pub data: DataNote,
}

/// An effect of the user's own.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct OwnNote {
    /// Its name.
    pub name: &'static str,
    /// SHA-256 of its file, hex.
    pub sha256: String,
}

impl OwnNote {
    fn of(effect: &'static Effect) -> OwnNote {
        let text = effect.own.map_or("", |own| &own.text);
        OwnNote { name: effect.name, sha256: calibration::certificate::sha256_hex(text.as_bytes()) }
    }
}

/// A diagnosis: the report, and what it takes to predict with it.
pub struct Diagnosis {
    /// The report.
    pub report: Report,
    /// Everything that was fitted.
    pub fitted: Fitted,
    /// What was decided.
    pub decision: Decision,
    table: Table,
    rig: RigFile,
}

/// Probability from which a pair is listed.
const LISTED: f64 = 1e-6;

/// Diagnoses a table.
pub fn diagnose(table: &Table, rig: &RigFile, options: &Options, sha256: String) -> Diagnosis {
    let mut fitted = fit_all(table, rig, options);
    options.progress.at("regions left out", 0.75);
    let decision = decide(&mut fitted);
    options.progress.at("passes held out", 0.85);
    let leader = decision.leader();
    let best = leader.map(|l| &fitted.candidates[l].best);
    let answer = Predictor::of(&fitted, decision.verdict, leader);
    let gap = held_out_error(&fitted, table, rig, &answer);
    let regions = match decision.verdict {
        Verdict::NoGap => Vec::new(),
        _ => regions(&fitted, rig, &model(&fitted, table, &answer, None)),
    };
    let location = Where { place: ledger(&fitted, &decision), regions };
    let leading = best.filter(|_| decision.verdict != Verdict::NoGap);
    let parameters = leading.map(|best| estimates(&fitted.problem, best.by_law(), &fitted.basis));
    let hypotheses = hypotheses(&fitted, &decision, parameters.as_ref());
    options.progress.at("the next experiment", 0.92);
    let next_experiment = experiments(&fitted, table, rig, &decision);
    options.progress.at("suspect passes", 0.96);
    let with_suspects = with_suspects(&fitted, table, rig, options);
    let mut remarks: Vec<String> = options.law.iter().map(|law| law.remark()).collect();
    let own: Vec<&str> = fitted.problem.own.iter().map(|e| effects::at(*e).name).collect();
    if !own.is_empty() {
        let own = own.join(", ");
        remarks.push(format!("Beside the library, causes of the user's own were candidates: {own}."));
    }
    remarks.extend(of_table(&fitted, table, &decision));
    remarks.extend(of_scatter(&fitted, &decision, with_suspects.as_ref()));
    let holds = match decision.verdict {
        Verdict::NoGap => Some(&fitted.baseline),
        Verdict::Named | Verdict::Ambiguous => best,
        Verdict::Unknown => None,
    };
    let pulls = |model| pulls(&fitted.problem, &fitted.baseline, model);
    let stiffness_pulls = holds.map_or_else(Vec::new, pulls);
    let seen_from = if decision.verdict == Verdict::NoGap { seen_from(&fitted) } else { Vec::new() };
    remarks.extend(gap.remark());
    remarks.extend(crate::report::power::remark(&seen_from));
    remarks.extend(stiffness_pulls.iter().filter_map(Pull::remark));
    let psi_reading = crate::report::amplitude_reading::of_table(table, rig, &fitted.scatter);
    remarks.extend(crate::report::amplitude_reading::remark(psi_reading.as_ref(), decision.verdict));
    let not_testable = |(effect, because): &(&'static str, String)| NotTestable {
        effect: effect.to_string(),
        because: because.clone(),
    };
    let report = Report {
        schema: "muprime.verdict/1",
        verdict: decision.verdict,
        text: sentence(&fitted, &decision, &gap, &answer),
        hypotheses,
        location,
        left_out: LeftOut {
            pooled_closure: decision.score.pooled,
            carrying: decision.score.carrying,
            closed: decision.score.closed,
            regions: decision
                .regions
                .iter()
                .map(|r| (r.name.clone(), r.errors.closed().filter(|_| r.judges)))
                .collect(),
        },
        gap,
        pure_error: fitted.pure,
        scatter: fitted.scatter.clone(),
        with_suspects,
        stiffness_pulls,
        description: description(&fitted, &decision),
        at_least: at_least(&fitted, &decision),
        not_testable: fitted.not_testable.iter().map(not_testable).collect(),
        seen_from,
        psi_reading,
        record: None,
        next_experiment,
        law: options.law.as_ref().map(|law| law.note()),
        own_effects: options.own.iter().map(|e| OwnNote::of(effects::at(*e))).collect(),
        remarks,
        data: DataNote { points: table.len(), sha256 },
    };
    Diagnosis { report, fitted, decision, table: table.clone(), rig: rig.clone() }
}

fn label(fitted: &Fitted, candidate: usize) -> String {
    fitted.candidates[candidate].names().join("+")
}

fn sentence(fitted: &Fitted, decision: &Decision, gap: &HeldOutError, answer: &Predictor) -> String {
    let closed = |with: &str| {
        let Some((verb, percent, interval)) = gap.change() else {
            return match gap.before_rmse {
                Some(_) => "passes that were not fitted show no gap".to_string(),
                None => "the table is too short to keep passes out of the fit".to_string(),
            };
        };
        // A share without its interval claims more than the passes can show.
        let within =
            interval.map_or_else(String::new, |[low, high]| format!(" (95 %: {low:.0} to {high:.0})"));
        format!("with {with} the gap {verb} by {percent:.0} %{within} on passes that were not fitted")
    };
    let leader = decision.leader().unwrap_or_default();
    let words = |candidate: usize| plain(&label(fitted, candidate));
    match decision.verdict {
        Verdict::NoGap if decision.no_gap < 0.5 => format!(
            "No gap is shown: the recalibrated model may explain the table (probability {}).",
            probability(decision.no_gap)
        ),
        Verdict::NoGap => "No gap: the recalibrated model explains the table.".to_string(),
        Verdict::Named => format!(
            "Most likely cause: {} (probability {}); {}.",
            words(leader),
            probability(decision.probabilities[leader]),
            closed("it")
        ),
        Verdict::Ambiguous if decision.class.len() == 1 => {
            let (name, closed) = (words(leader), closed(&answer.to_string()));
            if let Some(cause) = imitated(&fitted.candidates[leader].names()) {
                format!(
                    "{name} together, or {}, which is not in the library: this table cannot separate them; {closed}.",
                    cause.words.unwrap_or(cause.name)
                )
            } else {
                let p = decision.probabilities[leader];
                let why = if p < fitted.problem.constants.name_probability {
                    format!("its probability of {} is too low to name it", probability(p))
                } else if decision.misfit.is_some() {
                    "it leaves a misfit and is not named".to_string()
                } else {
                    "it closes too little of the gap in left-out regions to be named".to_string()
                };
                format!("Most likely cause: {name}, but {why}; {closed}.")
            }
        }
        Verdict::Ambiguous => {
            let names: Vec<String> = decision.class.iter().take(6).map(|&i| words(i)).collect();
            format!("This table cannot separate {}; {}.", names.join(", "), closed(&answer.to_string()))
        }
        Verdict::Unknown => {
            let known = fitted.unlisted.first().filter(|s| {
                let leading = fitted.candidates.get(leader).map_or(f64::NEG_INFINITY, |c| c.log_evidence);
                s.log_evidence > fitted.discrepancy.log_evidence.max(leading)
            });
            let seen = description(fitted, decision);
            let hint = match (known, seen.first()) {
                (Some(s), _) => {
                    let names = plain(&s.names().join("+"));
                    format!(" The nearest known effect is not in the library: {names}.")
                }
                (None, Some(d)) if d.leads() => format!(" It looks like {}.", d.text),
                // The best cause is likelier than any structure: the sentence names no structure then.
                (None, Some(_)) => not_named(fitted, decision).map_or_else(String::new, |s| format!(" {s}")),
                (None, None) => String::new(),
            };
            format!(
                "There is a gap, and no effect of the library explains most of it; {}.{hint}",
                closed(&answer.to_string())
            )
        }
    }
}

fn hypotheses(
    fitted: &Fitted,
    decision: &Decision,
    parameters: Option<&Vec<Vec<Estimate>>>,
) -> Vec<Hypothesis> {
    let mut list: Vec<Hypothesis> = fitted
        .candidates
        .iter()
        .enumerate()
        .filter(|(i, c)| decision.probabilities[*i] > LISTED || c.effects.len() == 1)
        .map(|(i, c)| {
            let class = decision.class.iter().filter(|_| decision.class.contains(&i));
            let others = class.filter(|&&k| k != i).map(|&k| label(fitted, k));
            let parameters = match parameters.filter(|_| Some(i) == decision.leader()) {
                Some(profiled) => profiled.concat(),
                None => curvature(&fitted.problem, c.best.by_law()),
            };
            Hypothesis {
                effects: c.names().iter().map(|n| (*n).to_string()).collect(),
                probability: decision.probabilities[i],
                alias_class: std::iter::once(label(fitted, i)).chain(others).collect(),
                laws: c.best.members.iter().map(|m| m.form().name.to_string()).collect(),
                parameters,
            }
        })
        .collect();
    let names = |pair: &[usize]| pair.iter().map(|&e| effects::at(e).name.to_string()).collect();
    let unweighed = fitted.unweighed.iter().zip(&decision.unweighed).filter(|(_, p)| **p > LISTED);
    let others = [(Vec::new(), decision.no_gap), (vec!["unknown".to_string()], decision.open_set)];
    let others = others.into_iter().chain(unweighed.map(|(pair, p)| (names(pair), *p)));
    for (effects, probability) in others {
        list.push(Hypothesis {
            alias_class: (!effects.is_empty()).then(|| effects.join("+")).into_iter().collect(),
            effects,
            probability,
            laws: Vec::new(),
            parameters: Vec::new(),
        });
    }
    let total: f64 = list.iter().map(|h| h.probability).sum();
    list.iter_mut().for_each(|h| h.probability /= total);
    list.sort_by(|a, b| b.probability.total_cmp(&a.probability).then(a.effects.cmp(&b.effects)));
    list
}

impl Diagnosis {
    /// Adds what the run's record says: its own part of the verdict, beside the passes. What it judges is
    /// no longer untestable, and for the rest it says why.
    pub fn add_record(&mut self, part: RecordPart) {
        let judged = part.is_judged();
        let because = part.comparisons.iter().filter_map(|c| c.because.clone()).next().unwrap_or_default();
        let timed =
            |n: &NotTestable| effects::by_name(&n.effect).is_some_and(|e| e.needs.contains(&Need::Record));
        self.report.not_testable.retain(|n| !(judged && timed(n)));
        for n in self.report.not_testable.iter_mut().filter(|n| timed(n)) {
            n.because = format!("means over passes do not show it, and {because}");
        }
        // The first sentences are of the passes alone, and may say 'no gap' beside it.
        let late = part.comparisons.iter().filter(|c| !c.causes.is_empty());
        let odds = |c: &&TimingComparison| c.log10_odds_vs_none.unwrap_or_default();
        if let Some(late) = late.max_by(|a, b| odds(a).total_cmp(&odds(b))) {
            let causes = late.causes.join(" or ").replace('_', " ");
            let late_ms = 1e3 * late.late_s.unwrap_or_default();
            let text = &mut self.report.text;
            *text += &format!(" The run's record shows {causes}: the lateral force is {late_ms:.1} ms late.");
        }
        self.report.record = Some(part);
    }

    /// By which hypotheses the verdict predicts.
    pub fn answer(&self) -> Predictor {
        Predictor::of(&self.fitted, self.decision.verdict, self.decision.leader())
    }

    /// What the verdict's model says of conditions that lie within the table: a curve for a figure. Unlike
    /// [`Self::predict`] it does not ask in which run they are.
    pub fn curve(&self, passes: &[Condition]) -> Vec<Forecast> {
        let whole = model(&self.fitted, &self.table, &self.answer(), None);
        forecast(&self.fitted, &self.rig, &whole, passes)
    }

    /// What one hypothesis says of conditions, by the names of its effects: its law is [`Forecast::form`].
    /// `None` for no gap, for the open set, and for what was not fitted.
    pub fn hypothesis_curve(&self, effects: &[String], passes: &[Condition]) -> Option<Vec<Forecast>> {
        let candidate = self.fitted.candidates.iter().position(|c| c.names() == effects)?;
        let whole = model(&self.fitted, &self.table, &Predictor::cause(candidate), None);
        Some(forecast(&self.fitted, &self.rig, &whole, passes))
    }

    /// Predicts conditions with the verdict's model; those in runs that the table does not have, or after its
    /// end, with the deviations that such passes of the table needed.
    ///
    /// # Errors
    /// A condition that lacks a column by which that model predicts.
    pub fn predict(&self, conditions: &Table) -> Result<Vec<Forecast>, Unstated> {
        let answer = self.answer();
        if let Some(why) = unstated(&self.fitted, &answer, conditions) {
            return Err(why);
        }
        let whole = model(&self.fitted, &self.table, &answer, None);
        let mut plain = forecast(&self.fitted, &self.rig, &whole, &conditions.passes);
        let own = forecast(&self.fitted, &self.rig, &whole, &self.table.passes);
        shifted(&self.fitted, &self.table, &own, conditions, &mut plain);
        Ok(widened(&self.fitted, &self.table, &self.rig, &answer, conditions, plain))
    }
}
