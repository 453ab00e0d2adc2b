//! The verdict if suspect passes counted as any other: the table is fitted again, without their discount.

use crate::data::{RigFile, Table};
use crate::hypotheses::{Fitted, Options, fit_believing};
use crate::progress::Progress;
use crate::scatter::Belief;
use crate::verdict::{Decision, Verdict, decide};
use serde::Serialize;

/// The verdict on a table whose suspect passes count as any other.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct WithSuspects {
    /// The answer.
    pub verdict: Verdict,
    /// The leading effects; none for no gap, `unknown` for the open set.
    pub effects: Vec<String>,
    /// Their probability.
    pub probability: f64,
}

impl WithSuspects {
    pub(crate) fn words(&self) -> String {
        let name = match self.verdict {
            Verdict::NoGap => return "no gap".to_string(),
            Verdict::Unknown => return "unknown".to_string(),
            Verdict::Named => "named",
            Verdict::Ambiguous => "ambiguous",
        };
        format!("{name} {}", self.effects.join("+"))
    }
}

/// The leading effects of a decision and their probability.
pub(crate) fn leading(fitted: &Fitted, decision: &Decision) -> (Vec<String>, f64) {
    match (decision.verdict, decision.leader()) {
        (Verdict::NoGap, _) => (Vec::new(), decision.no_gap),
        (Verdict::Named | Verdict::Ambiguous, Some(leader)) => {
            let names = fitted.candidates[leader].names().iter().map(|n| (*n).to_string()).collect();
            (names, decision.probabilities[leader])
        }
        _ => (vec!["unknown".to_string()], decision.open_set),
    }
}

/// The verdict if suspect passes counted as any other; none where no pass is suspect.
pub fn with_suspects(
    fitted: &Fitted,
    table: &Table,
    rig: &RigFile,
    options: &Options,
) -> Option<WithSuspects> {
    if fitted.scatter.suspects.is_empty() {
        return None;
    }
    // It is a second opinion: what leads in it is not what leads.
    let silent = Options { progress: Progress::default(), ..options.clone() };
    let mut fitted = fit_believing(table, rig, &silent, &Belief::All);
    let decision = decide(&mut fitted);
    let (effects, probability) = leading(&fitted, &decision);
    Some(WithSuspects { verdict: decision.verdict, effects, probability })
}
