//! All three of Eq. 2 at once: `E_sc`, `k` and `tau`, each with the profile of its likelihood.
//!
//! The misfit is not smooth and has valleys along which two quantities trade places, so it is scanned whole,
//! refined from the best valleys by a compass search that also steps along diagonals, and profiled: for each
//! value of one quantity the other two are searched again. A remark reports what the phases cannot show, from
//! the open ends of the profiles and from how the quantities move together within the likelihood.

use super::{CHI2_95, IdentifyError, Search, apart, check, row_sds};
use crate::phase::table::PhasePoint;
use models::PeakToPeak;
use models::ridge::phase_curves::{Skin, SkinGrid, retardation_place};
use models::root::halved;
use serde::Serialize;

/// One quantity with the other two free.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ProfileInterval {
    /// Best value.
    pub best: f64,
    /// 95 % profile interval; it may hold gaps, this is its hull.
    pub ci95: [f64; 2],
    /// Whether the interval ends within the range searched, below and above.
    pub closed: [bool; 2],
    /// Whether values within the interval are excluded.
    pub gaps: bool,
}

/// What the phases tell of all three.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct IdentifiedSkin {
    /// `E_sc` in Pa.
    pub young_modulus_pa: ProfileInterval,
    /// `k` over `E_sc`.
    pub penalty_ratio: ProfileInterval,
    /// `tau` in s.
    pub retardation_time_s: ProfileInterval,
    /// Chi-square at the best skin.
    pub chi2: f64,
    /// Least chi-square of elastic skin with the default penalty.
    pub chi2_elastic: f64,
    /// Eq. 2 at the best skin, degrees squared.
    pub objective_deg2: f64,
    /// How modulus and penalty, modulus and time, penalty and time move together within the likelihood, -1 to
    /// 1 (in their logarithms; the time as [`retardation_place`]).
    pub correlation: [f64; 3],
    /// What the data cannot tell, in words.
    pub cannot_tell: Vec<String>,
}

impl IdentifiedSkin {
    /// Whether elastic skin with the default penalty fits as well: freeing both gains no more than chance
    /// does once in a thousand. (Once in twenty would be too often: the mesh's error is not random.) The
    /// paper then takes the elastic case (section 3.3).
    pub fn elastic_will_do(&self) -> bool {
        self.chi2_elastic - self.chi2 < CHI2_999_TWO
    }
}

/// 99.9 % of chi-square with two degrees of freedom.
const CHI2_999_TWO: f64 = 13.816;
/// Values scanned along modulus, penalty and time.
const SCAN: [usize; 3] = [49, 13, 17];
/// Valleys refined in the whole space, and for each value of a profile.
const STARTS: [usize; 2] = [8, 3];
/// Least step of the compass search, as a share of an axis.
const LEAST_STEP: f64 = 2e-4;
/// Fewest rows for three quantities.
const FEWEST: usize = 6;
/// Two quantities that move together more than this cannot be separated.
const TOGETHER: f64 = 0.7;

/// Place of a skin: modulus, penalty, time, each 0 to 1 over the range searched.
type Place = [f64; 3];

/// The range searched: the ends of a grid.
struct Range {
    low: [f64; 3],
    high: [f64; 3],
}

impl Range {
    fn of(grid: &SkinGrid) -> Result<Range, IdentifyError> {
        let axes = [&grid.moduli_pa, &grid.penalty_ratios, &grid.retardation_times_s];
        let end = |pick: fn(&Vec<f64>) -> Option<&f64>| axes.map(|v| pick(v).copied().unwrap_or(f64::NAN));
        let (low, high) = (end(|v| v.first()), end(|v| v.last()));
        if !(low[0] > 0.0 && low[0] < high[0] && low[1] > 0.0 && low[1] < high[1] && low[2] >= 0.0)
            || low[2] >= high[2]
        {
            return Err(IdentifyError::Range(low[0], high[0]));
        }
        let coordinates = |v: [f64; 3]| [v[0].ln(), v[1].ln(), retardation_place(v[2])];
        Ok(Range { low: coordinates(low), high: coordinates(high) })
    }

