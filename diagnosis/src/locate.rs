//! Where: the parts of the operating space that carry the gap, and the part of the rig.

use crate::hypotheses::Fitted;
use crate::shrink::full_friction;
use effects::{Operating, Place, library};
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::collections::BTreeMap;

/// A box of the operating space with its share of the gap.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Region {
    /// Bounds of the covariates that are bounded.
    pub bounds: BTreeMap<&'static str, [f64; 2]>,
    /// Share of the gap's square inside.
    pub share_of_gap: f64,
    /// Family-wise p-value of as much excess in any box, were there no gap.
    pub p_value: f64,
    /// In words.
    pub text: String,
}

/// Probability by place; `unknown` is the open set's.
pub fn ledger(fitted: &Fitted, probabilities: &[f64], unknown: f64) -> BTreeMap<&'static str, f64> {
    let mut map: BTreeMap<&'static str, f64> =
        ["contact", "finger", "plate", "instrument"].into_iter().map(|k| (k, 0.0)).collect();
    map.insert("unknown", unknown);
    for (c, p) in fitted.candidates.iter().zip(probabilities) {
        for &e in &c.effects {
            let place = match library()[e].place() {
                Place::Contact => "contact",
                Place::Finger => "finger",
                Place::Plate => "plate",
                Place::Instrument => "instrument",
            };
            *map.get_mut(place).expect("every place is in the map") += p / c.effects.len() as f64;
        }
    }
    let total: f64 = map.values().sum();
    if total > 0.0 {
        map.values_mut().for_each(|v| *v /= total);
    }
    map
}

