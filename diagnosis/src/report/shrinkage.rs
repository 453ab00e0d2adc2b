//! How far the gap shrinks on passes held out by group. docs/diagnosis/model.md, section 10.

use crate::data::{RigFile, Table};
use crate::hypotheses::Fitted;
use crate::random::{deviate, split_mix};
use crate::report::predict::{Predictor, forecast, model};
use models::{Condition, covariate};
use rayon::prelude::*;
use serde::Serialize;

/// Blocks of neighbouring conditions: passes in one, and the most of them.
const BLOCK: usize = 6;
const MOST_BLOCKS: usize = 40;
/// Fewest passes that a fold may leave to the fit.
const LEAST_FITTED: usize = 10;
/// Fewest resamples with a gap for an interval.
const LEAST_DRAWS: usize = 20;
/// Squared errors of a pass: under four models, of repeatability, and the part of it that passes have in common.
const ERRORS: usize = 6;
/// Error of the recalibrated baseline, as a multiple of the nominal one's, above which a remark says so.
const MISLED: f64 = 1.1;
/// Quantiles of a 95 % interval.
const CI95: [f64; 2] = [0.025, 0.975];

/// The gap in units of full friction, on held-out passes; none where the table is too short to hold passes out.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct HeldOutError {
    /// Unit of the errors.
    pub unit: &'static str,
    /// Of the nominal baseline.
    pub before_rmse: Option<f64>,
    /// Of the recalibrated baseline.
    pub recalibrated_rmse: Option<f64>,
    /// Of the verdict's model.
    pub after_rmse: Option<f64>,
    /// Of the named effects in the library's own form, without the smooth departure from it.
    pub form_alone_rmse: Option<f64>,
    /// What repeatability leaves.
    pub noise_floor_rmse: Option<f64>,
    /// Share of the removable gap that is closed; none where there is no gap to shrink.
    pub shrinkage: Option<f64>,
    /// Its interval on as many other passes (bootstrap over groups, 95 per cent).
    pub shrinkage_ci95: Option<[f64; 2]>,
    /// Share of the removable gap's square that is left.
    pub unexplained_share: Option<f64>,
}

impl HeldOutError {
    /// How far it shrinks, for a sentence: the verb, by how many per cent, and the interval of that.
    pub fn change(&self) -> Option<(&'static str, f64, Option<[f64; 2]>)> {
        let share = self.shrinkage?;
        let turned = |[low, high]: [f64; 2]| if share < 0.0 { [-high, -low] } else { [low, high] };
        let interval = self.shrinkage_ci95.map(|ends| turned(ends).map(|end| 100.0 * end));
        Some((if share < 0.0 { "grows" } else { "shrinks" }, 100.0 * share.abs(), interval))
    }

    /// Says that recalibration alone, from which the shrinkage counts, is worse than no recalibration.
    pub fn remark(&self) -> Option<String> {
        let times = self.recalibrated_rmse? / self.before_rmse?;
        self.shrinkage.filter(|_| times > MISLED)?;
        let above = |rmse: f64| Some((rmse.powi(2) - self.noise_floor_rmse?.powi(2)).max(0.0).sqrt());
        let share = 1.0 - above(self.after_rmse?)? / above(self.before_rmse?)?;
        let verb = if share < 0.0 { "grows" } else { "shrinks" };
        let nominal = if share.is_finite() {
            format!("Counted from the nominal model, the gap {verb} by {:.0} %.", 100.0 * share.abs())
        } else {
            "The nominal model has no gap there.".to_string()
        };
        Some(format!(
            "On passes that were held out, the recalibrated model, from which the shrinkage counts, is {times:.2} \
             times as far off as the nominal one. {nominal}"
        ))
    }
}

/// Groups that are held out together: runs where there are at least three, else blocks of like conditions.
pub fn groups(table: &Table, folds: usize) -> Vec<usize> {
    if table.run_count >= 3 {
        return table.runs.clone();
    }
    // Conditions with all their replicates, in an order that keeps neighbours together, cut into blocks.
    let key = |p: &Condition| {
        let own = table.in_its_loads(p);
        covariate::NEIGHBOURS.map(|c| Some(c.neighbourhood?(c.of(&own)?)))
    };
    let mut keyed: Vec<_> = table.passes.iter().map(key).zip(0..).collect();
    keyed.sort();
    let blocks = (table.len() / BLOCK).clamp(folds * 2, MOST_BLOCKS.max(folds * 2));
    let mut group = vec![0_usize; table.len()];
    let (mut block, mut filled) = (0, 0);
    for (k, (key, i)) in keyed.iter().enumerate() {
        let fresh = k > 0 && keyed[k - 1].0 != *key;
        if fresh && filled * blocks >= table.len() {
            (block, filled) = (block + 1, 0);
        }
        group[*i] = block;
        filled += 1;
    }
    group
}

