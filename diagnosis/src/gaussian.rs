//! Gaussian algebra with a diagonal and a low-rank part: `C = diag(var) + Phi Phi'`.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Inverse and determinant of `diag(var) + Phi Phi'` by Woodbury.
pub struct Covariance {
    inverse_sd: DVector<f64>,
    whitened: DMatrix<f64>,
    inner: Cholesky<f64, Dyn>,
    log_det: f64,
}

impl Covariance {
    /// Factors the covariance. `phi` may have no columns.
    pub fn new(variance: &[f64], phi: &DMatrix<f64>) -> Self {
        let inverse_sd = DVector::from_iterator(variance.len(), variance.iter().map(|v| 1.0 / v.sqrt()));
        let mut whitened = phi.clone();
        for mut column in whitened.column_iter_mut() {
            column.component_mul_assign(&inverse_sd);
        }
        let mut gram = whitened.transpose() * &whitened;
        for i in 0..gram.nrows() {
            gram[(i, i)] += 1.0;
        }
        let inner = Cholesky::new(gram).expect("identity plus a Gram matrix is positive definite");
        let log_det = variance.iter().map(|v| v.ln()).sum::<f64>()
            + 2.0 * inner.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
        Self { inverse_sd, whitened, inner, log_det }
    }

    /// Log determinant.
    pub fn log_det(&self) -> f64 {
        self.log_det
    }

    /// `C^-1` times the columns of a matrix, between two sets of columns: `A' C^-1 B`.
    pub fn inner(&self, a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
        let (a, b) = (self.scale(a), self.scale(b));
        let direct = a.transpose() * &b;
        if self.whitened.ncols() == 0 {
            return direct;
        }
        let wt = self.whitened.transpose();
        let (pa, pb) = (&wt * &a, &wt * &b);
        direct - pa.transpose() * self.inner.solve(&pb)
    }

    /// `v' C^-1 v`.
    pub fn quadratic(&self, v: &DVector<f64>) -> f64 {
        let m = DMatrix::from_column_slice(v.len(), 1, v.as_slice());
        self.inner(&m, &m)[(0, 0)]
    }

    /// Posterior mean of the low-rank weights given a residual: the smooth part is `Phi` times it.
    pub fn weights(&self, residual: &DVector<f64>) -> DVector<f64> {
        let r = residual.component_mul(&self.inverse_sd);
        self.inner.solve(&(self.whitened.transpose() * r))
    }

    /// Variance of the smooth part at a row of `Phi`, given the data.
    pub fn posterior_variance(&self, row: &DVector<f64>) -> f64 {
        row.dot(&self.inner.solve(row))
    }

    /// Covariance of the smooth part between rows of `Phi`, given the data.
    pub fn posterior_covariance(&self, rows: &DMatrix<f64>) -> DMatrix<f64> {
        rows * self.inner.solve(&rows.transpose())
    }

    fn scale(&self, m: &DMatrix<f64>) -> DMatrix<f64> {
        let mut m = m.clone();
        for mut column in m.column_iter_mut() {
            column.component_mul_assign(&self.inverse_sd);
        }
        m
    }
}

/// Sum of exponentials in logarithm; minus infinity for none.
pub fn log_sum_exp(values: &[f64]) -> f64 {
    let top = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if top == f64::NEG_INFINITY {
        return top;
    }
    top + values.iter().map(|v| (v - top).exp()).sum::<f64>().ln()
}
