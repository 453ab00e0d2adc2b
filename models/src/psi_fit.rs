//! Refit of Eq. 20: Psi* from computed (or measured) relative friction.

use crate::psi::{PsiEq17, relative_friction, sensitivity_to_psi_star};

/// A least-squares Psi*.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PsiFit {
    /// Psi*.
    pub psi_star: f64,
    /// Standard uncertainty from leaving out one curve at a time (jackknife): points of a curve share errors.
    pub psi_star_sd: f64,
    /// Root mean square residual in mu'.
    pub rmse: f64,
    /// Points used.
    pub points: usize,
}

/// Fits Psi* to `(curve, Psi of Eq. 17, mu')`; `curve` numbers the curve that a point belongs to.
/// None without points, or where no Psi* between 0.01 and 100 fits better than its neighbours.
pub fn fit(points: &[(usize, f64, f64)]) -> Option<PsiFit> {
    let psi_star = least_squares(points.iter())?;
    let residual = |p: &(usize, f64, f64)| relative_friction(PsiEq17(p.1), psi_star) - p.2;
    let rmse = (points.iter().map(|p| residual(p).powi(2)).sum::<f64>() / points.len() as f64).sqrt();
    let mut curves: Vec<usize> = points.iter().map(|p| p.0).collect();
    curves.sort_unstable();
    curves.dedup();
    let left_out: Vec<f64> =
        curves.iter().filter_map(|curve| least_squares(points.iter().filter(|p| p.0 != *curve))).collect();
    let n = left_out.len() as f64;
    let centre = left_out.iter().sum::<f64>() / n;
    let spread: f64 = left_out.iter().map(|v| (v - centre).powi(2)).sum();
    let psi_star_sd = if n > 1.0 { ((n - 1.0) / n * spread).sqrt() } else { f64::NAN };
    Some(PsiFit { psi_star, psi_star_sd, rmse, points: points.len() })
}

/// Zero of the derivative of the sum of squares, from a scan and bisection: the sum is smooth in Psi*.
fn least_squares<'a>(points: impl Iterator<Item = &'a (usize, f64, f64)> + Clone) -> Option<f64> {
    let slope = |star: f64| -> f64 {
        points
            .clone()
            .map(|p| {
                let psi = PsiEq17(p.1);
                (relative_friction(psi, star) - p.2) * sensitivity_to_psi_star(psi, star)
            })
            .sum()
    };
    let place = |k: usize| 0.01 * 10_f64.powf(k as f64 / 50.0);
    let mut cells = (0..200).map(|k| [place(k), place(k + 1)]);
    let cell = cells.find(|[a, b]| slope(*a) < 0.0 && slope(*b) >= 0.0)?;
    Some(crate::root::bisection(cell, 100, |star| slope(star) < 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn its_own_law_is_found_again() {
        let points: Vec<_> = (1..40)
            .map(|k| (k / 10, 0.2 * k as f64, relative_friction(PsiEq17(0.2 * k as f64), 2.38)))
            .collect();
        let fit = fit(&points).expect("fits");
        assert!((fit.psi_star - 2.38).abs() < 1e-9 && fit.psi_star_sd < 1e-9 && fit.rmse < 1e-12);
        assert!(super::fit(&[]).is_none());
    }
}
