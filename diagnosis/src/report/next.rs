//! The next experiment: what best separates the leading hypotheses. docs/diagnosis/model.md, section 10.
//!
//! | module | purpose |
//! |---|---|
//! | [`grid`] | conditions that a plan can choose, within what the table has shown |
//! | [`predictive`] | what each hypothesis expects there, with how surely it knows it |
//! | [`design`] | which of them, in which order |

pub mod design;
pub mod grid;
pub mod predictive;

use crate::constants::Constants;
use crate::data::{RigFile, Table};
use crate::hypotheses::Fitted;
use crate::report::format::plain;
use crate::verdict::{Decision, Verdict};
use models::{Condition, SpringSlider, covariate};
use predictive::predictives;
use serde::{Serialize, Serializer};
use std::collections::BTreeMap;

/// A next experiment.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Experiment {
    /// Conditions to run, those that tell most first; empty for an action on an instrument.
    #[serde(serialize_with = "settings")]
    #[schemars(with = "Vec<BTreeMap<String, f64>>")]
    pub conditions: Vec<Condition>,
    /// The two hypotheses that it parts: the leader and its strongest rival.
    pub separates: [String; 2],
    /// Expected gain of the first one's log evidence over the second's, were the first one true. A verdict
    /// counts less of it: `expected_odds`.
    pub expected_nats: f64,
    /// Factor by which these passes would raise the odds of the first over the second in a verdict, were the
    /// first one true. A verdict counts half the nats; at most 100, as often as the method may err unseen. None
    /// against an unknown cause, which may be anything.
    pub expected_odds: Option<f64>,
    /// In words.
    pub text: String,
}

/// Conditions by what a plan can set of them, under the names of the point table.
fn settings<S: Serializer>(conditions: &[Condition], serializer: S) -> Result<S::Ok, S::Error> {
    let of = |c: &Condition| -> BTreeMap<&str, f64> {
        covariate::planned().filter_map(|k| k.of(c).map(|v| (k.name, v))).collect()
    };
    serializer.collect_seq(conditions.iter().map(of))
}

/// The name of the open set among hypotheses.
const UNKNOWN: &str = "unknown";
/// Passes of a designed experiment.
pub const PASSES: usize = 12;
/// Least change of force that a proposal is made for, in deviations of a pass (`force_sd_n`). A run refuses
/// a series below one; twice that, since the setup's mu_0 may differ from the table's.
const SEEN: f64 = 2.0;

impl Experiment {
    fn of(conditions: Vec<Condition>, between: [String; 2], nats: f64, text: String, k: &Constants) -> Self {
        let known = between.iter().all(|name| name != UNKNOWN);
        let expected_odds = known.then(|| (nats / k.temper).exp().min(1.0 / k.doubt));
        Experiment { conditions, separates: between, expected_nats: nats, expected_odds, text }
    }

    /// What is expected of it, a sentence.
    pub fn worth(&self) -> String {
        let [leader, rival] = self.separates.each_ref().map(|name| words(name));
        let odds = match self.expected_odds {
            // The limit of `Experiment::of`.
            Some(odds) if odds > 99.0 => "odds above 100 to 1".to_string(),
            Some(odds) => format!("odds of {odds:.*} to 1", usize::from(odds < 10.0)),
            None => return format!("No odds are stated against {rival}, which may be anything."),
        };
        format!("If {leader} is true, {odds} against {rival} are expected.")
    }
}

/// Designs experiments for what a decision left open.
pub fn experiments(fitted: &Fitted, table: &Table, rig: &RigFile, decision: &Decision) -> Vec<Experiment> {
    let k = &fitted.problem.constants;
    if decision.verdict == Verdict::NoGap && decision.no_gap >= k.settled_probability {
        return Vec::new();
    }
    let mut list: Vec<Experiment> = designed(fitted, table, rig, decision).into_iter().collect();
    if decision.verdict != Verdict::NoGap {
        list.extend(actions(fitted, decision));
    }
    list.sort_by(|x, y| y.expected_nats.total_cmp(&x.expected_nats));
    list
}

/// A hypothesis of [`Experiment::separates`] as a sentence has it.
pub fn words(name: &str) -> String {
    if name == UNKNOWN { "an unknown cause".to_string() } else { plain(name) }
}

