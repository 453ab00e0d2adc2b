//! The operating space cut into parts, as a regression tree is grown (Breiman et al. 1984), by the chance of standing out.

use crate::scatter::moments;
use models::Condition;
use models::covariate::{self, CovariateRole};
use std::collections::BTreeMap;

/// Largest number of parts that the operating space is cut into, and the least number of places in one.
const PARTS: usize = 128;
const LEAST: usize = 16;
/// Levels at which a covariate may be cut.
const LEVELS: usize = 24;
/// Least gain of a cut in the sum of squares.
const LEAST_GAIN: f64 = 0.5;

/// A covariate, the values at which it may be cut, and for each place how many of them it lies above.
pub(super) struct Cut {
    covariate: usize,
    pub at: Vec<f64>,
    above: Vec<u8>,
}

/// Smallest and largest value of each level. One setting that drifts or scatters has no gap of 2 % between its
/// values, and they lie within 6 %.
pub(super) fn levels(mut values: Vec<f64>) -> Vec<[f64; 2]> {
    values.sort_by(f64::total_cmp);
    let mut list: Vec<[f64; 2]> = Vec::new();
    for v in values {
        match list.last_mut() {
            Some([low, high]) if v - *high <= 0.02 * high.abs() && v - *low <= 0.06 * low.abs() => *high = v,
            _ => list.push([v, v]),
        }
    }
    list
}

/// Where each covariate may be cut: between quantiles of the places, and outside the levels of the passes.
pub(super) fn cuts(passes: &[Condition], places: &[Condition]) -> Vec<Cut> {
    let one = |index: usize| {
        let covariate = covariate::COVARIATES[index];
        let values = covariate.of_all(places)?;
        if covariate.role == CovariateRole::Climate && moments(&values).1 < covariate.least_spread {
            return None;
        }
        let mut sorted = values.clone();
        sorted.sort_by(f64::total_cmp);
        // Time, place and climate have no levels.
        let set = passes.iter().filter(|_| covariate.role == CovariateRole::Setting);
        let levels = levels(set.filter_map(|p| covariate.of(p)).collect());
        // Apart from the levels on both sides, so that a bound in two or three digits is beyond neither.
        let apart = |cut: f64| {
            let below = levels.iter().rev().find(|[_, high]| *high <= cut);
            match (below, levels.iter().find(|[low, _]| *low >= cut)) {
                (Some([_, a]), Some([b, _])) => cut.clamp(0.9 * a + 0.1 * b, 0.1 * a + 0.9 * b),
                _ => cut,
            }
        };
        let mut at: Vec<f64> = (1..LEVELS)
            .filter_map(|k| {
                let quantile = sorted[k * (sorted.len() - 1) / LEVELS];
                let level = levels.iter().find(|[low, high]| (*low..=*high).contains(&quantile));
                let end = level.map_or(quantile, |[_, high]| *high);
                Some(apart(0.5 * (end + sorted.get(sorted.partition_point(|v| *v <= end))?)))
            })
            .collect();
        at.dedup();
        let above = values.iter().map(|v| at.partition_point(|a| a < v) as u8).collect();
        (!at.is_empty()).then_some(Cut { covariate: index, at, above })
    };
    (0..covariate::COVARIATES.len()).filter_map(one).collect()
}

/// A part of the operating space.
#[derive(Clone)]
pub(super) struct RegionCandidate {
    pub bounds: BTreeMap<usize, [f64; 2]>,
    pub members: Vec<usize>,
    /// The part that it was cut from.
    parent: Option<usize>,
    /// Whether it has been cut itself.
    cut: bool,
}

/// Cuts the space where the chances of standing out differ most, until there are [`PARTS`] parts.
pub(super) fn parts(cuts: &[Cut], chance: &[f64]) -> Vec<RegionCandidate> {
    let whole = RegionCandidate {
        bounds: BTreeMap::new(),
        members: (0..chance.len()).collect(),
        parent: None,
        cut: false,
    };
    let mut best: Vec<Option<(f64, usize, usize)>> = vec![best_cut(cuts, chance, &whole.members)];
    let mut list = vec![whole];
    for _ in 1..PARTS {
        let open = (0..list.len()).filter(|&k| !list[k].cut).filter_map(|k| best[k].map(|b| (k, b)));
        let Some((k, (_, cut, level))) = open.max_by(|a, b| a.1.0.total_cmp(&b.1.0).then(b.0.cmp(&a.0)))
        else {
            break;
        };
        list[k].cut = true;
        for upper in [false, true] {
            let mut part = list[k].clone();
            part.members.retain(|&i| (usize::from(cuts[cut].above[i]) > level) == upper);
            let bound = part.bounds.entry(cuts[cut].covariate).or_insert([f64::NEG_INFINITY, f64::INFINITY]);
            bound[usize::from(!upper)] = cuts[cut].at[level];
            (part.parent, part.cut) = (Some(k), false);
            best.push(best_cut(cuts, chance, &part.members));
            list.push(part);
        }
    }
    list
}

