//! Inverse analysis of section 3.3, by Eq. 2: here the stratum corneum's modulus, taken as elastic as the
//! paper does in the end; in [`skin`] modulus, penalty and retardation time together.
//!
//! The objective is not smooth (contact is lost, periods double), so it is scanned on a fine grid over the
//! whole range, which is a multi-start of its own, and only then refined in the best valleys. The uncertainty
//! is the profile of the likelihood: all moduli whose chi-square lies within 3.84 of the least (95 %).
//! The model of the phase shift is handed in: the surrogate for speed, or the finite element model itself.

pub mod skin;

use crate::phase::table::PhasePoint;
use crate::regression::ends;
use models::PeakToPeak;
use serde::Serialize;

/// The range searched, and what is known of the model's own error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Search {
    /// Least modulus in Pa.
    pub lowest_pa: f64,
    /// Greatest modulus in Pa.
    pub highest_pa: f64,
    /// Standard error of the model's phase in degrees (the surrogate's interpolation, the mesh).
    pub model_sd_deg: f64,
}

/// What the phases tell of the modulus.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Identified {
    /// Best modulus in Pa.
    pub young_modulus_pa: f64,
    /// 95 % profile interval in Pa; it may hold gaps, this is its hull.
    pub ci95_pa: [f64; 2],
    /// Whether the interval ends within the range searched, below and above.
    pub closed: [bool; 2],
    /// Eq. 2 at the best modulus, degrees squared.
    pub objective_deg2: f64,
    /// Root mean square and greatest of the residuals there, degrees.
    pub residual_deg: [f64; 2],
    /// Chi-square at the best modulus.
    pub chi2: f64,
    /// Rows used.
    pub points: usize,
    /// Standard uncertainty of a row in degrees, given or estimated from the residuals.
    pub typical_sd_deg: f64,
    /// Whether the rows' uncertainty was estimated from the residuals because none was given.
    pub sd_estimated: bool,
    /// What the data cannot tell, in words.
    pub cannot_tell: Vec<String>,
}

/// Why nothing was identified.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the message of an error says what its fields are")]
pub enum IdentifyError {
    /// Too little data.
    #[error("{found} usable rows: at least {needed} are needed")]
    TooFew { found: usize, needed: usize },
    /// A value that makes no sense.
    #[error("row {row}: {what} is {value}: must be {range}")]
    Row { row: usize, what: &'static str, value: f64, range: &'static str },
    /// A range that makes no sense.
    #[error("moduli from {0} to {1} Pa do not make a range")]
    Range(f64, f64),
    /// The model gave no number anywhere.
    #[error("the model gave no phase for any modulus of the range")]
    NoModel,
}

/// Grid over the range of moduli: fine enough that no valley is stepped over.
const GRID: usize = 600;
/// Valleys that are refined.
const STARTS: usize = 5;
/// 95 % of chi-square with one degree of freedom.
const CHI2_95: f64 = 3.841;
const FEWEST: usize = 4;

/// Difference of two phases in degrees, -180 to 180.
fn apart(a: f64, b: f64) -> f64 {
    (a - b + 180.0).rem_euclid(360.0) - 180.0
}

/// Eq. 2: the sum of squared differences in degrees squared.
pub fn objective_deg2(points: &[PhasePoint], mut phase: impl FnMut(PeakToPeak) -> f64) -> f64 {
    points.iter().map(|p| apart(phase(p.amplitude), p.phase_shift_deg).powi(2)).sum()
}

