//! The corrected model of a verdict, for the rig to run with.

use crate::attribute::Verdict;
use crate::evidence::Explained;
use crate::fit::{Member, NUISANCES, Problem};
use crate::verdict::Diagnosis;
use effects::corrected::{SavedEffect, SavedModel, SavedParameter};
use effects::{Place, known};

impl Diagnosis {
    /// The model for a run; none where no effect of the library causes most of the gap.
    pub fn saved_model(&self) -> Option<SavedModel> {
        let problem = &self.fitted.problem;
        let best = match self.decision.verdict {
            Verdict::Unknown => return None,
            Verdict::NoGap => &self.fitted.none,
            Verdict::Named | Verdict::Ambiguous => &self.fitted.candidates[self.decision.class[0]].best,
        };
        let errors = best.members.iter().map(|m| known()[m.effect].interpolation_error());
        let gap = &self.report.gap;
        let left = (gap.form_alone_rmse.powi(2) - gap.noise_floor_rmse.powi(2)).max(0.0).sqrt();
        Some(SavedModel {
            schema: "muprime.model/1".to_string(),
            verdict: self.report.text.clone(),
            relative_sd: left.max(0.005),
            interpolation_error: errors.fold(0.0, f64::max),
            baseline: problem.baseline(&best.u),
            design: problem.design,
            effects: saved_effects(best),
        })
    }
}

/// Every member with its parameters and their covariance.
fn saved_effects(best: &Explained) -> Vec<SavedEffect> {
    let mut first = NUISANCES;
    let thetas = Problem::thetas(&best.members, &best.u);
    let mut list = Vec::new();
    for (member, theta) in best.members.iter().zip(thetas) {
        list.push(saved_effect(best, *member, first, &theta));
        first += member.parameters().len();
    }
    list
}

/// One member, whose coordinates begin at `first`.
fn saved_effect(best: &Explained, member: Member, first: usize, theta: &[f64]) -> SavedEffect {
    let own = member.parameters();
    // Covariance in the parameters' units, by the slope of each coordinate.
    let slope: Vec<f64> = (own.iter().zip(&best.u[first..]))
        .map(|(p, u)| (p.value(u + 1e-4) - p.value(u - 1e-4)) / 2e-4)
        .collect();
    let entry = |i: usize, j: usize| best.covariance[(first + i, first + j)] * slope[i] * slope[j];
    let all = 0..own.len();
    let acts_on = if member.place() == Place::Instrument { "reading" } else { "prediction" };
    SavedEffect {
        name: member.name().to_string(),
        law: member.form().name.to_string(),
        acts_on: acts_on.to_string(),
        parameters: (own.iter().zip(theta))
            .map(|(p, v)| SavedParameter { name: p.name.to_string(), value: *v, unit: p.unit.to_string() })
            .collect(),
        covariance: all.clone().map(|i| all.clone().map(|j| entry(i, j)).collect()).collect(),
    }
}