/// Errors on held-out passes under the answer's model.
pub fn held_out_error(fitted: &Fitted, table: &Table, rig: &RigFile, answer: &Predictor) -> HeldOutError {
    let k = &fitted.problem.constants;
    let groups = groups(table, k.folds);
    let full = fitted.problem.full_friction();
    let folds = k.folds.min(groups.iter().copied().max().unwrap_or(0) + 1).max(2);
    let per_fold: Vec<Vec<(usize, f64, [f64; ERRORS])>> = (0..folds)
        .into_par_iter()
        .map(|fold| {
            let (out, rest): (Vec<usize>, Vec<usize>) =
                (0..table.len()).partition(|&i| groups[i] % folds == fold);
            if out.is_empty() || rest.len() < LEAST_FITTED {
                return Vec::new();
            }
            let fit = model(fitted, table, answer, Some(&rest));
            let passes: Vec<_> = out.iter().map(|&i| table.passes[i]).collect();
            forecast(fitted, rig, &fit, &passes)
                .iter()
                .zip(&out)
                .map(|(f, &i)| {
                    // A pass that may not belong counts for little, in errors and floor alike.
                    let inflation = fitted.scatter.inflation[i];
                    let e = |m: f64| ((table.lateral[i] - m) / full[i]).powi(2) / inflation;
                    let common = fitted.problem.common.row(i).norm_squared();
                    let own = fitted.problem.variance[i] / inflation;
                    let floor = |v: f64| v / (full[i] * full[i]) / inflation;
                    let [nominal, recalibrated, corrected, form] =
                        [f.baseline, f.recalibrated, f.corrected, f.form].map(e);
                    let errors = [nominal, recalibrated, corrected, form, floor(own + common), floor(common)];
                    (groups[i], 1.0 / inflation, errors)
                })
                .collect()
        })
        .collect();
    let mut sums: std::collections::BTreeMap<usize, ([f64; ERRORS], f64)> = std::collections::BTreeMap::new();
    for (group, weight, e) in per_fold.into_iter().flatten() {
        let entry = sums.entry(group).or_default();
        entry.0.iter_mut().zip(e).for_each(|(sum, e)| *sum += e);
        entry.1 += weight;
    }
    let list: Vec<([f64; ERRORS], f64)> = sums.into_values().collect();
    let mean = |list: &[([f64; ERRORS], f64)]| {
        let n: f64 = list.iter().map(|g| g.1).sum::<f64>().max(f64::MIN_POSITIVE);
        list.iter().fold([0.0; ERRORS], |m, (sums, _)| std::array::from_fn(|k| m[k] + sums[k] / n))
    };
    let all = mean(&list);
    let shrink = |m: &[f64; ERRORS]| {
        let removable = m[1] - m[4];
        (removable > 0.0).then(|| 1.0 - ((m[2] - m[4]).max(0.0) / removable).sqrt())
    };
    // The mean square of n scatters about the floor has a relative deviation of sqrt(2/n); what passes have in
    // common scatters between groups alone.
    let shared = all[5] / all[4].max(f64::MIN_POSITIVE);
    let freedom = [table.len(), list.len().max(1)].map(|n| n as f64);
    let scatter = (2.0 * ((1.0 - shared).powi(2) / freedom[0] + shared.powi(2) / freedom[1])).sqrt();
    let gapless = list.is_empty() || all[1] <= all[4] * (1.0 + k.gapless_sd * scatter);
    // Passes that scatter by less than is stated bound the floor themselves.
    let stated = (all[2] / all[4]).min(1.0);
    let mut state = 0x9E37_79B9_7F4A_7C15_u64;
    let mut draws: Vec<f64> = (0..k.resamples)
        .filter_map(|_| {
            let sample: Vec<_> =
                (0..list.len()).map(|_| list[(split_mix(&mut state) % list.len() as u64) as usize]).collect();
            // The floor is known no better than the scatter of as many passes tells: what is left may hide in that.
            let mut means = mean(&sample);
            means[4] *= stated * (1.0 + scatter * deviate(&mut state)).max(0.0);
            shrink(&means)
        })
        .collect();
    draws.sort_by(f64::total_cmp);
    let estimate = shrink(&all).unwrap_or(0.0);
    let wider = widening(folds, list.len());
    let quantile = |q: f64| {
        let drawn = draws[((draws.len() - 1) as f64 * q).round() as usize];
        (estimate + wider * (drawn - estimate)).min(1.0)
    };
    let removable = all[1] - all[4];
    let rms = |k: usize| (!list.is_empty()).then(|| all[k].sqrt());
    HeldOutError {
        unit: "mu_relative",
        before_rmse: rms(0),
        recalibrated_rmse: rms(1),
        after_rmse: rms(2),
        form_alone_rmse: rms(3),
        noise_floor_rmse: rms(4),
        shrinkage: if gapless { None } else { shrink(&all) },
        shrinkage_ci95: (!gapless && draws.len() > LEAST_DRAWS).then(|| CI95.map(quantile)),
        unexplained_share: (!gapless).then(|| (all[2] - all[4]).max(0.0) / removable),
    }
}

