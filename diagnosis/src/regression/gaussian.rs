//! Gaussian algebra of low rank: `C = diag(var) + Phi Phi'`. docs/diagnosis/model.md, section 7.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Half the logarithm of two pi.
pub const HALF_LN_2PI: f64 = 0.918_938_533_204_672_8;

/// Inverse and determinant of `diag(var) + Phi Phi'` by Woodbury.
pub struct Covariance {
    inverse_sd: DVector<f64>,
    whitened: DMatrix<f64>,
    inner: Cholesky<f64, Dyn>,
    /// Log determinant.
    pub log_det: f64,
}

impl Covariance {
    /// Factors the covariance. `phi` may have no columns.
    pub fn new(variance: &[f64], phi: &DMatrix<f64>) -> Self {
        let inverse_sd = DVector::from_iterator(variance.len(), variance.iter().map(|v| 1.0 / v.sqrt()));
        let whitened = rows_times(phi.clone(), &inverse_sd);
        let mut gram = whitened.transpose() * &whitened;
        (0..gram.nrows()).for_each(|i| gram[(i, i)] += 1.0);
        // Numbers that overflow make no matrix: such a hypothesis is infinitely unlikely.
        let columns = gram.nrows();
        let (inner, finite) = Cholesky::new(gram).map_or_else(
            || (Cholesky::pack_dirty(DMatrix::identity(columns, columns)), f64::INFINITY),
            |inner| (inner, 0.0),
        );
        let log_det = variance.iter().map(|v| v.ln()).sum::<f64>()
            + 2.0 * inner.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>()
            + finite;
        Self { inverse_sd, whitened, inner, log_det }
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

    /// `h' C^-1 v` and `h' C^-1 h` of each column h.
    pub fn scores(&self, columns: &DMatrix<f64>, v: &DVector<f64>) -> (Vec<f64>, Vec<f64>) {
        let (h, z) = (self.scale(columns), v.component_mul(&self.inverse_sd));
        let wt = self.whitened.transpose();
        let root = |m: DMatrix<f64>| self.inner.l_dirty().solve_lower_triangular(&m).unwrap_or(m);
        let (ph, pz) =
            (root(&wt * &h), root(DMatrix::from_column_slice(wt.nrows(), 1, (&wt * &z).as_slice())));
        let each = |j: usize| {
            let (own, seen) = (h.column(j), ph.column(j));
            (own.dot(&z) - seen.dot(&pz.column(0)), own.norm_squared() - seen.norm_squared())
        };
        (0..h.ncols()).map(each).unzip()
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

    /// Variance of the smooth part at a row of `Phi`, given the data. The row may be shorter than the
    /// table's: what it leaves out (shifts of runs) is not there.
    pub fn posterior_variance(&self, row: &DVector<f64>) -> f64 {
        let row = row.clone().resize_vertically(self.whitened.ncols(), 0.0);
        row.dot(&self.inner.solve(&row))
    }

    /// Covariance of the smooth part between rows of `Phi`, which may be shorter too, given the data.
    pub fn posterior_covariance(&self, rows: &DMatrix<f64>) -> DMatrix<f64> {
        let rows = rows.clone().resize_horizontally(self.whitened.ncols(), 0.0);
        &rows * self.inner.solve(&rows.transpose())
    }

    fn scale(&self, m: &DMatrix<f64>) -> DMatrix<f64> {
        rows_times(m.clone(), &self.inverse_sd)
    }
}

/// A matrix with each row times its factor.
pub(crate) fn rows_times(mut matrix: DMatrix<f64>, factors: &DVector<f64>) -> DMatrix<f64> {
    matrix.column_iter_mut().for_each(|mut column| column.component_mul_assign(factors));
    matrix
}

/// A covariance `I + Phi S S Phi'` of whitened data for scales `S` of the columns, from products that stay
/// the same for all scales.
pub struct Scaled {
    factor: Cholesky<f64, Dyn>,
    active: Vec<usize>,
    sizes: Vec<f64>,
    score: DVector<f64>,
    /// Log determinant.
    pub log_det: f64,
    /// Part of the residual's squared norm that the columns explain.
    pub explained: f64,
}

impl Scaled {
    /// Factors; `gram` is `Phi' Phi`, `score` is `Phi'` times the residual. Columns of scale zero are left
    /// out.
    pub fn new(gram: &DMatrix<f64>, score: &DVector<f64>, sizes: Vec<f64>) -> Option<Self> {
        let active: Vec<usize> = (0..sizes.len()).filter(|&j| sizes[j] > 0.0).collect();
        let a = active.len();
        let mut inner =
            DMatrix::from_fn(a, a, |i, j| gram[(active[i], active[j])] * sizes[active[i]] * sizes[active[j]]);
        (0..a).for_each(|i| inner[(i, i)] += 1.0);
        let score = DVector::from_fn(a, |i, _| score[active[i]] * sizes[active[i]]);
        let factor = inner.cholesky()?;
        let log_det = 2.0 * factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
        let explained = score.dot(&factor.solve(&score));
        Some(Scaled { factor, active, sizes, score, log_det, explained })
    }

    /// Weights of all columns: the smooth part is `Phi` times them.
    pub fn weights(&self) -> DVector<f64> {
        let solved = self.factor.solve(&self.score);
        let mut all = DVector::zeros(self.sizes.len());
        solved.iter().zip(&self.active).for_each(|(w, &j)| all[j] = w * self.sizes[j]);
        all
    }

    /// Share of each row's variance that the other rows and columns explain, of whitened columns `phi`: the
    /// diagonal of `Phi S (I + S Phi' Phi S)^-1 S Phi'`.
    pub fn leverage(&self, phi: &DMatrix<f64>) -> Vec<f64> {
        let mut rows = phi.select_columns(self.active.iter());
        for (mut column, &j) in rows.column_iter_mut().zip(&self.active) {
            column.scale_mut(self.sizes[j]);
        }
        let solved = self.factor.l().solve_lower_triangular(&rows.transpose());
        solved.map_or_else(|| vec![0.0; phi.nrows()], |s| s.column_iter().map(|c| c.norm_squared()).collect())
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers that overflow ended the program in a panic.
    #[test]
    fn a_covariance_that_overflows_is_infinitely_unlikely() {
        for huge in [1e200, f64::INFINITY, f64::NAN] {
            let phi = DMatrix::from_row_slice(2, 1, &[huge, 1.0]);
            let covariance = Covariance::new(&[1e-12, 1.0], &phi);
            assert_eq!(covariance.log_det, f64::INFINITY, "{huge}");
        }
    }
}
