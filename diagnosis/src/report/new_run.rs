//! Predictions in a run that the table does not have, or after its end. docs/diagnosis/model.md, section 10.
//!
//! A fit shows how passes scatter about it, not how far the next set-up, or the next hour, will lie from
//! those before. That is measured instead, as in conformal prediction: each run is left out and predicted
//! from the others, the end of the table from its beginning. The deviation is widened by what 95 % of the
//! errors need, and is at least their share of the larger forces: of runs by root mean square and Student's
//! quantile, of later times the worst.

use crate::data::{RigFile, Table};
use crate::hypotheses::Fitted;
use crate::report::predict::{Forecast, Predictor, forecast, model};
use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Share of the errors that an interval must hold, and the deviations in which a normal number does.
const HELD: f64 = 0.95;
const DEVIATIONS: f64 = 1.959_963_985;
/// Fewest passes that a left-out part may leave to the fit, and that it must have.
const LEAST: [usize; 2] = [10, 4];
/// Scatters above which a force counts for the share.
const LARGE: f64 = 20.0;
/// Shares of the table, in time, after which the rest is predicted.
const CUTS: [f64; 2] = [0.5, 0.75];

/// Widens the deviations of conditions in runs that the table does not have, and later than its last pass.
pub fn widened(
    fitted: &Fitted,
    table: &Table,
    rig: &RigFile,
    answer: &Predictor,
    conditions: &Table,
    mut forecasts: Vec<Forecast>,
) -> Vec<Forecast> {
    let end = table.passes.iter().map(|p| p.time_s).fold(f64::NEG_INFINITY, f64::max);
    let strange = |i: usize| conditions.runs[i] >= conditions.run_count;
    let later = |i: usize| conditions.passes[i].time_s > end;
    let rows = || 0..conditions.len();
    let measure = |parts: Vec<Vec<usize>>| -> Vec<Misses> {
        parts.par_iter().filter_map(|out| misses(fitted, table, rig, answer, out)).collect()
    };
    let of_run = if rows().any(strange) { Misses::of_another(&measure(runs(table))) } else { STATED };
    // Ends of the table, predicted from what was seen before.
    let ends = CUTS.iter().map(|from| ((table.len() as f64 * from) as usize..table.len()).collect());
    let of_time = if rows().any(later) { Misses::at_worst(&measure(ends.collect())) } else { STATED };
    for (i, f) in forecasts.iter_mut().enumerate() {
        let own = if strange(i) { of_run } else { STATED };
        let own = if later(i) { own.worst(of_time) } else { own };
        let wide = |mean: f64, sd: f64| (own.factor * sd).max(own.share * mean.abs());
        f.corrected_sd = wide(f.corrected, f.corrected_sd);
        f.in_run_sd = wide(f.in_run, f.in_run_sd);
    }
    forecasts
}

/// How far passes that were left out lie from their prediction.
#[derive(Debug, Clone, Copy)]
struct Misses {
    /// Factor on the stated deviations that holds them.
    factor: f64,
    /// Their own deviation as a share of the force.
    share: f64,
}

/// Nothing is widened.
const STATED: Misses = Misses { factor: 1.0, share: 0.0 };

impl Misses {
    fn worst(self, other: Self) -> Self {
        Misses { factor: self.factor.max(other.factor), share: self.share.max(other.share) }
    }

    fn at_worst(parts: &[Misses]) -> Self {
        parts.iter().copied().fold(STATED, Misses::worst)
    }

    /// What one more of some equals may do: their root mean square, with Student's quantile for their number.
    fn of_another(parts: &[Misses]) -> Self {
        let freedom = parts.len() as f64 - 1.0;
        let Ok(student) = StudentsT::new(0.0, 1.0, freedom) else { return Misses::at_worst(parts) };
        let few = student.inverse_cdf(0.5 + 0.5 * HELD) / DEVIATIONS;
        let rms = |of: fn(&Misses) -> f64| {
            few * (parts.iter().map(|p| of(p).powi(2)).sum::<f64>() / parts.len() as f64).sqrt()
        };
        STATED.worst(Misses { factor: rms(|p| p.factor), share: rms(|p| p.share) })
    }
}

/// Each run of a table that has several.
fn runs(table: &Table) -> Vec<Vec<usize>> {
    if table.run_count < 2 {
        return Vec::new();
    }
    (0..table.run_count).map(|run| (0..table.len()).filter(|&i| table.runs[i] == run).collect()).collect()
}

/// How far the passes left out lie from their prediction; none where too few are left, or out.
fn misses(fitted: &Fitted, table: &Table, rig: &RigFile, by: &Predictor, out: &[usize]) -> Option<Misses> {
    let rest: Vec<usize> = (0..table.len()).filter(|i| out.binary_search(i).is_err()).collect();
    if rest.len() < LEAST[0] || out.len() < LEAST[1] {
        return None;
    }
    let fit = model(fitted, table, by, Some(&rest));
    let passes: Vec<_> = out.iter().map(|&i| table.passes[i]).collect();
    let forecasts = forecast(fitted, rig, &fit, &passes);
    // The deviation that holds most of the errors, in units of these forecasts; nothing without any.
    let held = |unit: &dyn Fn(&Forecast) -> Option<f64>| {
        let error = |(f, &i): (&Forecast, &usize)| {
            Some((table.lateral[i] - f.corrected).abs() / unit(f)? / fitted.scatter.inflation[i].sqrt())
        };
        let mut ratios: Vec<f64> = forecasts.iter().zip(out).filter_map(error).collect();
        ratios.sort_by(f64::total_cmp);
        let place = ((ratios.len() as f64 + 1.0) * HELD).ceil() as usize;
        ratios.get(place - 1).or(ratios.last()).map_or(0.0, |ratio| ratio / DEVIATIONS)
    };
    // Of a force that is hardly above the scatter a share says nothing.
    let large = |f: &Forecast| Some(f.corrected.abs()).filter(|force| *force > LARGE * f.scatter_sd);
    Some(Misses { factor: held(&|f| Some(f.corrected_sd)), share: held(&large) })
}

#[cfg(test)]
mod tests {
    use crate::tests::{Deviates, rig, runs};
    use crate::{Options, diagnose};

    /// Later passes of the same law, many of them of a few mN: what these scatter is no share of larger forces.
    #[test]
    fn later_passes_of_the_same_law_need_no_more_than_their_scatter() {
        let table = runs(&mut Deviates(6), 2);
        let mut later = table.clone();
        later.passes.iter_mut().for_each(|p| p.time_s += 400.0);
        let options = Options { pairs: false, ..Options::default() };
        let result = diagnose(&table, &rig(), &options, String::new());
        let mut ratios: Vec<f64> = (result.predict(&later).unwrap().iter())
            .filter(|f| f.corrected.abs() > 0.05)
            .map(|f| f.corrected_sd / f.corrected.abs() / 0.02)
            .collect();
        ratios.sort_by(f64::total_cmp);
        let middle = ratios[ratios.len() / 2];
        assert!((1.0..1.75).contains(&middle), "{middle} times the scatter of a pass: {ratios:?}");
    }
}
