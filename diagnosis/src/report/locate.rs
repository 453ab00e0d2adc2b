//! Where the gap is: conditions, and the part of the rig. docs/diagnosis/model.md, section 10.

mod partition;

use crate::data::{RigFile, range};
use crate::hypotheses::Fitted;
use crate::report::predict::{Forecast, Model, forecast};
use crate::verdict::Decision;
use effects::Location;
use models::{Condition, PeakToPeak, covariate};
use partition::{cuts, levels, named_parts, parts};
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::collections::BTreeMap;

/// A box of the operating space with its share of the gap.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct GapRegion {
    /// Bounds of the covariates that are bounded.
    pub bounds: BTreeMap<&'static str, [f64; 2]>,
    /// Share of the gap's square inside, by the model, over the operating space of the design.
    pub share_of_gap: f64,
    /// Family-wise p-value of as much excess in any box, were there no gap.
    pub p_value: f64,
    /// In words.
    pub text: String,
    /// Whether a pass lies inside; the text says where none does.
    #[serde(skip)]
    pub measured: bool,
}

/// Probability by place; `unknown` is the open set's.
pub fn ledger(fitted: &Fitted, decision: &Decision) -> BTreeMap<&'static str, f64> {
    let mut map: BTreeMap<_, f64> = Location::ALL.iter().map(|place| (place.name(), 0.0)).collect();
    map.insert("unknown", decision.open_set);
    for (members, p) in decision.stated(fitted) {
        for &e in members {
            *map.entry(effects::at(e).place.name()).or_insert(0.0) += p / members.len() as f64;
        }
    }
    let total: f64 = map.values().sum();
    if total > 0.0 {
        map.values_mut().for_each(|v| *v /= total);
    }
    map
}

/// Conditions at which the verdict's model predicts its gap.
const PREDICTED: usize = 10_000;
/// Expected number of passes that stand out from which there is a region.
const LEAST_PASSES: f64 = 3.0;

