//! Shifts of runs that the table has, and what lasts within them: a further pass of such a run lies where its
//! run does, and near where its neighbours do. docs/diagnosis/model.md, section 10.

use crate::hypotheses::Fitted;
use crate::{Forecast, Table};
use nalgebra::{DMatrix, DVector};

/// Says of forecasts in known runs how far the passes about them lie from the model: what a sensor would read
/// there. What the model says stays: the shift of a run is no part of a cause.
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
        f.in_run = f.corrected + weights.dot(&row);
        let rest = (f.corrected_sd.powi(2) - unknown).max(0.0) + covariance.posterior_variance(&row);
        f.in_run_sd = rest.sqrt();
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

#[cfg(test)]
mod tests {
    use crate::tests::{Deviates, rig, table};
    use crate::verdict::Verdict;
    use crate::{Options, diagnose};

    /// Three runs of which one reads 12 % more, no other gap: what the verdict's model says is the
    /// recalibrated baseline, and a sensor in that run reads more.
    #[test]
    fn the_shift_of_a_run_is_no_part_of_the_verdicts_model() {
        let mut table = table(&mut Deviates(11), 0.0);
        table.run_count = 3;
        for i in 0..table.len() {
            table.runs[i] = i / 12;
            table.lateral[i] *= [1.0, 1.12, 1.0][i / 12];
        }
        let result = diagnose(&table, &rig(), &Options::default(), String::new());
        assert_eq!(result.report.verdict, Verdict::NoGap, "{}", result.report.text);
        let forecasts = result.predict(&table).unwrap();
        let mut missed = [0.0; 2];
        for (i, f) in forecasts.iter().enumerate() {
            assert_eq!(f.corrected, f.recalibrated);
            assert!(f.in_run_sd < f.corrected_sd);
            missed[0] += (table.lateral[i] - f.corrected).powi(2);
            missed[1] += (table.lateral[i] - f.in_run).powi(2);
        }
        assert!(missed[1] < 0.5 * missed[0], "{missed:?}");
    }
}