    fn skin(&self, place: Place) -> Skin {
        let [e, k, tau] =
            std::array::from_fn(|axis| self.low[axis] + place[axis] * (self.high[axis] - self.low[axis]));
        Skin {
            young_modulus_pa: e.exp(),
            penalty_ratio: k.exp(),
            retardation_time_s: if place[2] == 0.0 && self.low[2] == 0.0 { 0.0 } else { 2e-6 * tau.sinh() },
        }
    }

    /// Elastic skin with the default penalty, at a place along the moduli.
    fn elastic(&self, share: f64) -> Place {
        let k = Skin::elastic(1.0).penalty_ratio.ln();
        [share, ((k - self.low[1]) / (self.high[1] - self.low[1])).clamp(0.0, 1.0), 0.0]
    }

    fn value(&self, axis: usize, share: f64) -> f64 {
        let mut place = [0.0; 3];
        place[axis] = share;
        let skin = self.skin(place);
        [skin.young_modulus_pa, skin.penalty_ratio, skin.retardation_time_s][axis]
    }
}

/// Finds the skin within the ends of `grid`; `elastic` is what [`super::identify`] found from the same rows.
///
/// # Errors
/// Bad rows or range, too few rows, or a model without numbers.
pub fn identify_skin(
    points: &[PhasePoint],
    grid: &SkinGrid,
    search: &Search,
    elastic: &super::Identified,
    phase: impl Fn(&Skin, PeakToPeak) -> f64,
) -> Result<IdentifiedSkin, IdentifyError> {
    check(points, search)?;
    if points.len() < FEWEST {
        return Err(IdentifyError::TooFew { found: points.len(), needed: FEWEST });
    }
    let range = Range::of(grid)?;
    let sds: Vec<f64> = row_sds(points, search.model_sd_deg)
        .into_iter()
        .map(|sd| sd.unwrap_or(elastic.typical_sd_deg.max(search.model_sd_deg).max(0.1)))
        .collect();
    let chi2 = |place: Place| -> f64 {
        let skin = range.skin(place);
        let rows = points.iter().zip(&sds);
        rows.map(|(p, sd)| (apart(phase(&skin, p.amplitude), p.phase_shift_deg) / sd).powi(2)).sum()
    };
    let scan = scan(&chi2);
    if scan.iter().all(|(_, at)| !at.is_finite()) {
        return Err(IdentifyError::NoModel);
    }
    let spacing: Place = std::array::from_fn(|axis| 1.0 / (SCAN[axis] - 1) as f64);
    let refined = |start: Place, free: [bool; 3]| compass(&chi2, start, spacing, free);
    let whole = best_valleys(&scan, |_| true, STARTS[0]).into_iter().map(|start| refined(start, [true; 3]));
    let mut best = whole.min_by(|a, b| a.1.total_cmp(&b.1)).ok_or(IdentifyError::NoModel)?;
    let curves: [Vec<(Place, f64)>; 3] = std::array::from_fn(|axis| {
        (0..SCAN[axis])
            .map(|n| {
                let share = n as f64 * spacing[axis];
                let here = |place: &Place| (place[axis] - share).abs() < 1e-9;
                let starts = best_valleys(&scan, here, STARTS[1]);
                // The way from the neighbourhood of the best is a start too.
                let mut from_best = best.0;
                from_best[axis] = share;
                starts
                    .into_iter()
                    .chain([from_best])
                    .map(|start| refined(start, std::array::from_fn(|other| other != axis)))
                    .min_by(|a, b| a.1.total_cmp(&b.1))
                    .unwrap_or((from_best, f64::INFINITY))
            })
            .collect()
    });
    for (place, least) in curves.iter().flatten() {
        if *least < best.1 {
            best = refined(*place, [true; 3]);
        }
    }
    let [e, k, tau] = std::array::from_fn(|axis| profile(&range, axis, &curves[axis], best.0[axis], best.1));
    let correlation = correlation(&scan, best.1);
    // Elastic skin with the default penalty, by the same model: a line through the range.
    let line = (0..SCAN[0]).map(|n| range.elastic(n as f64 * spacing[0])).map(|place| (place, chi2(place)));
    let line: Vec<(Place, f64)> = line.collect();
    let lowest = best_valleys(&line, |_| true, STARTS[0]).into_iter();
    let chi2_elastic =
        lowest.map(|start| refined(start, [true, false, false]).1).fold(f64::INFINITY, f64::min);
    let skin = range.skin(best.0);
    let objective_deg2 = super::objective_deg2(points, |w| phase(&skin, w));
    let mut found = IdentifiedSkin {
        young_modulus_pa: e,
        penalty_ratio: k,
        retardation_time_s: tau,
        chi2: best.1,
        chi2_elastic,
        objective_deg2,
        correlation,
        cannot_tell: Vec::new(),
    };
    found.cannot_tell = cannot_tell(&found, elastic);
    Ok(found)
}

