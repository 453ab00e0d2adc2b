//! Linear least squares: ordinary, and of observations whose variance is known.

use super::double_double::DoubleDouble;
use super::{Fit, FitError};
use nalgebra::{DMatrix, DVector};

/// Ordinary least squares `y = X b + e`; the scatter of `e` is estimated from the residuals.
///
/// # Errors
/// Fewer than `parameters + 1` rows, dependent columns, values that are not finite.
pub fn ordinary(design: &DMatrix<f64>, observations: &DVector<f64>) -> Result<Fit, FitError> {
    if design.nrows() <= design.ncols() {
        return Err(FitError::TooFew { observations: design.nrows(), parameters: design.ncols() });
    }
    let mut fit = solve(design, observations)?;
    fit.covariance *= fit.residual_sum_of_squares / fit.degrees_of_freedom;
    Ok(fit)
}

/// Least squares for observations of unit variance: the covariance is `(X'X)^-1`, not rescaled by the fit.
///
/// # Errors
/// As [`ordinary`], but as many rows as parameters are allowed.
pub fn unit_variance(design: &DMatrix<f64>, observations: &DVector<f64>) -> Result<Fit, FitError> {
    if design.nrows() < design.ncols() {
        return Err(FitError::TooFew { observations: design.nrows(), parameters: design.ncols() });
    }
    solve(design, observations)
}

/// The common part: estimates, `(X'X)^-1`, residuals.
fn solve(design: &DMatrix<f64>, observations: &DVector<f64>) -> Result<Fit, FitError> {
    let (n, p) = design.shape();
    if design.iter().chain(observations.iter()).any(|x| !x.is_finite()) {
        return Err(FitError::NotFinite { place: "design or observations" });
    }
    // Powers of two as column scales: exact, and the pivots become comparable with one another.
    let columns: Vec<Vec<f64>> = (0..p)
        .map(|j| {
            let norm = design.column(j).norm();
            let scale = if norm > 0.0 { 2f64.powi(-norm.log2().round() as i32) } else { 1.0 };
            design.column(j).iter().map(|x| x * scale).chain([scale]).collect()
        })
        .collect();
    // The scale stands behind the last row, so that a column is one slice.
    let x = |j: usize| &columns[j][..n];
    let scale = |j: usize| columns[j][n];
    let mut lower = vec![vec![DoubleDouble::ZERO; p]; p];
    for j in 0..p {
        for k in 0..=j {
            let mut entry = dot(x(j), x(k));
            let before = entry.value();
            for (a, b) in lower[j][..k].iter().zip(&lower[k][..k]) {
                entry = entry - *a * *b;
            }
            if j == k {
                // Below 1e-22 of the column's own square nothing of it is left but its rounding to f64.
                if entry.value() <= 1e-22 * before || before == 0.0 {
                    return Err(FitError::Singular { parameter: j });
                }
                lower[j][k] = entry.sqrt();
            } else {
                lower[j][k] = entry / lower[k][k];
            }
        }
    }
    let solve_both = |right: Vec<DoubleDouble>| -> Vec<DoubleDouble> {
        let mut z = right;
        for j in 0..p {
            for k in 0..j {
                z[j] = z[j] - lower[j][k] * z[k];
            }
            z[j] = z[j] / lower[j][j];
        }
        for j in (0..p).rev() {
            for k in j + 1..p {
                z[j] = z[j] - lower[k][j] * z[k];
            }
            z[j] = z[j] / lower[j][j];
        }
        z
    };
    let scaled = solve_both((0..p).map(|j| dot(x(j), observations.as_slice())).collect());
    let residuals = DVector::from_fn(n, |i, _| {
        (0..p)
            .fold(DoubleDouble::from(observations[i]), |r, j| r - DoubleDouble::from(x(j)[i]) * scaled[j])
            .value()
    });
    let mut covariance = DMatrix::zeros(p, p);
    for k in 0..p {
        let unit = (0..p).map(|j| DoubleDouble::from(if j == k { 1.0 } else { 0.0 })).collect();
        for (j, entry) in solve_both(unit).into_iter().enumerate() {
            covariance[(j, k)] = entry.value() * scale(j) * scale(k);
        }
    }
    let estimates = DVector::from_fn(p, |j, _| scaled[j].value() * scale(j));
    if estimates.iter().any(|x| !x.is_finite()) {
        return Err(FitError::NotFinite { place: "estimates" });
    }
    let residual_sum_of_squares = residuals.dot(&residuals);
    Ok(Fit { estimates, covariance, residuals, residual_sum_of_squares, degrees_of_freedom: (n - p) as f64 })
}

/// Sum of products without rounding to `f64` in between.
fn dot(a: &[f64], b: &[f64]) -> DoubleDouble {
    a.iter().zip(b).fold(DoubleDouble::ZERO, |sum, (a, b)| sum + DoubleDouble::product(*a, *b))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dependent_columns_are_named_not_solved() {
        let design = DMatrix::from_fn(6, 3, |i, j| [1.0, i as f64, 2.0 * i as f64 + 3.0][j]);
        let y = DVector::from_fn(6, |i, _| i as f64);
        assert_eq!(ordinary(&design, &y), Err(FitError::Singular { parameter: 2 }));
    }
}
