//! Which experiment next: the conditions, or the instrument action, that best part the leading hypotheses.
//!
//! | room | purpose |
//! |---|---|
//! | [`grid`] | conditions that a plan can choose, within what the table has shown |
//! | [`belief`] | what each hypothesis expects there, with how surely it knows it |
//! | [`design`] | which of them, in which order |

pub mod belief;
pub mod design;
pub mod grid;

use crate::attribute::{Decision, Verdict};
use crate::data::{RigFile, Table};
use crate::fit::Problem;
use crate::hypotheses::Fitted;
use belief::beliefs;
use models::condition::Condition;
use models::covariate;
use serde::{Serialize, Serializer};
use std::collections::BTreeMap;

/// A next experiment.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Experiment {
    /// Conditions to run, those that tell most first; empty for an action on an instrument.
    #[serde(serialize_with = "settings")]
    pub conditions: Vec<Condition>,
    /// The two hypotheses that it parts: the leader and its strongest rival.
    pub separates: [String; 2],
    /// Expected gain of the first one's log evidence over the second's, were the first one true.
    pub expected_nats: f64,
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

/// Passes of a designed experiment.
pub const PASSES: usize = 12;
/// Nats below which an experiment is not worth asking for.
const LEAST_NATS: f64 = 0.05;
/// Nats of a check beyond which more says nothing.
const MOST_NATS: f64 = 500.0;
/// Probability of no gap from which there is nothing to part.
const SETTLED: f64 = 0.99;

/// Designs experiments for what a decision left open.
pub fn experiments(fitted: &Fitted, table: &Table, rig: &RigFile, decision: &Decision) -> Vec<Experiment> {
    if decision.verdict == Verdict::NoGap && decision.none >= SETTLED {
        return Vec::new();
    }
    let mut list = Vec::new();
    let grid = grid::conditions(table);
    let held = beliefs(fitted, rig, decision, &grid);
    // Where the evidence is for an effect and the left-out regions are against it, passes that part hypotheses come back to
    // a few conditions and leave the regions as empty as they are. Every second one then goes where nothing is known.
    let empty = decision.unknown > 0.5 && fitted.unknown_probability < 0.5;
    let open = held.len() - 1;
    let chosen = design::greedy(&held, PASSES, empty.then_some(open));
    if let Some(rival) = design::rival(&held, &chosen) {
        let nats = design::expected_nats(&held[0], &held[rival], &chosen);
        let names = [held[0].name.clone(), held[rival].name.clone()];
        if nats > LEAST_NATS {
            list.push(Experiment {
                conditions: chosen.iter().map(|&i| grid[i]).collect(),
                text: format!(
                    "{PASSES} passes that best part {} from {} and the other hypotheses; {nats:.1} nats expected",
                    names[0], names[1]
                ),
                separates: names,
                expected_nats: nats,
            });
        }
    }
    if decision.verdict != Verdict::NoGap {
        list.extend(actions(fitted, decision));
    }
    list.sort_by(|x, y| y.expected_nats.total_cmp(&x.expected_nats));
    list
}

/// Actions on instruments that part the leader from the next candidate.
fn actions(fitted: &Fitted, decision: &Decision) -> Vec<Experiment> {
    let leader = decision.class[0];
    let second = decision.class.get(1).copied().or_else(|| {
        (0..fitted.candidates.len()).find(|&i| i != leader && fitted.candidates[i].effects.len() == 1)
    });
    let Some(second) = second else { return Vec::new() };
    let (a, b) = (&fitted.candidates[leader], &fitted.candidates[second]);
    let mut list = Vec::new();
    for (one, other) in [(a, b), (b, a)] {
        let thetas = Problem::thetas(&one.best.members, &one.best.u);
        for (member, theta) in one.best.members.iter().zip(thetas) {
            let Some(check) = member.form().seen_by.filter(|_| !other.effects.contains(&member.effect))
            else {
                continue;
            };
            list.push(Experiment {
                conditions: Vec::new(),
                separates: [a.names().join("+"), b.names().join("+")],
                expected_nats: (0.5 * (theta[0] / check.sd).powi(2)).min(MOST_NATS),
                text: check.action.to_string(),
            });
        }
    }
    list
}