/// Factor on the deviation of the bootstrap's means, for an interval of the share on as many other passes.
/// Refits to folds share most of their passes, so their errors go together by about the share that is held
/// out (Nadeau & Bengio 2003); other passes scatter as much as these; and groups that are drawn again scatter
/// about their own mean, by less than about the true one.
fn widening(folds: usize, groups: usize) -> f64 {
    let [k, g] = [folds, groups].map(|n| n as f64);
    let refitted = (1.0 / k + 1.0 / (k - 1.0)) * k;
    ((refitted + 1.0) * g / (g - 1.0).max(1.0)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::HeldOutError;
    use crate::tests::{Deviates, rig, runs};
    use crate::verdict::Verdict;
    use crate::{Options, diagnose};

    /// One run of four has a quarter more friction: no cause is fixed within a run alone, and what four shifts
    /// scatter is no gap that shrinks by nothing.
    #[test]
    fn shifts_of_few_runs_are_no_gap_that_could_shrink() {
        let mut table = runs(&mut Deviates(5), 4);
        for (lateral, run) in table.lateral.iter_mut().zip(&table.runs) {
            *lateral *= if *run == 2 { 1.25 } else { 1.0 };
        }
        let options = Options { pairs: false, ..Options::default() };
        let report = diagnose(&table, &rig(), &options, String::new()).report;
        assert_eq!(report.verdict, Verdict::NoGap, "{}", report.text);
        let gap = &report.gap;
        assert!(gap.recalibrated_rmse > gap.noise_floor_rmse, "{gap:?}");
        assert_eq!((gap.shrinkage, gap.shrinkage_ci95, gap.unexplained_share), (None, None, None), "{gap:?}");
    }

    /// The shrinkage counts from the recalibrated baseline, also where that is the worse one: then it is said.
    #[test]
    fn a_recalibration_that_is_worse_than_none_is_remarked_on() {
        let gap = |recalibrated: f64| HeldOutError {
            unit: "mu_relative",
            before_rmse: Some(0.05),
            recalibrated_rmse: Some(recalibrated),
            after_rmse: Some(0.02),
            form_alone_rmse: None,
            noise_floor_rmse: Some(0.01),
            shrinkage: Some(0.7),
            shrinkage_ci95: None,
            unexplained_share: None,
        };
        let remark = gap(0.066).remark().unwrap();
        // 1 - sqrt((0.02^2 - 0.01^2) / (0.05^2 - 0.01^2))
        assert!(remark.contains("1.32 times") && remark.contains("shrinks by 65 %"), "{remark}");
        let worse = HeldOutError { after_rmse: Some(0.06), ..gap(0.066) }.remark().unwrap();
        assert!(worse.contains("the gap grows by 21 %"), "{worse}");
        assert_eq!(gap(0.049).remark(), None);
        assert_eq!(HeldOutError { shrinkage: None, ..gap(0.066) }.remark(), None);
    }
}