/// Finds the modulus. `phase(modulus in Pa, amplitude)` gives the model's phase shift in degrees.
///
/// # Errors
/// Bad rows or range, too few rows, or a model without numbers.
pub fn identify(
    points: &[PhasePoint],
    search: &Search,
    phase: impl Fn(f64, PeakToPeak) -> f64,
) -> Result<Identified, IdentifyError> {
    check(points, search)?;
    // Rows without an uncertainty of their own share one, found from the residuals below.
    let given = row_sds(points, search.model_sd_deg);
    let sd_estimated = given.iter().any(Option::is_none);
    let chi2 = |modulus: f64, common_sd: f64| -> f64 {
        let rows = points.iter().zip(&given);
        rows.map(|(p, sd)| {
            (apart(phase(modulus, p.amplitude), p.phase_shift_deg) / sd.unwrap_or(common_sd)).powi(2)
        })
        .sum()
    };
    let ratio = (search.highest_pa / search.lowest_pa).ln();
    let modulus = |k: f64| search.lowest_pa * (ratio * k / GRID as f64).exp();
    let best_of = |common_sd: f64| -> Option<(f64, f64)> {
        let scan: Vec<f64> = (0..=GRID).map(|k| chi2(modulus(k as f64), common_sd)).collect();
        let mut valleys: Vec<usize> = (0..=GRID)
            .filter(|k| {
                let at = scan[*k];
                at.is_finite() && (*k == 0 || at <= scan[k - 1]) && (*k == GRID || at <= scan[k + 1])
            })
            .collect();
        valleys.sort_by(|a, b| scan[*a].total_cmp(&scan[*b]));
        let refined = valleys.into_iter().take(STARTS).map(|k| {
            let (mut low, mut high) = ((k as f64 - 1.0).max(0.0), (k as f64 + 1.0).min(GRID as f64));
            for _ in 0..40 {
                let (a, b) = (low + 0.382 * (high - low), low + 0.618 * (high - low));
                if chi2(modulus(a), common_sd) < chi2(modulus(b), common_sd) { high = b } else { low = a }
            }
            let middle = 0.5 * (low + high);
            let at_middle = chi2(modulus(middle), common_sd);
            if at_middle < scan[k] { (modulus(middle), at_middle) } else { (modulus(k as f64), scan[k]) }
        });
        refined.min_by(|a, b| a.1.total_cmp(&b.1))
    };
    let mut common_sd = 1.0;
    let (mut best, mut least) = best_of(common_sd).ok_or(IdentifyError::NoModel)?;
    if sd_estimated {
        // Two rounds settle it: the best modulus hardly depends on the common uncertainty.
        for _ in 0..2 {
            let square = objective_deg2(points, |w| phase(best, w));
            common_sd = (square / (points.len() as f64 - 1.0)).sqrt().max(search.model_sd_deg).max(0.1);
            (best, least) = best_of(common_sd).ok_or(IdentifyError::NoModel)?;
        }
    }
    let moduli = (0..=GRID).map(|k| modulus(k as f64)).chain([best]);
    let [low, high] = ends(moduli.filter(|e| chi2(*e, common_sd) <= least + CHI2_95));
    let closed = [low > search.lowest_pa * 1.000_001, high < search.highest_pa * 0.999_999];
    let sds: Vec<f64> = given.iter().map(|sd| sd.unwrap_or(common_sd)).collect();
    let residuals: Vec<f64> =
        points.iter().map(|p| apart(phase(best, p.amplitude), p.phase_shift_deg).abs()).collect();
    let square: f64 = residuals.iter().map(|r| r * r).sum();
    Ok(Identified {
        young_modulus_pa: best,
        ci95_pa: [low, high],
        closed,
        objective_deg2: square,
        residual_deg: [
            (square / points.len() as f64).sqrt(),
            residuals.iter().fold(0.0, |a: f64, b| a.max(*b)),
        ],
        chi2: least,
        points: points.len(),
        typical_sd_deg: sds.iter().sum::<f64>() / sds.len() as f64,
        sd_estimated,
        cannot_tell: cannot_tell(closed, least, points.len(), sd_estimated),
    })
}

/// Standard uncertainty of each row, the model's included, where the row gives one.
fn row_sds(points: &[PhasePoint], model_sd_deg: f64) -> Vec<Option<f64>> {
    let of_mean =
        |p: &PhasePoint| Some(p.phase_shift_sd_deg? / f64::from(p.repeats.unwrap_or(1).max(1)).sqrt());
    points.iter().map(|p| of_mean(p).map(|sd| sd.hypot(model_sd_deg))).collect()
}

fn cannot_tell(closed: [bool; 2], chi2: f64, points: usize, sd_estimated: bool) -> Vec<String> {
    let open = ["lower", "upper"].into_iter().zip(closed).filter(|(_, closed)| !closed);
    let mut words: Vec<String> = open
        .map(|(end, _)| {
            format!("the {end} end of the modulus: the interval reaches the end of the range searched")
        })
        .collect();
    if !sd_estimated && chi2 > points as f64 + 3.0 * (2.0 * points as f64).sqrt() {
        words.push(format!(
            "whether the model holds: chi-square is {chi2:.0} for {points} rows, so its interval is too narrow"
        ));
    }
    words
}