fn scan(chi2: &impl Fn(Place) -> f64) -> Vec<(Place, f64)> {
    let place = |n: usize| -> Place {
        let of = [n / (SCAN[1] * SCAN[2]), n / SCAN[2] % SCAN[1], n % SCAN[2]];
        std::array::from_fn(|axis| of[axis] as f64 / (SCAN[axis] - 1) as f64)
    };
    (0..SCAN.iter().product()).map(place).map(|place| (place, chi2(place))).collect()
}

/// The lowest places of the scan among those that `wanted` picks, no two of them neighbours.
fn best_valleys(scan: &[(Place, f64)], wanted: impl Fn(&Place) -> bool, count: usize) -> Vec<Place> {
    let mut picked: Vec<&(Place, f64)> = scan.iter().filter(|(p, at)| at.is_finite() && wanted(p)).collect();
    picked.sort_by(|a, b| a.1.total_cmp(&b.1));
    let mut valleys: Vec<Place> = Vec::new();
    for (place, _) in picked {
        let far = |other: &Place| {
            (0..3).any(|axis| (place[axis] - other[axis]).abs() > 2.5 / (SCAN[axis] - 1) as f64)
        };
        if valleys.iter().all(far) {
            valleys.push(*place);
            if valleys.len() == count {
                break;
            }
        }
    }
    valleys
}

/// Walks downhill to all neighbours, diagonal ones too, with steps that halve where none is lower.
fn compass(chi2: &impl Fn(Place) -> f64, start: Place, spacing: Place, free: [bool; 3]) -> (Place, f64) {
    let mut at = (start, chi2(start));
    let mut scale = 0.5;
    while scale > LEAST_STEP {
        let mut lowest = at;
        for direction in 0..27_i32 {
            let steps = [direction / 9 - 1, direction / 3 % 3 - 1, direction % 3 - 1];
            if steps == [0; 3] || (0..3).any(|axis| steps[axis] != 0 && !free[axis]) {
                continue;
            }
            let to: Place = std::array::from_fn(|axis| {
                (at.0[axis] + f64::from(steps[axis]) * scale * spacing[axis]).clamp(0.0, 1.0)
            });
            let there = chi2(to);
            if there < lowest.1 {
                lowest = (to, there);
            }
        }
        if lowest.1 < at.1 { at = lowest } else { scale *= 0.5 }
    }
    at
}

/// The interval where the profile lies within 95 %, its ends by straight lines between the values scanned.
fn profile(range: &Range, axis: usize, curve: &[(Place, f64)], best: f64, least: f64) -> ProfileInterval {
    let share = |n: usize| n as f64 / (curve.len() - 1) as f64;
    let limit = least + CHI2_95;
    let (mut low, mut high) = (best, best);
    for (n, (_, at)) in curve.iter().enumerate() {
        if *at <= limit {
            low = low.min(share(n));
            high = high.max(share(n));
        }
    }
    // From the outermost value inside towards the first outside, which stands at the crossing's other side.
    let value_at = |x: f64| {
        let n = ((x * (curve.len() - 1) as f64) as usize).min(curve.len() - 2);
        let part = x * (curve.len() - 1) as f64 - n as f64;
        curve[n].1 + part * (curve[n + 1].1 - curve[n].1)
    };
    let crossing = |inside: f64, outside: f64| halved([inside, outside], 40, |x| value_at(x) <= limit)[0];
    let spacing = share(1);
    let low_end = if low > 0.0 { crossing(low, (low - spacing).max(0.0)) } else { 0.0 };
    let high_end = if high < 1.0 { crossing(high, (high + spacing).min(1.0)) } else { 1.0 };
    ProfileInterval {
        best: range.value(axis, best),
        ci95: [range.value(axis, low_end), range.value(axis, high_end)],
        closed: [low_end > 1e-6, high_end < 1.0 - 1e-6],
        gaps: curve.iter().enumerate().any(|(n, (_, at))| share(n) > low && share(n) < high && *at > limit),
    }
}

