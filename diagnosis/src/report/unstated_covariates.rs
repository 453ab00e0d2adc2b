//! What conditions must state before a verdict's model predicts them: no law takes a value in its place.

use crate::data::Table;
use crate::hypotheses::Fitted;
use crate::report::predict::{Predictor, Which};
use models::covariate::{Covariate, TEMPERATURE};

/// A condition that lacks what the verdict's model predicts by.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "point {point} has no {column}, and {by} predicts by it. Add the column {column} with a value at every point"
)]
pub struct Unstated {
    /// Number of the first such condition.
    pub point: u64,
    /// Its column.
    pub column: &'static str,
    /// What predicts by it.
    pub by: String,
}

/// The first covariate that an answer predicts by and that a condition does not state.
pub(crate) fn unstated(fitted: &Fitted, answer: &Predictor, conditions: &Table) -> Option<Unstated> {
    let all = answer.hypotheses().flat_map(|which| needed(fitted, which));
    all.into_iter().find_map(|(covariate, by)| {
        let row = conditions.passes.iter().position(|p| covariate.of(p).is_none())?;
        Some(Unstated { point: conditions.points[row], column: covariate.name, by })
    })
}

/// The covariates that a hypothesis predicts by and that not every table has, and what in it does.
fn needed(fitted: &Fitted, which: Which) -> Vec<(&'static Covariate, String)> {
    match which {
        Which::Baseline => Vec::new(),
        Which::Open => {
            let climate = fitted.discrepancy.climate();
            climate.map(|c| (c, "the smooth map of what is unknown".to_string())).collect()
        }
        Which::Shape(i) => {
            let shape = &fitted.shapes[i];
            vec![(shape.covariate, format!("a shape over {}", shape.covariate.words))]
        }
        Which::Cause(i) => {
            let cause = &fitted.candidates[i];
            let best = cause.likeliest();
            let laws = best.members.iter().flat_map(|m| {
                let needs = effects::at(m.effect).needs.iter().chain(m.form().needs);
                let law = format!("{} by its law '{}'", m.name(), m.form().name);
                needs.filter_map(|n| n.covariate()).map(move |c| (c, law.clone()))
            });
            let sized = best.change.bends_over(&TEMPERATURE);
            let sizes = sized.then(|| fitted.kernels.climate()).into_iter().flatten();
            let sizes = sizes.map(|c| (c, format!("the size of {}", cause.names().join(" + "))));
            laws.chain(sizes).collect()
        }
    }
}
