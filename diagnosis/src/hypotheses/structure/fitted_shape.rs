//! A shape beside the recalibrated baseline, fitted to some passes: what it predicts at others.

use super::shapes::Shape;
use crate::regression::{Covariance, NUISANCES, Posterior, Problem};
use nalgebra::{DMatrix, DVector};

/// A shape at its best place, its size and the nuisances fitted together: all are linear.
pub struct FittedShape {
    shape: Shape,
    /// The nuisances about which the baseline is linear.
    centre: Vec<f64>,
    covariance: Covariance,
    weights: DVector<f64>,
}

/// The baseline at a problem's passes, N, and the columns of the nuisances and of the shape.
fn columns(shape: &Shape, problem: &Problem, centre: &[f64]) -> (DVector<f64>, DMatrix<f64>) {
    let prediction = problem.predict(&[], centre);
    let own = shape.best.columns(problem, centre, &prediction);
    let nuisances = problem.jacobian(&[], centre, &prediction);
    let mut all = nuisances.resize_horizontally(NUISANCES + own.ncols(), 0.0);
    all.columns_mut(NUISANCES, own.ncols()).copy_from(&own);
    (prediction, all)
}

impl FittedShape {
    /// Fits a shape's size, and the nuisances about where the recalibrated baseline has them.
    pub fn fit(shape: &Shape, problem: &Problem, none: &Posterior) -> Self {
        let centre = none.u[..NUISANCES].to_vec();
        let (prediction, columns) = columns(shape, problem, &centre);
        let pull = columns.columns(0, NUISANCES) * DVector::from_column_slice(&centre);
        let residual = DVector::from_column_slice(&problem.lateral) - &prediction + pull;
        let covariance = shape.best.under.problem(problem, &centre, &prediction).covariance(&columns);
        let weights = covariance.weights(&residual).rows(0, columns.ncols()).into_owned();
        FittedShape { shape: shape.clone(), centre, covariance, weights }
    }

    /// Lateral forces and their variances without scatter at the passes of another problem, N and N^2.
    pub fn predict(&self, out: &Problem) -> (DVector<f64>, Vec<f64>) {
        let (prediction, columns) = columns(&self.shape, out, &self.centre);
        let mut shift = self.weights.clone();
        (0..NUISANCES).for_each(|k| shift[k] -= self.centre[k]);
        let spread = |i: usize| self.covariance.posterior_variance(&columns.row(i).transpose()).max(0.0);
        let variance = (0..out.len()).map(spread).collect();
        (prediction + columns * shift, variance)
    }
}

#[cfg(test)]
mod tests {
    use crate::tests::{Deviates, rig, table};
    use crate::verdict::Verdict;
    use crate::{Options, diagnose};

    /// A reading that jumps by 0.06 N half way, which no cause makes: with every third pass held out, the
    /// answer `unknown` predicts them on either side of the jump.
    #[test]
    fn a_jump_that_is_described_is_predicted() {
        let mut whole = table(&mut Deviates(9), 0.0);
        for (p, lateral) in whole.passes.iter().zip(&mut whole.lateral) {
            *lateral += if p.time_s >= 90.0 { 0.06 } else { 0.0 };
        }
        let (fitted, held): (Vec<usize>, Vec<usize>) = (0..whole.len()).partition(|i| i % 3 != 1);
        let result = diagnose(&whole.select(&fitted), &rig(), &Options::default(), String::new());
        assert_eq!(result.report.verdict, Verdict::Unknown, "{}", result.report.text);
        // A cause in a form that nobody has fitted would look alike: causes keep a share.
        assert!((0.5..0.9).contains(&result.report.hypotheses[0].probability), "{}", result.report.text);
        assert_eq!(result.report.description[0].covariate, "time_s");
        // The jump fits as a change of the coefficient and of the reading: it is one structure all the same.
        let described = || result.report.description.iter().map(|d| (d.structure, d.covariate));
        assert!(described().enumerate().all(|(i, d)| described().skip(i + 1).all(|other| other != d)));
        assert!(result.report.text.contains("with the first shape described"), "{}", result.report.text);
        let held = whole.select(&held);
        let mut errors = [0.0; 2];
        for (i, f) in result.predict(&held).unwrap().iter().enumerate() {
            errors[0] += (held.lateral[i] - f.recalibrated).powi(2);
            errors[1] += (held.lateral[i] - f.corrected).powi(2);
        }
        // The baseline alone misses by 0.03 N and more.
        assert!(errors[1] < 0.1 * errors[0], "{errors:?}");
    }
}
