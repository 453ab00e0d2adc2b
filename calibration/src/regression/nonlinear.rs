//! Non-linear least squares by Levenberg-Marquardt (Nielsen's damping, Marquardt's scaling of the columns).

use super::{Fit, FitError};
use nalgebra::{DMatrix, DVector};

/// A model evaluated at one observation: given its index and the parameters, it returns the value and
/// writes the derivatives by the parameters.
pub type Model<'a> = dyn Fn(usize, &[f64], &mut [f64]) -> f64 + 'a;

/// Fits `observations[i] = model(i, b) + e` from a starting point; the scatter of `e`, equal for all, is
/// estimated from the residuals.
///
/// Converges to the nearest minimum: where there may be several, [`best`] starts from several points.
///
/// # Errors
/// Too few observations, parameters that the data does not determine, values not finite, no convergence.
pub fn fit(model: &Model, observations: &[f64], start: &[f64]) -> Result<Fit, FitError> {
    const ITERATIONS: usize = 20_000;
    let (n, p) = (observations.len(), start.len());
    if n <= p {
        return Err(FitError::TooFew { observations: n, parameters: p });
    }
    let evaluate = |b: &DVector<f64>| {
        let mut residuals = DVector::zeros(n);
        let mut jacobian = DMatrix::zeros(n, p);
        let mut gradient = vec![0.0; p];
        for i in 0..n {
            let value = model(i, b.as_slice(), &mut gradient);
            residuals[i] = observations[i] - value;
            for j in 0..p {
                jacobian[(i, j)] = gradient[j];
            }
        }
        (residuals, jacobian)
    };

    let mut b = DVector::from_column_slice(start);
    let (mut r, mut j) = evaluate(&b);
    let mut sum = r.norm_squared();
    if !sum.is_finite() || j.iter().any(|x| !x.is_finite()) {
        return Err(FitError::NotFinite { place: "model at the starting point" });
    }
    let (mut damping, mut growth) = (1e-3, 2.0);
    let mut settled = 0;
    for _ in 0..ITERATIONS {
        let scale: Vec<f64> = (0..p).map(|k| j.column(k).norm().max(f64::MIN_POSITIVE)).collect();
        let step = damped_step(&j, &r, &scale, damping);
        let next = &b + &step;
        let small = step.iter().zip(b.iter()).all(|(s, b)| s.abs() <= 4.0 * f64::EPSILON * b.abs());
        let (next_r, next_j) = evaluate(&next);
        let next_sum = next_r.norm_squared();
        let usable = next_sum.is_finite() && next_j.iter().all(|x| x.is_finite());
        // Near the minimum the sum of squares is flat to rounding: steps there are judged by their size.
        if usable && next_sum <= sum * (1.0 + 8.0 * f64::EPSILON) {
            let predicted = sum - (&r - &j * &step).norm_squared();
            let gain = if predicted > 0.0 { (sum - next_sum) / predicted } else { 1.0 };
            let improved = sum - next_sum > 1e-13 * sum;
            (b, r, j, sum) = (next, next_r, next_j, next_sum);
            damping *= (1.0 - (2.0 * gain.clamp(0.0, 1.0) - 1.0).powi(3)).max(1.0 / 3.0);
            damping = damping.max(1e-18);
            growth = 2.0;
            settled = if improved { 0 } else { settled + 1 };
            if small {
                settled = 3;
            }
        } else {
            damping *= growth;
            growth *= 2.0;
            if small || damping > 1e20 {
                settled = settled.max(3);
            }
        }
        // Four steps without progress: the rest is for the undamped steps of `polish`.
        if settled >= 4 || (settled >= 3 && small) || sum == 0.0 {
            return polish(b, r, j, &evaluate);
        }
    }
    Err(FitError::NotConverged { iterations: ITERATIONS })
}

/// The best fit among those from several starting points that `wanted` takes.
///
/// # Errors
/// There is none.
pub fn best<const N: usize>(
    model: &Model,
    observations: &[f64],
    starts: impl IntoIterator<Item = [f64; N]>,
    wanted: impl Fn(&Fit) -> bool,
) -> Result<Fit, FitError> {
    let fits = starts.into_iter().filter_map(|start| fit(model, observations, &start).ok()).filter(wanted);
    fits.min_by(|a, b| a.residual_sum_of_squares.total_cmp(&b.residual_sum_of_squares))
        .ok_or(FitError::NotConverged { iterations: 0 })
}

fn damped_step(j: &DMatrix<f64>, r: &DVector<f64>, scale: &[f64], damping: f64) -> DVector<f64> {
    let (n, p) = j.shape();
    let mut augmented = DMatrix::zeros(n + p, p);
    let mut right = DVector::zeros(n + p);
    for k in 0..p {
        augmented.view_mut((0, k), (n, 1)).copy_from(&(j.column(k) / scale[k]));
        augmented[(n + k, k)] = damping.sqrt();
    }
    right.rows_mut(0, n).copy_from(r);
    let qr = augmented.qr();
    qr.q_tr_mul(&mut right);
    let step = qr.r().solve_upper_triangular(&right.rows(0, p).into_owned());
    step.map_or_else(
        || DVector::zeros(p),
        |s| DVector::from_iterator(p, s.iter().zip(scale).map(|(s, c)| s / c)),
    )
}

/// Gauss-Newton steps in double-double arithmetic for as long as they shrink, then the covariance.
/// The sum of squares is flat to rounding here, so it no longer says where the minimum is; the steps do.
fn polish(
    mut b: DVector<f64>,
    mut r: DVector<f64>,
    mut j: DMatrix<f64>,
    evaluate: &impl Fn(&DVector<f64>) -> (DVector<f64>, DMatrix<f64>),
) -> Result<Fit, FitError> {
    let mut last = f64::INFINITY;
    let mut newton = super::linear::unit_variance(&j, &r)?;
    for _ in 0..200 {
        let size = newton
            .estimates
            .iter()
            .zip(newton.covariance.diagonal().iter())
            .map(|(step, variance)| step * step / variance)
            .sum::<f64>()
            .sqrt();
        if size >= 0.95 * last || size == 0.0 {
            break;
        }
        let next = &b + &newton.estimates;
        let (next_r, next_j) = evaluate(&next);
        if next_r.iter().chain(next_j.iter()).any(|x| !x.is_finite()) {
            break;
        }
        last = size;
        (b, r, j) = (next, next_r, next_j);
        newton = super::linear::unit_variance(&j, &r)?;
    }
    let (n, p) = j.shape();
    let degrees_of_freedom = (n - p) as f64;
    let residual_sum_of_squares = r.norm_squared();
    let covariance = newton.covariance * (residual_sum_of_squares / degrees_of_freedom);
    Ok(Fit { estimates: b, covariance, residuals: r, residual_sum_of_squares, degrees_of_freedom })
}