/// Boxes that together hold the conditions at which the verdict's model says that the gap stands out of the noise.
///
/// The model also predicts between the passes of the table, in all combinations of its covariates: a box
/// fitted to the passes alone would end where the next pass happens to be. A condition counts by its
/// probability of standing out. The space is cut into parts, each time where that probability differs most.
/// The named parts are those that together have the largest expected F1.
pub fn regions(fitted: &Fitted, rig: &RigFile, model: &Model) -> Vec<GapRegion> {
    let problem = &fitted.problem;
    let n = problem.len();
    let mut places = problem.passes.clone();
    places.extend(conditions_between(&problem.passes, PREDICTED));
    let forecasts = forecast(fitted, rig, model, &places);
    let chance: Vec<f64> = forecasts.iter().map(|f| stands_out(f, problem.constants.stands_out_sd)).collect();
    if chance[..n].iter().sum::<f64>() < LEAST_PASSES {
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
        .map(|i| (problem.lateral[i] - fitted.baseline.prediction[i]).powi(2) / problem.whole_variance(i))
        .collect();
    let cuts = cuts(&problem.passes, &places);
    let tries: f64 = cuts.iter().map(|c| 2.0 * c.at.len() as f64).sum::<f64>().max(1.0);
    let mut found: Vec<GapRegion> = named_parts(&parts(&cuts, &chance), &chance)
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

/// Probability that the gap at a condition exceeds so many deviations of a pass.
fn stands_out(f: &Forecast, deviations: f64) -> f64 {
    let spread = (f.corrected_sd.powi(2) - f.scatter_sd.powi(2)).max(0.0).sqrt();
    let above = (f.corrected - f.recalibrated).abs() - deviations * f.scatter_sd;
    0.5 * statrs::function::erf::erfc(-above / (spread.max(1e-12) * std::f64::consts::SQRT_2))
}

fn region(
    bounds: &BTreeMap<usize, [f64; 2]>,
    passes: &[Condition],
    share: f64,
    p_value: Option<f64>,
) -> GapRegion {
    let mut named = BTreeMap::new();
    let mut words = Vec::new();
    for (k, b) in bounds {
        let covariate = covariate::COVARIATES[*k];
        // An open side ends where the table does.
        let (word, (scale, unit)) = (covariate.words, covariate.shown);
        let seen: Vec<f64> = passes.iter().filter_map(|p| covariate.of(p)).collect();
        let [low, high] = range(seen.iter().copied());
        let slack = 0.02 * (high - low);
        let low = if low >= 0.0 { (low - slack).max(0.0) } else { low - slack };
        let high = high + slack;
        let low = if b[0].is_finite() { b[0] } else { low };
        let high = if b[1].is_finite() { b[1] } else { high };
        named.insert(covariate.name, [low, high]);
        let bound = |value: f64, end: f64| {
            let seen: Vec<f64> = seen.iter().map(|v| v * scale).collect();
            short(value * scale, &seen, end * scale)
        };
        let words_of = match (b[0].is_finite(), b[1].is_finite()) {
            (forward, _) if covariate.name == covariate::DIRECTION.name => {
                ["backward", "forward"][usize::from(forward)].into()
            }
            (true, true) => format!("{word} {} to {} {unit}", bound(low, high), bound(high, low)),
            (true, false) => format!("{word} above {} {unit}", bound(low, b[1])),
            _ => format!("{word} below {} {unit}", bound(high, b[0])),
        };
        words.push(words_of.trim_end().to_string());
    }
    let place = if words.is_empty() { "everywhere".to_string() } else { words.join(", ") };
    let percent = 100.0 * share;
    let text = match p_value {
        // A share of what was measured would be one of nothing.
        None => format!(
            "nothing was measured at {place}; only the verdict's model puts {percent:.0} % of its gap there"
        ),
        // The test's distribution is not known so far out: no smaller value is printed.
        Some(p) if p < 1e-6 => format!("{percent:.0} % of the gap: {place} (p < 1e-6)"),
        Some(p) if p < 0.01 => format!("{percent:.0} % of the gap: {place} (p = {p:.1e})"),
        Some(p) => format!("{percent:.0} % of the gap: {place} (p = {p:.2})"),
    };
    let (p_value, measured) = (p_value.unwrap_or(1.0), p_value.is_some());
    GapRegion { bounds: named, share_of_gap: share, p_value, text, measured }
}

/// A bound with two significant digits and all digits before its point; with a third one where two could
/// move it past a pass that was `seen`, and with as many as part it from the region's other `end`.
fn short(value: f64, seen: &[f64], end: f64) -> String {
    let decimals = 1 - value.abs().max(1e-9).log10().floor() as i32;
    let end = (end - value).abs();
    let mut nearest = seen.iter().map(|v| (v - value).abs()).fold(end, f64::min);
    for decimals in decimals.clamp(0, 9)..9 {
        let text = format!("{value:.*}", decimals as usize);
        let moved = text.parse::<f64>().map_or(0.0, |printed| (printed - value).abs());
        if moved < 0.5 * nearest || moved == 0.0 {
            return trimmed(&text);
        }
        nearest = end;
    }
    trimmed(&format!("{value:.9}"))
}

/// A number without zeros behind its point.
fn trimmed(text: &str) -> String {
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text.into() }
}

/// Conditions of the same design: what can be set is drawn independently, from the table's levels or from
/// between two neighbouring ones; what comes together (time and temperature) stays together.
fn conditions_between(passes: &[Condition], count: usize) -> Vec<Condition> {
    let mut state = 0x5DEE_CE66_D2B7_4F1D_u64;
    let mut uniform = || (crate::random::split_mix(&mut state) >> 11) as f64 / (1u64 << 53) as f64;
    let levels = |value: fn(&Condition) -> f64| -> Vec<f64> {
        levels(passes.iter().map(value).collect()).iter().map(|[low, _]| *low).collect()
    };
    let (amplitudes, speeds, loads) =
        (levels(|p| p.amplitude.metres()), levels(|p| p.speed_m_s), levels(|p| p.normal_force_n));
    let between = |value: f64, levels: &[f64], u: (f64, f64)| match (
        u.0 < 0.5,
        levels.get(levels.partition_point(|low| *low <= value)),
    ) {
        (true, Some(next)) if value > 0.0 => value * (next / value).powf(u.1),
        _ => value,
    };
    let pick = |u: f64| passes[((u * passes.len() as f64) as usize).min(passes.len() - 1)];
    (0..count)
        .map(|_| {
            let w = between(pick(uniform()).amplitude.metres(), &amplitudes, (uniform(), uniform()));
            Condition {
                amplitude: PeakToPeak::from_metres(w),
                speed_m_s: between(pick(uniform()).speed_m_s, &speeds, (uniform(), uniform())),
                normal_force_n: between(pick(uniform()).normal_force_n, &loads, (uniform(), uniform())),
                frequency_hz: pick(uniform()).frequency_hz,
                direction: pick(uniform()).direction,
                position_m: pick(uniform()).position_m,
                ambient_pressure_pa: pick(uniform()).ambient_pressure_pa,
                ..pick(uniform())
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A part of the operating space without a pass is no share of what was measured, and its text does not say so.
    #[test]
    fn a_share_of_the_gap_is_one_of_passes() {
        let passes =
            [1e-6, 4e-6].map(|w| Condition { amplitude: PeakToPeak::from_metres(w), ..Condition::paper() });
        let amplitude = covariate::COVARIATES.iter().position(|c| c.name == "amplitude_pp_m").unwrap();
        let bounds = BTreeMap::from([(amplitude, [2e-6, 3e-6])]);
        let empty = region(&bounds, &passes, 0.08, None).text;
        assert_eq!(
            empty,
            "nothing was measured at amplitude 2 to 3 \u{b5}m; only the verdict's model puts 8 % of its gap there"
        );
        let seen = region(&bounds, &passes, 0.08, Some(0.002)).text;
        assert_eq!(seen, "8 % of the gap: amplitude 2 to 3 \u{b5}m (p = 2.0e-3)");
    }
}