/// The passes that best part the hypotheses, among conditions whose change of force a run on this rig
/// accepts.
fn designed(fitted: &Fitted, table: &Table, rig: &RigFile, decision: &Decision) -> Option<Experiment> {
    let k = &fitted.problem.constants;
    let mut grid = grid::conditions(table);
    grid.retain(|c| fitted.problem.tells(c));
    let (all, least_n) = (grid.len(), SEEN * rig.noise.force_sd_n);
    if let Ok(slider) = SpringSlider::new(rig.finger) {
        let change = |c: &Condition| grid::expected_change_n(c, &slider, fitted.problem.nominal.mu0);
        grid.retain(|c| change(c).is_none_or(|n| n >= least_n));
    }
    if grid.is_empty() {
        return None;
    }
    let hypotheses = predictives(fitted, rig, decision, &grid);
    // Where the evidence is for an effect and the left-out regions are against it, passes that part hypotheses come back to
    // a few conditions and leave the regions as empty as they are. Every second one then goes where nothing is known.
    let empty = decision.open_set > 0.5 && fitted.open_set_probability < 0.5;
    let open = hypotheses.len() - 1;
    let chosen = design::greedy(&hypotheses, PASSES, empty.then_some(open), k.design_pass_nats);
    let rival = design::rival(&hypotheses)?;
    let nats = design::expected_nats(&hypotheses[0], &hypotheses[rival], &chosen);
    let separates = [hypotheses[0].name.clone(), hypotheses[rival].name.clone()];
    if nats <= k.design_least_nats {
        return None;
    }
    let [leader, other] = separates.each_ref().map(|name| words(name));
    let conditions = chosen.iter().map(|&i| grid[i]).collect();
    let mut found = Experiment::of(conditions, separates, nats, String::new(), k);
    found.text = format!(
        "{PASSES} more passes would distinguish {leader} from {other} and from the other causes. {}",
        found.worth()
    );
    if grid.len() < all {
        found.text.push_str(&format!(
            " Conditions that change the force by less than {:.2} mN are left out: the sensor does not resolve them.",
            1e3 * least_n
        ));
    }
    Some(found)
}

/// Actions on instruments that part the leader from the next candidate.
fn actions(fitted: &Fitted, decision: &Decision) -> Vec<Experiment> {
    let Some(leader) = decision.leader() else { return Vec::new() };
    let second = decision.class.get(1).copied().or_else(|| {
        (0..fitted.candidates.len()).find(|&i| i != leader && fitted.candidates[i].effects.len() == 1)
    });
    let Some(second) = second else { return Vec::new() };
    let (a, b, k) = (&fitted.candidates[leader], &fitted.candidates[second], &fitted.problem.constants);
    let mut list = Vec::new();
    for (one, other) in [(a, b), (b, a)] {
        let thetas = fitted.problem.thetas(&one.best.members, &one.best.by_law().u);
        for (member, theta) in one.best.members.iter().zip(thetas) {
            let Some(check) = member.form().seen_by.filter(|_| !other.effects.contains(&member.effect))
            else {
                continue;
            };
            let nats = (0.5 * (theta[0] / check.sd).powi(2)).min(k.check_most_nats);
            let separates = [a.names().join("+"), b.names().join("+")];
            list.push(Experiment::of(Vec::new(), separates, nats, check.action.to_string(), k));
        }
    }
    list
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 125 nats were odds above 10^6, which verdicts on all passes did not have.
    #[test]
    fn odds_are_those_that_a_verdict_counts() {
        let worth = |rival: &str, nats: f64| {
            let separates = ["squeeze_film".to_string(), rival.to_string()];
            Experiment::of(Vec::new(), separates, nats, String::new(), &Constants::default()).worth()
        };
        // exp(4 / 2) = 7.4; exp(6 / 2) = 20.1.
        let start = "If squeeze film is true, odds";
        assert_eq!(worth("adhesion", 4.0), format!("{start} of 7.4 to 1 against adhesion are expected."));
        assert_eq!(worth("adhesion", 6.0), format!("{start} of 20 to 1 against adhesion are expected."));
        assert_eq!(
            worth("adhesion", 125.0),
            format!("{start} above 100 to 1 against adhesion are expected.")
        );
        assert!(worth(UNKNOWN, 125.0).starts_with("No odds are stated against an unknown cause"));
    }
}
