//! Where: the parts of the operating space that carry the gap, and the part of the rig.

use crate::data::RigFile;
use crate::evidence::Explained;
use crate::fit::Problem;
use crate::hypotheses::Fitted;
use crate::predict::{Forecast, Model, forecast};
use effects::{Place, library};
use models::condition::Condition;
use models::covariate::{self, Role};
use models::quantity::PeakToPeak;
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::collections::BTreeMap;

/// A box of the operating space with its share of the gap.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Region {
    /// Bounds of the covariates that are bounded.
    pub bounds: BTreeMap<&'static str, [f64; 2]>,
    /// Share of the gap's square inside, by the model, over the operating space of the design.
    pub share_of_gap: f64,
    /// Family-wise p-value of as much excess in any box, were there no gap.
    pub p_value: f64,
    /// In words.
    pub text: String,
}

/// Probability by place; `unknown` is the open set's.
pub fn ledger(fitted: &Fitted, probabilities: &[f64], unknown: f64) -> BTreeMap<&'static str, f64> {
    let mut map: BTreeMap<&'static str, f64> = Place::ALL.iter().map(|place| (place.name(), 0.0)).collect();
    map.insert("unknown", unknown);
    for (c, p) in fitted.candidates.iter().zip(probabilities) {
        for &e in &c.effects {
            *map.entry(library()[e].place().name()).or_insert(0.0) += p / c.effects.len() as f64;
        }
    }
    let total: f64 = map.values().sum();
    if total > 0.0 {
        map.values_mut().for_each(|v| *v /= total);
    }
    map
}

/// Deviations of a pass by which the gap must stand out at a condition to count.
const STANDS_OUT: f64 = 2.0;
/// Largest number of parts that the operating space is cut into, and the least number of places in one.
const PARTS: usize = 128;
const LEAST: usize = 16;
/// Levels at which a covariate may be cut.
const LEVELS: usize = 24;
/// Conditions at which the verdict's model is asked for its gap.
const ASKED: usize = 10_000;

/// Boxes that together hold the conditions at which the verdict's model says that the gap stands out of the noise.
///
/// The model is asked between the passes of the table too, in all combinations of its covariates: a box fitted to the
/// passes alone would end where the next pass happens to be. A condition counts by its probability of standing out. The
/// space is cut into parts, each time where that probability differs most; those parts are named that together have
/// the largest expected F1.
pub fn regions(fitted: &Fitted, rig: &RigFile, model: &(Model, Problem, Explained)) -> Vec<Region> {
    let problem = &fitted.problem;
    let n = problem.len();
    let mut places = problem.passes.clone();
    places.extend(conditions_between(&problem.passes, ASKED));
    let forecasts = forecast(fitted, rig, model, &places);
    let chance: Vec<f64> = forecasts.iter().map(stands_out).collect();
    if chance[..n].iter().sum::<f64>() < 3.0 {
        return Vec::new();
    }
    let mu0 = problem.nominal.mu0;
    let weight: Vec<f64> = forecasts
        .iter()
        .zip(&places)
        .map(|(f, p)| ((f.corrected - f.recalibrated) / (mu0 * p.normal_force_n)).powi(2))
        .collect();
    let total: f64 = weight.iter().sum();
    let residual: Vec<f64> = (0..n)
        .map(|i| (problem.lateral[i] - fitted.none.prediction[i]).powi(2) / problem.variance[i])
        .collect();
    let cuts = cuts(&places);
    let tries: f64 = cuts.iter().map(|c| 2.0 * c.at.len() as f64).sum::<f64>().max(1.0);
    let mut found: Vec<Region> = named_parts(&parts(&cuts, &chance), &chance)
        .into_iter()
        .map(|part| {
            let inside: Vec<usize> = part.members.iter().copied().filter(|&i| i < n).collect();
            // A part between the passes rests on the model alone: the table has no word on it.
            let p_value = (!inside.is_empty()).then(|| {
                let excess: f64 = inside.iter().map(|&i| residual[i]).sum();
                let tail = ChiSquared::new(inside.len() as f64).map_or(1.0, |d| d.sf(excess));
                (tail * tries.powi(part.bounds.len().max(1) as i32)).min(1.0)
            });
            let share = part.members.iter().map(|&i| weight[i]).sum::<f64>() / total.max(1e-300);
            region(&part.bounds, &problem.passes, share, p_value)
        })
        .collect();
    found.sort_by(|a, b| b.share_of_gap.total_cmp(&a.share_of_gap));
    found
}

/// Probability that the gap at a condition exceeds [`STANDS_OUT`] deviations of a pass.
fn stands_out(f: &Forecast) -> f64 {
    let spread = (f.corrected_sd.powi(2) - f.scatter_sd.powi(2)).max(0.0).sqrt();
    let above = (f.corrected - f.recalibrated).abs() - STANDS_OUT * f.scatter_sd;
    0.5 * statrs::function::erf::erfc(-above / (spread.max(1e-12) * std::f64::consts::SQRT_2))
}

/// A covariate, the values at which it may be cut, and for each place asked how many of them it lies above.
struct Cut {
    covariate: usize,
    at: Vec<f64>,
    above: Vec<u8>,
}

