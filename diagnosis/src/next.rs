//! Which experiment next: the conditions, or the instrument action, that best part the leading hypotheses.
//!
//! | room | purpose |
//! |---|---|
//! | [`grid`] | conditions that a plan can choose, within what the table has shown |
//! | [`predictive`] | what each hypothesis expects there, with how surely it knows it |
//! | [`design`] | which of them, in which order |

pub mod design;
pub mod grid;
pub mod predictive;

use crate::data::{Rig, Table};
use crate::decision::{Decision, Verdict};
use crate::fit::Problem;
use crate::hypotheses::Fitted;
use effects::Operating;
use predictive::predictives;
use serde::Serialize;

/// A condition of a plan.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Condition {
    /// Amplitude, peak to peak, m.
    pub amplitude_pp_m: f64,
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Speed, m/s.
    pub speed_m_s: f64,
    /// Direction.
    pub direction: f64,
    /// Normal force, N.
    pub normal_force_n: f64,
    /// Middle of the pass along the plate, m.
    pub position_m: f64,
    /// Ambient pressure, Pa, where it was varied.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ambient_pressure_pa: Option<f64>,
}

impl Condition {
    /// The settings of a pass, without its time and environment.
    pub fn of(p: &Operating) -> Self {
        Condition {
            amplitude_pp_m: p.amplitude_pp_m,
            frequency_hz: p.frequency_hz,
            speed_m_s: p.speed_m_s,
            direction: p.direction,
            normal_force_n: p.normal_force_n,
            position_m: p.position_m,
            ambient_pressure_pa: p.ambient_pressure_pa,
        }
    }
}

/// A next experiment.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Experiment {
    /// Conditions to run, those that tell most first; empty for an action on an instrument.
    pub conditions: Vec<Condition>,
    /// The two hypotheses that it parts: the leader and its strongest rival.
    pub separates: [String; 2],
    /// Expected gain of the first one's log evidence over the second's, were the first one true.
    pub expected_nats: f64,
    /// In words.
    pub text: String,
}

/// Passes of a designed experiment.
pub const PASSES: usize = 12;
/// Designs experiments for what a decision left open.
pub fn experiments(fitted: &Fitted, table: &Table, rig: &Rig, decision: &Decision) -> Vec<Experiment> {
    let k = &fitted.problem.constants;
    if decision.verdict == Verdict::NoGap && decision.none >= k.settled_probability {
        return Vec::new();
    }
    let mut list = Vec::new();
    let grid = grid::conditions(table);
    let hypotheses = predictives(fitted, rig, decision, &grid);
    // Where the evidence is for an effect and the left-out regions are against it, passes that part hypotheses come back to
    // a few conditions and leave the regions as empty as they are. Every second one then goes where nothing is known.
    let empty = decision.unknown > 0.5 && fitted.unknown_probability < 0.5;
    let open = hypotheses.len() - 1;
    let chosen = design::greedy(&hypotheses, PASSES, empty.then_some(open), k.design_pass_nats);
    if let Some(rival) = design::rival(&hypotheses, &chosen) {
        let nats = design::expected_nats(&hypotheses[0], &hypotheses[rival], &chosen);
        let names = [hypotheses[0].name.clone(), hypotheses[rival].name.clone()];
        if nats > k.design_least_nats {
            list.push(Experiment {
                conditions: chosen.iter().map(|&i| Condition::of(&grid[i])).collect(),
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
                expected_nats: (0.5 * (theta[0] / check.sd).powi(2))
                    .min(fitted.problem.constants.check_most_nats),
                text: check.action.to_string(),
            });
        }
    }
    list
}