fn check(points: &[PhasePoint], search: &Search) -> Result<(), IdentifyError> {
    if !(search.lowest_pa > 0.0 && search.lowest_pa < search.highest_pa && search.highest_pa.is_finite()) {
        return Err(IdentifyError::Range(search.lowest_pa, search.highest_pa));
    }
    for (n, p) in points.iter().enumerate() {
        let refuse = |what, value, range| Err(IdentifyError::Row { row: n + 1, what, value, range });
        let w = p.amplitude.metres();
        if !(w > 0.0 && w < 1e-4) {
            return refuse("amplitude_pp_m", w, "above 0 and below 1e-4");
        }
        if !(-360.0..=360.0).contains(&p.phase_shift_deg) {
            return refuse("phase_shift_deg", p.phase_shift_deg, "-360 to 360");
        }
        if let Some(sd) = p.phase_shift_sd_deg
            && !(sd > 0.0 && sd <= 360.0)
        {
            return refuse("phase_shift_sd_deg", sd, "above 0 and at most 360");
        }
    }
    if points.len() < FEWEST {
        return Err(IdentifyError::TooFew { found: points.len(), needed: FEWEST });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A phase curve that rises where contact is lost, the earlier the stiffer; not smooth at its foot.
    fn toy(modulus: f64, w: PeakToPeak) -> f64 {
        let onset = 1e-6 * (28e6 / modulus).powf(0.3);
        let x = w.metres() / onset - 1.0;
        if x <= 0.0 { 4.0 } else { 4.0 + 90.0 * (1.0 - (-2.0 * x).exp()) }
    }

    fn rows(modulus: f64, sd_deg: Option<f64>) -> Vec<PhasePoint> {
        (1..=12)
            .map(|k| PeakToPeak::from_metres(0.2e-6 * f64::from(k)))
            .map(|amplitude| PhasePoint {
                amplitude,
                phase_shift_deg: toy(modulus, amplitude),
                phase_shift_sd_deg: sd_deg,
                repeats: None,
                condition: None,
                frequency_hz: None,
                normal_force_n: None,
            })
            .collect()
    }

    const SEARCH: Search = Search { lowest_pa: 10e6, highest_pa: 1e9, model_sd_deg: 0.0 };

    #[test]
    fn exact_rows_give_the_modulus_back() {
        for truth in [15e6, 28.3e6, 202.4e6, 700e6] {
            let found = identify(&rows(truth, Some(5.0)), &SEARCH, toy).expect("identified");
            assert!((found.young_modulus_pa / truth - 1.0).abs() < 1e-3, "{found:?}");
            assert!(found.ci95_pa[0] < truth && truth < found.ci95_pa[1]);
        }
    }

    #[test]
    fn a_phase_a_whole_turn_off_is_the_same_phase() {
        let mut turned = rows(28.3e6, Some(5.0));
        turned.iter_mut().for_each(|p| p.phase_shift_deg -= 360.0);
        let found = identify(&turned, &SEARCH, toy).expect("identified");
        assert!((found.young_modulus_pa / 28.3e6 - 1.0).abs() < 1e-3);
    }

    #[test]
    fn amplitudes_below_the_loss_of_contact_tell_only_a_bound() {
        let few: Vec<PhasePoint> = rows(28.3e6, Some(5.0)).into_iter().take(4).collect();
        let found = identify(&few, &SEARCH, toy).expect("identified");
        assert!(!found.closed[0], "{found:?}");
        assert!(found.cannot_tell[0].contains("lower end"));
    }

    #[test]
    fn a_missing_uncertainty_is_estimated_from_the_residuals() {
        let mut scattered = rows(28.3e6, None);
        scattered
            .iter_mut()
            .enumerate()
            .for_each(|(n, p)| p.phase_shift_deg += if n % 2 == 0 { 3.0 } else { -3.0 });
        let found = identify(&scattered, &SEARCH, toy).expect("identified");
        assert!(found.sd_estimated && (found.typical_sd_deg - 3.0).abs() < 0.5, "{found:?}");
    }

    #[test]
    fn bad_rows_are_refused_with_their_place() {
        let mut bad = rows(28.3e6, Some(5.0));
        bad[2].phase_shift_deg = f64::NAN;
        let why = identify(&bad, &SEARCH, toy).expect_err("refused").to_string();
        assert!(why.starts_with("row 3: phase_shift_deg"), "{why}");
        assert!(identify(&bad[..2], &SEARCH, toy).is_err());
        let upside_down = Search { lowest_pa: 1e9, ..SEARCH };
        assert!(matches!(identify(&rows(1e8, None), &upside_down, toy), Err(IdentifyError::Range(..))));
    }
}
