//! Cramer-Rao bounds: how small an interval could be, from what the world's noise truly is.
//!
//! Every bound is that of the smallest model that holds the truth (so it also charges a calibration for each
//! parameter it fits beyond that), and of the truth's own noise, which the calibration is not told.

use nalgebra::{DMatrix, DVector};

/// Derivatives of a model's readings by its parameters, by central differences.
pub fn jacobian(model: impl Fn(&[f64]) -> Vec<f64>, at: &[f64], step: &[f64]) -> DMatrix<f64> {
    let columns: Vec<DVector<f64>> = (0..at.len())
        .map(|k| {
            let shifted = |by: f64| {
                let mut b = at.to_vec();
                b[k] += by;
                DVector::from_vec(model(&b))
            };
            (shifted(step[k]) - shifted(-step[k])) / (2.0 * step[k])
        })
        .collect();
    DMatrix::from_columns(&columns)
}

/// The bound of independent Gaussian readings with these standard deviations: covariance of the parameters.
pub fn independent(jacobian: &DMatrix<f64>, sd: &[f64]) -> DMatrix<f64> {
    let whitened = DMatrix::from_fn(jacobian.nrows(), jacobian.ncols(), |i, k| jacobian[(i, k)] / sd[i]);
    (whitened.transpose() * whitened).try_inverse().expect("these readings determine the truth")
}

/// Fisher information of correlated Gaussian readings.
pub fn information(jacobian: &DMatrix<f64>, covariance: &DMatrix<f64>) -> DMatrix<f64> {
    let whitened = covariance
        .clone()
        .cholesky()
        .expect("a covariance is positive definite")
        .l()
        .solve_lower_triangular(jacobian)
        .expect("so is its factor");
    whitened.transpose() * whitened
}

#[test]
fn the_bound_of_a_mean_and_of_a_line_is_the_closed_form() {
    let j = jacobian(|b| vec![b[0]; 25], &[3.0], &[1e-3]);
    assert!((independent(&j, &[0.5; 25])[(0, 0)].sqrt() - 0.1).abs() < 1e-9);
    let line = |b: &[f64]| (0..11).map(|i| b[0] + b[1] * (f64::from(i) - 5.0)).collect();
    let j = jacobian(line, &[1.0, 2.0], &[1e-3, 1e-3]);
    // Sum of squares of -5 to 5 is 110.
    let bound = information(&j, &DMatrix::identity(11, 11)).try_inverse().unwrap();
    assert!((bound[(1, 1)] - 1.0 / 110.0).abs() < 1e-9);
}