type Covariate = (&'static str, fn(&Operating) -> f64);

fn covariates() -> [Covariate; 9] {
    [
        ("amplitude_pp_m", |p| p.amplitude_pp_m),
        ("speed_m_s", |p| p.speed_m_s),
        ("normal_force_n", |p| p.normal_force_n),
        ("frequency_hz", |p| p.frequency_hz),
        ("direction", |p| p.direction),
        ("position_m", |p| p.position_m),
        ("time_s", |p| p.time_s),
        ("ambient_pressure_pa", |p| p.ambient_pressure_pa.unwrap_or(f64::NAN)),
        ("temperature_c", |p| p.temperature_c.unwrap_or(f64::NAN)),
    ]
}

/// Deviations by which the estimated gap must stand out at a pass to count.
const STANDS_OUT: f64 = 2.0;
/// Largest number of boxes, and of cuts of one box.
const BOXES: usize = 3;
const CUTS: usize = 5;
/// Levels at which a covariate may be cut.
const LEVELS: usize = 9;

/// Boxes that together hold the passes where the estimated gap (N) stands out of the noise.
pub fn regions(fitted: &Fitted, gap: &[f64]) -> Vec<Region> {
    let problem = &fitted.problem;
    let n = problem.len();
    let full = full_friction(problem);
    let wanted: Vec<bool> = (0..n).map(|i| gap[i].abs() > STANDS_OUT * problem.variance[i].sqrt()).collect();
    let count = wanted.iter().filter(|w| **w).count();
    if count < 3 {
        return Vec::new();
    }
    let weight: Vec<f64> = (0..n).map(|i| (gap[i] / full[i]).powi(2)).collect();
    let total: f64 = weight.iter().sum();
    let residual: Vec<f64> = (0..n)
        .map(|i| (problem.lateral[i] - fitted.none.prediction[i]).powi(2) / problem.variance[i])
        .collect();
    let cuts: Vec<(usize, Vec<f64>)> = covariates()
        .iter()
        .enumerate()
        .filter_map(|(k, (_, value))| {
            let mut levels: Vec<f64> = problem.passes.iter().map(value).collect();
            if levels.iter().any(|v| v.is_nan()) {
                return None;
            }
            levels.sort_by(f64::total_cmp);
            let (low, high) = (levels[0], levels[n - 1]);
            levels.dedup_by(|a, b| (*a - *b).abs() <= 0.02 * (high - low) + 1e-15);
            if levels.len() < 2 {
                return None;
            }
            let step = levels.len().div_ceil(LEVELS).max(1);
            // Cut half way between neighbouring levels.
            let at: Vec<f64> = levels.windows(2).step_by(step).map(|w| 0.5 * (w[0] + w[1])).collect();
            Some((k, at))
        })
        .collect();
    let tries: f64 = cuts.iter().map(|(_, at)| 2.0 * at.len() as f64).sum::<f64>().max(1.0);
    let mut covered = vec![false; n];
    let mut found: Vec<Region> = Vec::new();
    let score = |inside: &dyn Fn(usize) -> bool, covered: &[bool]| -> f64 {
        let (mut hit, mut picked) = (0.0, 0.0);
        for i in 0..n {
            if covered[i] || inside(i) {
                picked += 1.0;
                if wanted[i] {
                    hit += 1.0;
                }
            }
        }
        2.0 * hit / (picked + count as f64)
    };
    let mut reached = 0.0;
    for _ in 0..BOXES {
        let mut bounds: BTreeMap<usize, [f64; 2]> = BTreeMap::new();
        let mut members: Vec<bool> = vec![true; n];
        let mut best = score(&|_| true, &covered);
        for _ in 0..CUTS {
            let mut step: Option<(f64, usize, bool, f64)> = None;
            for (k, at) in &cuts {
                let value = covariates()[*k].1;
                for &cut in at {
                    for upper in [false, true] {
                        let keep = |i: usize| members[i] && ((value(&problem.passes[i]) > cut) == upper);
                        let s = score(&keep, &covered);
                        if s > step.map_or(best + 0.005, |(b, ..)| b) {
                            step = Some((s, *k, upper, cut));
                        }
                    }
                }
            }
            let Some((s, k, upper, cut)) = step else { break };
            best = s;
            let value = covariates()[k].1;
            for i in 0..n {
                members[i] &= (value(&problem.passes[i]) > cut) == upper;
            }
            let entry = bounds.entry(k).or_insert([f64::NEG_INFINITY, f64::INFINITY]);
            if upper { entry[0] = entry[0].max(cut) } else { entry[1] = entry[1].min(cut) }
        }
        if best < reached + 0.02 {
            break;
        }
        reached = best;
        let inside: Vec<usize> = (0..n).filter(|&i| members[i]).collect();
        if inside.len() < 3 {
            break;
        }
        let excess: f64 = inside.iter().map(|&i| residual[i]).sum();
        let tail = ChiSquared::new(inside.len() as f64).map_or(1.0, |d| d.sf(excess));
        let depth = bounds.len().max(1) as i32;
        let share = inside.iter().map(|&i| weight[i]).sum::<f64>() / total.max(1e-300);
        let mut named = BTreeMap::new();
        let mut words = Vec::new();
        for (k, b) in &bounds {
            let (name, value) = covariates()[*k];
            let (low, high) = inside
                .iter()
                .map(|&i| value(&problem.passes[i]))
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, c), v| (a.min(v), c.max(v)));
            let low = if b[0].is_finite() { b[0] } else { low };
            let high = if b[1].is_finite() { b[1] } else { high };
            named.insert(name, [low, high]);
            words.push(match (b[0].is_finite(), b[1].is_finite()) {
                (true, true) => format!("{name} between {low:.4e} and {high:.4e}"),
                (true, false) => format!("{name} above {low:.4e}"),
                _ => format!("{name} below {high:.4e}"),
            });
        }
        let p_value = (tail * tries.powi(depth)).min(1.0);
        let place = if words.is_empty() { "everywhere".to_string() } else { words.join(" and ") };
        found.push(Region {
            bounds: named,
            share_of_gap: share,
            p_value,
            text: format!("{:.0} % of the gap lies at {place} (p = {p_value:.1e})", 100.0 * share),
        });
        for i in inside {
            covered[i] = true;
        }
    }
    found
}
