//! Shifts of runs that the table has: a further pass of such a run lies where its run does.

use crate::data::Table;
use crate::fitted::Fitted;
use crate::predict::Forecast;
use nalgebra::{DMatrix, DVector};

/// Adds to forecasts in known runs how far the run lies from the model, and takes the spread of an unknown run out of them.
///
/// `fitted_passes` are the forecasts of the table's own passes. Given the model's mean, the shifts are Gaussian with the
/// prior that was estimated, beside the scatter of single passes and what lasts.
pub fn shifted(
    fitted: &Fitted,
    table: &Table,
    fitted_passes: &[Forecast],
    conditions: &Table,
    forecasts: &mut [Forecast],
) {
    let Some(sd) = fitted.scatter.run_relative_sd.filter(|sd| *sd > 0.0) else { return };
    let problem = &fitted.problem;
    let first = problem.common.ncols() - table.run_count;
    let covariance = problem.covariance(&DMatrix::zeros(table.len(), 0));
    let left = DVector::from_fn(table.len(), |i, _| problem.lateral[i] - fitted_passes[i].corrected);
    let weights = covariance.weights(&left);
    for (i, f) in forecasts.iter_mut().enumerate() {
        let run = conditions.runs[i];
        if run >= table.run_count {
            continue;
        }
        let mut row = DVector::zeros(problem.common.ncols());
        row[first + run] = sd * f.recalibrated;
        let unknown = (sd * f.corrected).powi(2);
        f.corrected += weights[first + run] * row[first + run];
        let rest = (f.corrected_sd.powi(2) - unknown).max(0.0) + covariance.posterior_variance(&row);
        f.corrected_sd = rest.sqrt();
        f.scatter_sd = (f.scatter_sd.powi(2) - unknown).max(0.0).sqrt();
    }
}