/// Standard deviation.
fn spread(values: &[f64]) -> f64 {
    let n = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / n;
    (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt()
}

fn cuts(places: &[Condition]) -> Vec<Cut> {
    let one = |covariate: usize| {
        let values: Vec<f64> =
            places.iter().map(|p| covariate::TOLD[covariate].of(p)).collect::<Option<_>>()?;
        if covariate::TOLD[covariate].role == Role::Climate
            && spread(&values) < covariate::TOLD[covariate].least_spread
        {
            return None;
        }
        let mut sorted = values.clone();
        sorted.sort_by(f64::total_cmp);
        // Between quantiles, so that a cut never falls on a level.
        let at: Vec<f64> = (1..LEVELS)
            .filter_map(|k| {
                let i = k * (sorted.len() - 1) / LEVELS;
                let next = sorted[i..].iter().find(|v| **v > sorted[i])?;
                Some(0.5 * (sorted[i] + next))
            })
            .collect();
        let mut at = at;
        at.dedup();
        let above = values.iter().map(|v| at.partition_point(|a| a < v) as u8).collect();
        (!at.is_empty()).then_some(Cut { covariate, at, above })
    };
    (0..covariate::TOLD.len()).filter_map(one).collect()
}

/// A part of the operating space.
#[derive(Clone)]
struct Part {
    bounds: BTreeMap<usize, [f64; 2]>,
    members: Vec<usize>,
    /// The part that it was cut from.
    parent: Option<usize>,
    /// Whether it has been cut itself.
    cut: bool,
}

/// Cuts the space where the chances of standing out differ most, until there are [`PARTS`] parts.
fn parts(cuts: &[Cut], chance: &[f64]) -> Vec<Part> {
    let whole =
        Part { bounds: BTreeMap::new(), members: (0..chance.len()).collect(), parent: None, cut: false };
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
            if gain > best.map_or(0.5, |b| b.0) {
                best = Some((gain, k, level));
            }
        }
    }
    best
}

/// The parts with the largest expected F1 together; where both halves of a part are named, the part itself.
fn named_parts<'a>(list: &'a [Part], chance: &[f64]) -> Vec<&'a Part> {
    let hits = |p: &Part| p.members.iter().map(|&i| chance[i]).sum::<f64>();
    let mean = |p: &Part| hits(p) / p.members.len() as f64;
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

fn region(
    bounds: &BTreeMap<usize, [f64; 2]>,
    passes: &[Condition],
    share: f64,
    p_value: Option<f64>,
) -> Region {
    let mut named = BTreeMap::new();
    let mut words = Vec::new();
    for (k, b) in bounds {
        let covariate = covariate::TOLD[*k];
        // An open side ends where the table does.
        let (low, high) = passes
            .iter()
            .filter_map(|p| covariate.of(p))
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, c), v| (a.min(v), c.max(v)));
        let slack = 0.02 * (high - low);
        let low = if low >= 0.0 { (low - slack).max(0.0) } else { low - slack };
        let high = high + slack;
        let low = if b[0].is_finite() { b[0] } else { low };
        let high = if b[1].is_finite() { b[1] } else { high };
        named.insert(covariate.name, [low, high]);
        let (word, (scale, unit)) = (covariate.words, covariate.shown);
        let (low, high) = (low * scale, high * scale);
        words.push(match (b[0].is_finite(), b[1].is_finite()) {
            (true, true) => format!("{word} {low:.3} to {high:.3} {unit}"),
            (true, false) => format!("{word} above {low:.3} {unit}"),
            _ => format!("{word} below {high:.3} {unit}"),
        });
    }
    let place = if words.is_empty() { "everywhere".to_string() } else { format!("at {}", words.join(", ")) };
    let p = match p_value {
        None => "no pass inside".to_string(),
        Some(p) if p < 1e-300 => "p < 1e-300".to_string(),
        Some(p) if p < 0.01 => format!("p = {p:.1e}"),
        Some(p) => format!("p = {p:.2}"),
    };
    Region {
        bounds: named,
        share_of_gap: share,
        p_value: p_value.unwrap_or(1.0),
        text: format!("{:.0} % of the gap lies {place} ({p})", 100.0 * share),
    }
}

/// Conditions of the same design: what can be set is drawn independently, from the table's levels or from between
/// two neighbouring ones; what comes together (time and temperature) stays together.
fn conditions_between(passes: &[Condition], count: usize) -> Vec<Condition> {
    let mut state = 0x5DEE_CE66_D2B7_4F1D_u64;
    let mut uniform = || (crate::held_out::split_mix(&mut state) >> 11) as f64 / (1u64 << 53) as f64;
    let levels = |value: fn(&Condition) -> f64| {
        let mut list: Vec<f64> = passes.iter().map(value).filter(|v| *v > 0.0).collect();
        list.sort_by(f64::total_cmp);
        list.dedup_by(|a, b| *a <= *b * 1.02);
        list
    };
    let (amplitudes, speeds, loads) =
        (levels(|p| p.amplitude.metres()), levels(|p| p.speed_m_s), levels(|p| p.normal_force_n));
    let between = |value: f64, levels: &[f64], u: (f64, f64)| {
        let k = levels.partition_point(|v| *v < value * 0.99);
        match (u.0 < 0.5, levels.get(k + 1)) {
            (true, Some(next)) if value > 0.0 => value * (next / value).powf(u.1),
            _ => value,
        }
    };
    let pick = |u: f64| passes[((u * passes.len() as f64) as usize).min(passes.len() - 1)];
    (0..count)
        .map(|_| Condition {
            amplitude: PeakToPeak::from_metres(between(
                pick(uniform()).amplitude.metres(),
                &amplitudes,
                (uniform(), uniform()),
            )),
            speed_m_s: between(pick(uniform()).speed_m_s, &speeds, (uniform(), uniform())),
            normal_force_n: between(pick(uniform()).normal_force_n, &loads, (uniform(), uniform())),
            frequency_hz: pick(uniform()).frequency_hz,
            direction: pick(uniform()).direction,
            position_m: pick(uniform()).position_m,
            ambient_pressure_pa: pick(uniform()).ambient_pressure_pa,
            ..pick(uniform())
        })
        .collect()
}
