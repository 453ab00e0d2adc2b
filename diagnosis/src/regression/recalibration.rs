//! What recalibrating the baseline can imitate of a hypothesis' change.

use crate::regression::{NUISANCES, Problem};
use nalgebra::{DMatrix, DVector};

/// A hypothesis' change, and the recalibration that imitates it best.
pub struct Recalibration {
    /// The change of the forces itself, N.
    pub raw: DVector<f64>,
    /// The baseline's derivatives by its nuisances, N.
    pub jacobian: DMatrix<f64>,
    /// The recalibration that imitates the change best, in the nuisances' prior deviations.
    pub shift: DVector<f64>,
}

impl Recalibration {
    /// Of a hypothesis at coordinates where it predicts these forces, N.
    pub fn of(problem: &Problem, u: &[f64], prediction: &DVector<f64>) -> Self {
        let nuisance = &u[..NUISANCES];
        let baseline = problem.predict(&[], nuisance);
        let jacobian = problem.jacobian(&[], nuisance, &baseline);
        let raw = prediction - &baseline;
        let mut weighted = jacobian.clone();
        for (i, v) in problem.variance.iter().enumerate() {
            (0..NUISANCES).for_each(|k| weighted[(i, k)] /= *v);
        }
        let t = weighted.transpose();
        let hessian = &t * &jacobian + DMatrix::identity(NUISANCES, NUISANCES);
        let target = &t * &raw - DVector::from_column_slice(nuisance);
        let shift = hessian.cholesky().map_or_else(|| DVector::zeros(NUISANCES), |c| c.solve(&target));
        Recalibration { raw, jacobian, shift }
    }

    /// The change net of it, N: `m - m0` less what the nuisances, under their priors, can take up.
    pub fn net(&self) -> DVector<f64> {
        &self.raw - &self.jacobian * &self.shift
    }
}
