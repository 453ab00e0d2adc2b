//! Shifts of runs that the table has, and what lasts within them: a further pass of such a run lies where its
//! run does, and near where its neighbours do.

use crate::data::Table;
use crate::fitted::Fitted;
use crate::predict::Forecast;
use nalgebra::{DMatrix, DVector};

/// Adds to forecasts in known runs how far the passes about them lie from the model, and takes that spread
/// out of them.
///
/// `fitted_passes` are the forecasts of the table's own passes. Given the model's mean, what passes have in
/// common is Gaussian with the prior that was estimated. Its slow columns are read between the passes before
/// and after, in time.
pub fn shifted(
    fitted: &Fitted,
    table: &Table,
    fitted_passes: &[Forecast],
    conditions: &Table,
    forecasts: &mut [Forecast],
) {
    let problem = &fitted.problem;
    let common = &problem.common;
    if common.ncols() == 0 {
        return;
    }
    let run_sd = fitted.scatter.run_relative_sd.filter(|sd| *sd > 0.0);
    let first = common.ncols() - run_sd.map_or(0, |_| table.run_count);
    let covariance = problem.covariance(&DMatrix::zeros(table.len(), 0));
    let left = DVector::from_fn(table.len(), |i, _| problem.lateral[i] - fitted_passes[i].corrected);
    let weights = covariance.weights(&left);
    for (i, f) in forecasts.iter_mut().enumerate() {
        let run = conditions.runs[i];
        let Some((before, after, share)) = neighbours(table, run, conditions.passes[i].time_s) else {
            continue;
        };
        let mut row = DVector::zeros(common.ncols());
        for k in 0..first {
            row[k] = (1.0 - share) * common[(before, k)] + share * common[(after, k)];
        }
        let mut unknown = row.norm_squared();
        if let Some(sd) = run_sd {
            row[first + run] = sd * f.recalibrated;
            unknown += (sd * f.corrected).powi(2);
        }
        f.corrected += weights.dot(&row);
        let rest = (f.corrected_sd.powi(2) - unknown).max(0.0) + covariance.posterior_variance(&row);
        f.corrected_sd = rest.sqrt();
        f.scatter_sd = (f.scatter_sd.powi(2) - unknown).max(0.0).sqrt();
    }
}

/// The passes of a run before and after a time, and how far between them it lies; `None` of a run that the
/// table lacks.
fn neighbours(table: &Table, run: usize, time_s: f64) -> Option<(usize, usize, f64)> {
    let own = || (0..table.len()).filter(|i| table.runs[*i] == run);
    let time = |i: usize| table.passes[i].time_s;
    let before = own().rfind(|i| time(*i) <= time_s);
    let after = own().find(|i| time(*i) > time_s);
    let (before, after) = (before.or(after)?, after.or(before)?);
    let span = time(after) - time(before);
    let share = if span > 0.0 { ((time_s - time(before)) / span).clamp(0.0, 1.0) } else { 0.0 };
    Some((before, after, share))
}
