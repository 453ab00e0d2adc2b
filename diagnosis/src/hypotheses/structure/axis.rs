//! What a shape goes over: a covariate of the pass itself, or what the pass before it in its run had of it.

use crate::regression::scaled;
use models::Condition;
use models::covariate::{COVARIATES, Covariate, CovariateRole, DIRECTION};
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// Share of its deviation that the history of a covariate must have beside the settings of the pass itself.
const OF_ITS_OWN: f64 = 0.7;
/// Fewest passes by which a history differs from these.
const FEWEST: usize = 24;

/// The passes of a table in the order of time.
#[derive(Debug)]
pub(super) struct Past(Vec<Condition>);

impl Past {
    pub(super) fn of(passes: &[Condition]) -> Self {
        let mut all = passes.to_vec();
        all.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        Past(all)
    }

    /// The last pass before a condition in its run; none at a run's start.
    fn before(&self, p: &Condition) -> Option<&Condition> {
        let here = self.0.partition_point(|q| q.time_s < p.time_s);
        let last = self.0.get(here.checked_sub(1)?)?;
        // A start of a run is a difference of times: rounding must not part its first pass from the others.
        let start = p.time_s - p.time_in_run_s();
        (last.time_s > start - 1e-9 * (1.0 + start.abs())).then_some(last)
    }
}

/// A covariate, of the pass itself or of the pass before.
#[derive(Debug, Clone)]
pub(super) struct ShapeAxis {
    pub(super) covariate: &'static Covariate,
    pub(super) past: Option<Arc<Past>>,
}

impl ShapeAxis {
    /// The value on the covariate's scale: of the pass before, whether the direction was the same, and how
    /// far away the place was. `None` where a condition does not state it, or starts its run.
    pub(super) fn of(&self, p: &Condition, largest_amplitude: f64) -> Option<f64> {
        let scaled =
            |p: &Condition| self.covariate.of(p).map(|v| self.covariate.scaled(v, largest_amplitude));
        let own = scaled(p)?;
        let Some(past) = &self.past else { return Some(own) };
        let last = scaled(past.before(p)?)?;
        Some(match self.covariate.role {
            _ if self.covariate.name == DIRECTION.name => own * last,
            CovariateRole::Place => (own - last).abs(),
            _ => last,
        })
    }

    /// The histories that a table can separate from the settings of its passes. Where settings rise from pass to
    /// pass, what the pass before had is what the pass has, and a law.
    pub fn histories(passes: &[Condition], past: &Arc<Past>, largest_amplitude: f64) -> Vec<ShapeAxis> {
        let own: Vec<Vec<f64>> =
            COVARIATES.iter().filter_map(|c| scaled(c, passes, largest_amplitude)).collect();
        let set = |c: &&&Covariate| matches!(c.role, CovariateRole::Setting | CovariateRole::Place);
        let all = COVARIATES.iter().filter(set);
        let all = all.map(|c| ShapeAxis { covariate: c, past: Some(past.clone()) });
        all.filter(|axis| {
            let rows: Vec<(usize, f64)> = passes
                .iter()
                .enumerate()
                .filter_map(|(i, p)| Some((i, axis.of(p, largest_amplitude)?)))
                .collect();
            let values = DVector::from_iterator(rows.len(), rows.iter().map(|r| r.1));
            let sd = values.variance().sqrt();
            if rows.len() < FEWEST || sd <= axis.covariate.least_spread.max(1e-12) {
                return false;
            }
            let known =
                DMatrix::from_fn(rows.len(), own.len() + 1, |i, j| own.get(j).map_or(1.0, |c| c[rows[i].0]));
            let known_part = known.clone().svd(true, true).solve(&values, 1e-9);
            known_part.is_ok_and(|part| (&values - known * part).variance().sqrt() > OF_ITS_OWN * sd)
        })
        .collect()
    }
}
