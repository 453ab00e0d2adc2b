//! Set-point (or drive current) to peak-to-peak amplitude.

use super::{AmplitudeError, AmplitudePoint, check, lack_of_fit, weighted};
use crate::regression::{Fit, ends, linear};
use nalgebra::{DMatrix, DVector};

/// Form of the curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum GainForm {
    /// `w = g s`.
    #[default]
    Proportional,
    /// `w = g s + o`.
    Affine,
    /// `w = g s + q s^2`.
    Bent,
}

impl GainForm {
    /// Names and units of the parameters, for a set-point in this unit.
    pub fn names(self, unit: &str) -> Vec<(String, String)> {
        let per = |power: &str| format!("m/{unit}{power}");
        let mut names = vec![("gain".into(), if unit == "m" { "1".into() } else { per("") })];
        match self {
            GainForm::Proportional => {}
            GainForm::Affine => names.push(("offset".into(), "m".into())),
            GainForm::Bent => names.push(("bend".into(), per("^2"))),
        }
        names
    }

    fn columns(self, s: f64) -> Vec<f64> {
        match self {
            GainForm::Proportional => vec![s],
            GainForm::Affine => vec![s, 1.0],
            GainForm::Bent => vec![s, s * s],
        }
    }
}

/// The fitted curve.
#[derive(Clone, Debug, PartialEq)]
pub struct GainFit {
    /// Its form.
    pub form: GainForm,
    /// Estimates, covariance by statistics, weighted residuals (relative to the amplitude).
    pub fit: Fit,
    /// Covariance of what all points share: the vibrometer's own calibration.
    pub type_b: DMatrix<f64>,
    /// Lack-of-fit p value, where there are replicates.
    pub lack_of_fit_p: Option<f64>,
    /// Smallest and largest set-point.
    pub range: [f64; 2],
}

/// Fits a vibrometer table: `at` is the set-point. The scatter is taken as proportional to the amplitude
/// above a floor; `vibrometer_relative_sd` is the standard uncertainty of the vibrometer, common to all.
///
/// # Errors
/// Too few points, a plate that saturates, points that do not follow the form.
pub fn fit(
    points: &[AmplitudePoint],
    form: GainForm,
    vibrometer_relative_sd: f64,
) -> Result<GainFit, AmplitudeError> {
    check(points, "different set-points", if form == GainForm::Proportional { 3 } else { 4 })?;
    refuse_saturation(points)?;
    let (n, columns) = (points.len(), form.columns(1.0).len());
    let fit = weighted(points, |scatter| {
        let design = DMatrix::from_fn(n, columns, |i, k| form.columns(points[i].at)[k] / scatter[i]);
        linear::ordinary(&design, &DVector::from_fn(n, |i, _| points[i].amplitude_pp_m / scatter[i]))
    })?;
    let p = lack_of_fit(points, fit.residuals.as_slice(), columns);
    if let Some(p) = p.filter(|p| *p < 1e-3) {
        let remedy = match form {
            GainForm::Proportional => "try the affine or the bent form, and look for a loose plate",
            _ => "the plate or the vibrometer changed between readings",
        };
        return Err(AmplitudeError::LackOfFit { p, remedy });
    }
    let type_b = &fit.estimates * fit.estimates.transpose() * vibrometer_relative_sd.powi(2);
    Ok(GainFit { form, fit, type_b, lack_of_fit_p: p, range: ends(points.iter().map(|p| p.at)) })
}

/// The slope between the two highest set-points against the slope through the lower ones.
fn refuse_saturation(points: &[AmplitudePoint]) -> Result<(), AmplitudeError> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a.at.total_cmp(&b.at));
    let levels: Vec<(f64, f64)> = sorted
        .chunk_by(|a, b| a.at == b.at)
        .map(|c| (c[0].at, c.iter().map(|p| p.amplitude_pp_m).sum::<f64>() / c.len() as f64))
        .collect();
    let [first, .., below, top] = levels.as_slice() else { return Ok(()) };
    let slope = (below.1 - first.1) / (below.0 - first.0);
    let share = (top.1 - below.1) / (slope * (top.0 - below.0));
    if share < 0.3 {
        return Err(AmplitudeError::Saturated { from: below.0, to: top.0, share: 100.0 * share });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha12Rng;
    use rand_distr::StandardNormal;

    fn table(w: impl Fn(f64) -> f64) -> Vec<AmplitudePoint> {
        (1..=10)
            .flat_map(|i| {
                let s = f64::from(i) * 0.4e-6;
                [1.003, 0.997].map(|noise| AmplitudePoint { at: s, amplitude_pp_m: w(s) * noise })
            })
            .collect()
    }

    #[test]
    fn a_gain_comes_back_with_the_vibrometers_share() {
        let found = fit(&table(|s| 0.93 * s), GainForm::Proportional, 0.01).unwrap();
        assert!((found.fit.estimates[0] - 0.93).abs() < 2.0 * found.fit.standard_uncertainty(0));
        assert!((found.type_b[(0, 0)].sqrt() - 0.0093).abs() < 1e-5);
    }

    /// Weights by the measured amplitude favoured what scattered low: at a scatter of 25 % 1.1 became 1.01.
    #[test]
    fn a_scattered_table_has_no_lower_gain() {
        let gains: Vec<f64> = (0..40)
            .filter_map(|seed: u64| {
                let mut noise = ChaCha12Rng::seed_from_u64(seed);
                let points: Vec<AmplitudePoint> = (0..30)
                    .map(|i| {
                        let at = [0.5e-6, 1e-6, 2e-6, 3e-6, 4e-6, 5e-6][i % 6];
                        let scatter: f64 = noise.sample(StandardNormal);
                        AmplitudePoint { at, amplitude_pp_m: (1.1 * at * (1.0 + 0.25 * scatter)).max(0.0) }
                    })
                    .collect();
                fit(&points, GainForm::Proportional, 0.0).ok().map(|found| found.fit.estimates[0])
            })
            .collect();
        let mean = gains.iter().sum::<f64>() / gains.len() as f64;
        assert!((mean - 1.1).abs() < 0.03, "{mean}: {gains:?}");
    }

    #[test]
    fn saturation_and_a_wrong_form_are_refused() {
        let error = fit(&table(|s| s.min(3e-6)), GainForm::Proportional, 0.0).unwrap_err();
        assert!(error.to_string().contains("saturates"), "{error}");
        let error = fit(&table(|s| s * (1.0 - 0.1 * s / 4e-6)), GainForm::Proportional, 0.0).unwrap_err();
        assert!(matches!(error, AmplitudeError::LackOfFit { .. }), "{error}");
        assert!(fit(&table(|s| s * (1.0 - 0.1 * s / 4e-6)), GainForm::Bent, 0.0).is_ok());
    }
}