/// Correlations of places weighted by their likelihood.
fn correlation(scan: &[(Place, f64)], least: f64) -> [f64; 3] {
    let weighted = scan.iter().filter(|(_, at)| at.is_finite());
    let weighted: Vec<(&Place, f64)> = weighted.map(|(p, at)| (p, (0.5 * (least - at)).exp())).collect();
    let total: f64 = weighted.iter().map(|(_, w)| w).sum();
    let mean = |of: &dyn Fn(&Place) -> f64| weighted.iter().map(|(p, w)| w * of(p)).sum::<f64>() / total;
    let means: [f64; 3] = std::array::from_fn(|axis| mean(&|p| p[axis]));
    let covariance = |a: usize, b: usize| mean(&|p| (p[a] - means[a]) * (p[b] - means[b]));
    [(0, 1), (0, 2), (1, 2)].map(|(a, b)| {
        let scale = (covariance(a, a) * covariance(b, b)).sqrt();
        if scale > 0.0 { covariance(a, b) / scale } else { 0.0 }
    })
}

fn cannot_tell(found: &IdentifiedSkin, elastic: &super::Identified) -> Vec<String> {
    let mut words = Vec::new();
    let (k, tau, e) = (&found.penalty_ratio, &found.retardation_time_s, &found.young_modulus_pa);
    match k.closed {
        [false, false] => words.push("the penalty at all: any of the range fits".into()),
        [true, false] => words.push(format!(
            "a penalty of {:.2} E_sc from a stiffer one: beyond that the contact no longer gives",
            k.ci95[0]
        )),
        [false, true] => words.push(format!("the lower end of the penalty: {:.2} E_sc or less", k.ci95[1])),
        [true, true] => {}
    }
    match tau.closed {
        [false, false] if tau.gaps => words.push(
            "no relaxation from one much slower than a cycle: skin with half the modulus is as stiff then"
                .into(),
        ),
        [false, false] => words.push("the retardation time at all: any of the range fits".into()),
        [false, true] => words.push(format!(
            "a retardation time up to {:.1e} s from none: the relaxation keeps up with the vibration",
            tau.ci95[1]
        )),
        [true, false] => words.push(format!(
            "a retardation time of {:.1e} s from a longer one: within a cycle nothing relaxes",
            tau.ci95[0]
        )),
        [true, true] => {}
    }
    let free = e.ci95[1] / e.ci95[0];
    let fixed = elastic.ci95_pa[1] / elastic.ci95_pa[0];
    if free.ln() > 1.5 * fixed.ln() {
        words.push(format!(
            "the modulus as well as for elastic skin: with penalty and time free it is {:.3e} to {:.3e} Pa",
            e.ci95[0], e.ci95[1]
        ));
    }
    let pairs = ["modulus and penalty", "modulus and retardation time", "penalty and retardation time"];
    for (pair, r) in pairs.into_iter().zip(found.correlation) {
        if r.abs() > TOGETHER {
            let how = if r < 0.0 { "one up and the other down" } else { "both up or both down" };
            words.push(format!("{pair} apart: {how} leaves the phases as they are (correlation {r:.2})"));
        }
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identify::identify;

    fn grid() -> SkinGrid {
        SkinGrid::free((5e6, 100e6), 5)
    }

    /// A phase curve whose onset moves with modulus and contact and whose plateau moves with the time; its
    /// foot has a corner.
    fn toy(skin: &Skin, w: PeakToPeak) -> f64 {
        let series = skin.young_modulus_pa * skin.penalty_ratio / (skin.penalty_ratio + 0.3);
        let omega_tau = 2.0 * std::f64::consts::PI * 27_500.0 * skin.retardation_time_s;
        let stiffer = 1.0 + omega_tau.powi(2) / (1.0 + omega_tau.powi(2));
        let onset = 1e-6 * (28e6 / (series * stiffer)).powf(0.3);
        let x = w.metres() / onset - 1.0;
        let lag = 12.0 * omega_tau / (1.0 + omega_tau.powi(2));
        if x <= 0.0 { 0.0 } else { 4.0 + lag + 90.0 * (1.0 - (-2.0 * x).exp()) }
    }

    fn rows(skin: &Skin) -> Vec<PhasePoint> {
        (1..=16)
            .map(|k| PeakToPeak::from_metres(0.2e-6 * f64::from(k)))
            .map(|amplitude| PhasePoint {
                amplitude,
                phase_shift_deg: toy(skin, amplitude),
                phase_shift_sd_deg: Some(2.0),
                repeats: None,
                condition: None,
                frequency_hz: None,
                normal_force_n: None,
            })
            .collect()
    }

    const SEARCH: Search = Search { lowest_pa: 5e6, highest_pa: 100e6, model_sd_deg: 0.0 };

    fn found(skin: &Skin) -> IdentifiedSkin {
        let data = rows(skin);
        let elastic = identify(&data, &SEARCH, |e, w| toy(&Skin::elastic(e), w)).expect("identified");
        identify_skin(&data, &grid(), &SEARCH, &elastic, toy).expect("identified")
    }

    fn holds(profile: &ProfileInterval, truth: f64) -> bool {
        profile.ci95[0] <= truth * 1.001 && truth * 0.999 <= profile.ci95[1]
    }

    #[test]
    fn exact_rows_are_fitted_and_every_profile_holds_the_truth() {
        for (e, k, tau) in [(28.3e6, 3.0, 0.0), (20e6, 0.3, 0.0), (40e6, 1.0, 5e-6), (15e6, 2.0, 2e-5)] {
            let skin = Skin { young_modulus_pa: e, penalty_ratio: k, retardation_time_s: tau };
            let found = found(&skin);
            assert!(found.chi2 < 0.05, "{skin:?}: {found:?}");
            assert!(holds(&found.young_modulus_pa, e), "{skin:?}: {found:?}");
            assert!(holds(&found.penalty_ratio, k), "{skin:?}: {found:?}");
            assert!(holds(&found.retardation_time_s, tau), "{skin:?}: {found:?}");
        }
    }

    #[test]
    fn modulus_and_penalty_that_trade_places_are_said_to() {
        // Here only k/(k + 0.3) times the modulus matters, so a soft contact and a stiff skin are one.
        let found = found(&Skin { young_modulus_pa: 20e6, penalty_ratio: 0.5, retardation_time_s: 0.0 });
        assert!(found.correlation[0] < -TOGETHER, "{found:?}");
        assert!(found.cannot_tell.iter().any(|w| w.starts_with("modulus and penalty apart")), "{found:?}");
        let width = found.young_modulus_pa.ci95[1] / found.young_modulus_pa.ci95[0];
        assert!(width > 2.0, "{found:?}");
    }

    #[test]
    fn relaxing_skin_shows_and_elastic_skin_will_do_where_it_is_elastic() {
        let relaxing = found(&Skin { young_modulus_pa: 20e6, penalty_ratio: 3.0, retardation_time_s: 6e-6 });
        assert!(!relaxing.elastic_will_do() && relaxing.retardation_time_s.closed[0], "{relaxing:?}");
        let elastic = found(&Skin::elastic(28.3e6));
        assert!(elastic.elastic_will_do() && !elastic.retardation_time_s.closed[0], "{elastic:?}");
        // Relaxation much slower than a cycle is elastic skin again, of half the modulus; in between is excluded.
        assert!(elastic.retardation_time_s.gaps, "{elastic:?}");
        assert!(elastic.cannot_tell.iter().any(|w| w.starts_with("no relaxation")), "{elastic:?}");
    }

    #[test]
    fn too_few_rows_and_upside_down_ranges_are_refused() {
        let data = rows(&Skin::elastic(28.3e6));
        let elastic = identify(&data, &SEARCH, |e, w| toy(&Skin::elastic(e), w)).expect("identified");
        let few = identify_skin(&data[..5], &grid(), &SEARCH, &elastic, toy);
        assert_eq!(few, Err(IdentifyError::TooFew { found: 5, needed: 6 }));
        let upside_down = SkinGrid { penalty_ratios: vec![3.0, 0.1], ..grid() };
        let refused = identify_skin(&data, &upside_down, &SEARCH, &elastic, toy);
        assert!(matches!(refused, Err(IdentifyError::Range(..))));
        let silent = identify_skin(&data, &grid(), &SEARCH, &elastic, |_, _| f64::NAN);
        assert_eq!(silent, Err(IdentifyError::NoModel));
    }
}
