//! The corrected model of a verdict, for the rig to run with.

use crate::regression::{Layout, Member, Posterior, Problem};
use crate::report::Diagnosis;
use crate::verdict::Verdict;
use effects::Location;
use effects::corrected::{SavedEffect, SavedModel, SavedParameter};
use std::ops::Range;

/// Least relative uncertainty that a model states.
const LEAST_RELATIVE_SD: f64 = 0.005;
/// Half step of a central difference in a coordinate.
const STEP: f64 = 1e-4;

impl Diagnosis {
    /// The model for a run; none where no effect of the library causes most of the gap.
    pub fn saved_model(&self) -> Option<SavedModel> {
        let problem = &self.fitted.problem;
        let best = match self.decision.verdict {
            Verdict::Unknown => return None,
            Verdict::NoGap => &self.fitted.baseline,
            Verdict::Named | Verdict::Ambiguous => {
                self.fitted.candidates[self.decision.class[0]].best.by_law()
            }
        };
        let errors = best.members.iter().map(|m| effects::at(m.effect).interpolation_error);
        let gap = &self.report.gap;
        let square = |rmse: Option<f64>| rmse.unwrap_or(0.0).powi(2);
        let left = (square(gap.form_alone_rmse) - square(gap.noise_floor_rmse)).max(0.0).sqrt();
        Some(SavedModel {
            schema: "muprime.model/1".to_string(),
            verdict: self.report.text.clone(),
            relative_sd: left.max(LEAST_RELATIVE_SD),
            interpolation_error: errors.fold(0.0, f64::max),
            baseline: problem.baseline(&best.u),
            design: problem.design,
            law: problem.law.as_ref().map(|law| law.saved(problem.nominal)),
            effects: saved_effects(problem, best),
        })
    }
}

/// Every member with its parameters and their covariance.
fn saved_effects(problem: &Problem, best: &Posterior) -> Vec<SavedEffect> {
    let thetas = problem.thetas(&best.members, &best.u);
    let layout = Layout::of(&best.members);
    let one = |((member, places), theta): ((&Member, Range<usize>), Vec<f64>)| {
        let (own, first) = (member.parameters(&problem.design), places.start);
        // Covariance in the parameters' units, by the slope of each coordinate.
        let slope: Vec<f64> = (own.iter().zip(&best.u[first..]))
            .map(|(p, u)| (p.value(u + STEP) - p.value(u - STEP)) / (2.0 * STEP))
            .collect();
        let entry = |i: usize, j: usize| best.covariance[(first + i, first + j)] * slope[i] * slope[j];
        let all = 0..own.len();
        let acts_on = if member.place() == Location::Instrument { "reading" } else { "prediction" };
        SavedEffect {
            name: member.name().to_string(),
            law: member.form().name.to_string(),
            acts_on: acts_on.to_string(),
            parameters: (own.iter().zip(&theta))
                .map(|(p, v)| SavedParameter {
                    name: p.name.to_string(),
                    value: *v,
                    unit: p.unit.to_string(),
                })
                .collect(),
            covariance: all.clone().map(|i| all.clone().map(|j| entry(i, j)).collect()).collect(),
            table: effects::at(member.effect).own.map(|own| own.text.clone()),
        }
    };
    best.members.iter().zip(layout.members()).zip(thetas).map(one).collect()
}
