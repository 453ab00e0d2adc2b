//! What an unknown departure looks like: a jump, bump, period, resonance, rough function, memory or trend,
//! with its place, size and odds; and which causes are sure though others act beside them.
//! docs/diagnosis/model.md, section 10.

use crate::hypotheses::Fitted;
use crate::hypotheses::structure::shapes::{Shape, ShapeKind};
use crate::report::format::{plain, three_digits};
use crate::verdict::{Decision, Verdict};
use serde::Serialize;
use std::f64::consts::LN_10;

/// Most structures that are described, and the least odds (base 10) against no gap of each.
const MOST: usize = 3;
const LEAST_ODDS: f64 = 1.0;

/// One structure in a departure that no cause of the library makes.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Description {
    /// What it is.
    pub structure: ShapeKind,
    /// The covariate over which it is.
    pub covariate: &'static str,
    /// Place of a jump, bump or resonance, length of a period or within which a rough function changes, in
    /// the covariate's unit. Of a trend where half of it is made up. Of a memory the mean from which it
    /// counts, or its reach over the position.
    pub at: f64,
    /// Its 95 % interval.
    pub at_ci95: [f64; 2],
    /// Size in units of full friction.
    pub size: f64,
    /// Its 95 % interval.
    pub size_ci95: [f64; 2],
    /// Unit of the size.
    pub unit: &'static str,
    /// Odds against the best cause of the library, base 10; none where no cause could be tried.
    pub log10_odds_vs_best_cause: Option<f64>,
    /// Odds against no gap, base 10.
    pub log10_odds_vs_no_gap: f64,
    /// In words.
    pub text: String,
}

impl Description {
    /// Whether no cause of the library is likelier than this structure.
    pub fn leads(&self) -> bool {
        self.log10_odds_vs_best_cause.is_none_or(|odds| odds >= 0.0)
    }
}

fn words(shape: &Shape) -> String {
    let (factor, unit) = shape.covariate.shown;
    let value = |v: f64| three_digits(v * factor);
    let [low, high] = shape.at.1.map(value);
    let (at, over) = (value(shape.at.0), shape.covariate.words);
    let interval = format!("(95 %: {low} to {high})");
    let place = match shape.kind {
        ShapeKind::Jump => format!("a jump over {over} at {at} {unit} {interval}"),
        ShapeKind::Bump => format!("a bump over {over} about {at} {unit} {interval}"),
        ShapeKind::Period => format!("a period of {at} {unit} over {over} {interval}"),
        ShapeKind::Resonance => format!("a resonance over {over} at {at} {unit} {interval}"),
        ShapeKind::Rough => {
            format!("a rough function of {over}, which changes within {at} {unit} {interval},")
        }
        ShapeKind::Trend => format!("a trend over {over}, half of it by {at} {unit} {interval},"),
        ShapeKind::Memory => format!("a memory of the {over} of the pass before"),
    };
    let of = if shape.turns { "friction" } else { "the lateral reading, alike in both directions" };
    let size = match shape.kind {
        ShapeKind::Rough => format!("{:.3} of full friction (root mean square)", shape.size.0),
        _ => format!("{:+.3} of full friction", shape.size.0),
    };
    format!("{place} in {of}, {size}")
}

/// The structures of an unknown departure, best first; none under another verdict.
pub fn description(fitted: &Fitted, decision: &Decision) -> Vec<Description> {
    if decision.verdict != Verdict::Unknown {
        return Vec::new();
    }
    let base10 = fitted.problem.constants.temper * LN_10;
    let best = fitted.candidates.iter().map(|c| c.log_evidence - fitted.no_gap_evidence).reduce(f64::max);
    let of = |shape: &Shape| Description {
        structure: shape.kind,
        covariate: shape.covariate.name,
        at: shape.at.0,
        at_ci95: shape.at.1,
        size: shape.size.0,
        size_ci95: shape.size.1,
        unit: "mu_relative",
        log10_odds_vs_best_cause: best.map(|best| (shape.nats - best) / base10),
        log10_odds_vs_no_gap: shape.nats / base10,
        text: words(shape),
    };
    // One that acts on friction in several ways is one structure: the best of them is described.
    let mut seen: Vec<Description> = Vec::new();
    let clear = |shape: &&Shape| shape.stands_out / base10 > LEAST_ODDS;
    for described in fitted.shapes.iter().filter(clear).map(of) {
        let again =
            |d: &Description| (d.structure, d.covariate) == (described.structure, described.covariate);
        if seen.len() < MOST && !seen.iter().any(again) {
            seen.push(described);
        }
    }
    seen
}

/// The likeliest cause under `unknown`, and why it is not named; none where no effect could be tried.
pub fn not_named(fitted: &Fitted, decision: &Decision) -> Option<String> {
    let leader = &fitted.candidates[decision.leader()?];
    let (score, k) = (&decision.score, &fitted.problem.constants);
    let why = if fitted.open_set_probability > leader.probability {
        "a smooth departure without a known cause fits the table better".to_string()
    } else if score.survival(k, leader.effects.len(), fitted.lead(leader)) < 0.5 {
        let percent = 100.0 * score.pooled.max(0.0);
        format!("in regions that its fit leaves out, it closes only {percent:.0} % of the gap")
    } else if leader.best.plain.is_some() {
        "its law, without a free function beside it, explains too little of the gap".to_string()
    } else {
        "a departure without a known cause is as likely".to_string()
    };
    Some(format!("The likeliest cause is {}. It is not named: {why}.", plain(&leader.names().join("+"))))
}

/// Causes that are sure though the verdict is open: those of which the hypotheses together have the
/// probability of a name, and that no hypothesis lacks which the table does not tell from the leader. None of
/// a pair that leaves a misfit: of such pairs on labelled sets one member at most was true.
pub fn at_least(fitted: &Fitted, decision: &Decision) -> Vec<String> {
    let undecided = matches!(decision.verdict, Verdict::Ambiguous | Verdict::Unknown);
    if !undecided || decision.misfit.is_some() {
        return Vec::new();
    }
    let of = |effect: usize| -> f64 {
        decision.stated(fitted).filter(|(members, _)| members.contains(&effect)).map(|(_, p)| p).sum()
    };
    let name = fitted.problem.constants.name_probability;
    let open = decision.verdict == Verdict::Ambiguous;
    let lacked = |effect: usize| {
        open && decision.class.iter().any(|&i| !fitted.candidates[i].effects.contains(&effect))
    };
    let tried: std::collections::BTreeSet<usize> =
        fitted.candidates.iter().flat_map(|c| c.effects.iter().copied()).collect();
    let sure = |e: &usize| of(*e) >= name && !lacked(*e);
    tried.into_iter().filter(sure).map(|e| effects::at(e).name.to_string()).collect()
}