/// Gain in the sum of squares of the best cut of some places, and its covariate and level.
fn best_cut(cuts: &[Cut], chance: &[f64], members: &[usize]) -> Option<(f64, usize, usize)> {
    let all: f64 = members.iter().map(|&i| chance[i]).sum();
    let square = |sum: f64, count: usize| sum * sum / count.max(1) as f64;
    let mut best: Option<(f64, usize, usize)> = None;
    for (k, cut) in cuts.iter().enumerate() {
        let mut bins = [(0.0, 0); LEVELS];
        for &i in members {
            let bin = &mut bins[usize::from(cut.above[i])];
            *bin = (bin.0 + chance[i], bin.1 + 1);
        }
        let (mut sum, mut count) = (0.0, 0);
        for level in 0..cut.at.len() {
            (sum, count) = (sum + bins[level].0, count + bins[level].1);
            let rest = members.len() - count;
            if count < LEAST || rest < LEAST {
                continue;
            }
            let gain = square(sum, count) + square(all - sum, rest) - square(all, members.len());
            if gain > best.map_or(LEAST_GAIN, |b| b.0) {
                best = Some((gain, k, level));
            }
        }
    }
    best
}

/// The parts with the largest expected F1 together; where both halves of a part are named, the part itself.
pub(super) fn named_parts<'a>(list: &'a [RegionCandidate], chance: &[f64]) -> Vec<&'a RegionCandidate> {
    let hits = |p: &RegionCandidate| p.members.iter().map(|&i| chance[i]).sum::<f64>();
    let mean = |p: &RegionCandidate| hits(p) / p.members.len() as f64;
    let sum: f64 = chance.iter().sum();
    let mut leaves: Vec<usize> = (0..list.len()).filter(|&k| !list[k].cut).collect();
    leaves.sort_by(|&a, &b| mean(&list[b]).total_cmp(&mean(&list[a])).then(a.cmp(&b)));
    let (mut hit, mut count, mut best) = (0.0, 0.0, (0.0, 0));
    for (taken, &k) in leaves.iter().enumerate() {
        hit += hits(&list[k]);
        count += list[k].members.len() as f64;
        let expected = 2.0 * hit / (count + sum);
        if expected > best.0 {
            best = (expected, taken + 1);
        }
    }
    let mut named = vec![false; list.len()];
    leaves[..best.1].iter().for_each(|&k| named[k] = true);
    // The two halves of a part follow each other in the list, after it.
    for k in (2..list.len()).rev().step_by(2) {
        if let (true, true, Some(parent)) = (named[k], named[k - 1], list[k].parent) {
            (named[k], named[k - 1], named[parent]) = (false, false, true);
        }
    }
    (0..list.len()).filter(|&k| named[k]).map(|k| &list[k]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use models::PeakToPeak;

    /// Loads that scatter by 2 % about a level are one level, and no cut comes near another one's passes.
    #[test]
    fn no_cut_goes_through_a_level_that_scatters() {
        let passes: Vec<Condition> = (0..120)
            .map(|i| Condition {
                normal_force_n: [0.1, 0.5][i % 2] * (1.0 + 0.02 * (i as f64 / 60.0 - 1.0)),
                amplitude: PeakToPeak::from_metres([0.5e-6, 2.5e-6][i / 2 % 2] * (1.0 + 1e-5 * i as f64)),
                ..Condition::paper()
            })
            .collect();
        let between: Vec<Condition> = (0..600)
            .map(|i| Condition {
                normal_force_n: 0.1 * 5f64.powf(i as f64 / 599.0),
                amplitude: PeakToPeak::from_metres(0.5e-6 * 5f64.powf((i * 7 % 600) as f64 / 599.0)),
                ..Condition::paper()
            })
            .collect();
        let cuts = cuts(&passes, &[passes.clone(), between].concat());
        for (name, level) in
            [("normal_force_n", [0.1021, 0.4899]), ("amplitude_pp_m", [0.5007e-6, 2.4999e-6])]
        {
            let of = |c: &&Cut| covariate::COVARIATES[c.covariate].name == name;
            let at = &cuts.iter().find(of).expect("two levels can be cut").at;
            let margin = 0.09 * (level[1] - level[0]);
            assert!(at.iter().all(|v| (level[0] + margin..level[1] - margin).contains(v)), "{name}: {at:?}");
        }
    }
}
