//! Bayes factors of the columns of a shape, averaged over sizes.

use crate::regression::{Covariance, Scaled, log_sum_exp};
use nalgebra::{DMatrix, DVector};

/// Deviations of a shape's size, in units of full friction.
const SIZES: [f64; 4] = [0.02, 0.06, 0.2, 0.6];

/// A log Bayes factor over no gap's.
#[derive(Clone, Copy)]
pub(super) struct Factor {
    /// Its mean over sizes.
    pub(super) nats: f64,
    /// Mean and deviation of the weight, at the best size.
    pub(super) mean: f64,
    pub(super) sd: f64,
    /// That size.
    pub(super) size: f64,
}

/// Of one column, by its score b and information q.
pub(super) fn factor(b: f64, q: f64) -> Factor {
    let each = SIZES.map(|s| {
        let grown = 1.0 + s * s * q;
        let nats = 0.5 * (b * b * s * s / grown - grown.ln());
        Factor { nats, mean: b * s * s / grown, sd: s / grown.sqrt(), size: s }
    });
    averaged(each)
}

fn averaged(each: [Factor; SIZES.len()]) -> Factor {
    let best = each.iter().fold(each[0], |a, e| if e.nats > a.nats { *e } else { a });
    Factor { nats: log_sum_exp(&each.map(|e| e.nats)) - (SIZES.len() as f64).ln(), ..best }
}

/// Of many columns with independent weights: the weight is the root mean square of their sum.
pub(super) fn factor_of(
    [columns, bare]: &[DMatrix<f64>; 2],
    covariance: &Covariance,
    residual: &DVector<f64>,
) -> Factor {
    let residual = DMatrix::from_column_slice(residual.len(), 1, residual.as_slice());
    let gram = covariance.inner(columns, columns);
    let score = covariance.inner(columns, &residual).column(0).into_owned();
    let n = bare.nrows() as f64;
    let each = SIZES.map(|size| {
        let Some(parts) = Scaled::new(&gram, &score, vec![size; columns.ncols()]) else {
            return Factor { nats: f64::NEG_INFINITY, mean: 0.0, sd: size, size };
        };
        let sd = (parts.leverage(bare).iter().sum::<f64>() / n).sqrt();
        let mean = (bare * parts.weights()).norm() / n.sqrt();
        Factor { nats: 0.5 * (parts.explained - parts.log_det), mean, sd, size }
    });
    averaged(each)
}
