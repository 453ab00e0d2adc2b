//! Propagation of distributions by a Monte Carlo method (JCGM 101:2008).

use super::{Budget, Distribution};
use rand::{Rng, RngExt};
use rand_distr::{Distribution as _, StandardNormal, StudentT};

/// The distribution of a result, as a sorted sample.
#[derive(Clone, Debug, PartialEq)]
pub struct Sampled {
    sorted: Vec<f64>,
}

impl Sampled {
    /// From values in any order.
    pub fn new(mut values: Vec<f64>) -> Self {
        values.sort_by(f64::total_cmp);
        Sampled { sorted: values }
    }

    /// Mean of the sample.
    pub fn mean(&self) -> f64 {
        self.sorted.iter().sum::<f64>() / self.sorted.len() as f64
    }

    /// Standard deviation of the sample: the standard uncertainty.
    pub fn standard_uncertainty(&self) -> f64 {
        let mean = self.mean();
        let sum: f64 = self.sorted.iter().map(|x| (x - mean).powi(2)).sum();
        (sum / (self.sorted.len() as f64 - 1.0)).sqrt()
    }

    /// The shortest coverage interval (Supplement 1, 5.3.4).
    pub fn shortest_interval(&self, coverage: f64) -> [f64; 2] {
        let n = self.sorted.len();
        let inside = ((coverage * n as f64).round() as usize).clamp(1, n - 1);
        (0..n - inside)
            .map(|i| [self.sorted[i], self.sorted[i + inside]])
            .min_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])))
            .unwrap_or([f64::NAN; 2])
    }
}

/// Why nothing could be drawn.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DrawError {
    /// Correlation is defined here for Gaussian inputs only (Supplement 1, 6.4.8).
    #[error("input `{0}` is correlated but not Gaussian: give it a normal distribution")]
    CorrelatedNotGaussian(String),
    /// The correlation matrix is not positive definite.
    #[error("the correlation matrix of the inputs is not positive definite")]
    Correlation,
    /// Too few draws for the requested interval (Supplement 1, 7.2 advises 10^4 / (1 - p)).
    #[error("{0} draws are too few: take at least 10000")]
    TooFew(usize),
}

/// Draws the inputs `trials` times and evaluates `model` on each draw.
///
/// # Errors
/// Correlated inputs that are not Gaussian, an impossible correlation matrix, fewer than 10,000 draws.
pub fn monte_carlo(
    budget: &Budget,
    model: impl Fn(&[f64]) -> f64,
    trials: usize,
    rng: &mut impl Rng,
) -> Result<Sampled, DrawError> {
    if trials < 10_000 {
        return Err(DrawError::TooFew(trials));
    }
    let n = budget.inputs().len();
    let correlated = |i: usize| (0..n).any(|j| j != i && budget.correlation()[(i, j)].abs() > 0.0);
    for (i, input) in budget.inputs().iter().enumerate() {
        if correlated(i) && input.distribution != Distribution::Normal {
            return Err(DrawError::CorrelatedNotGaussian(input.name.clone()));
        }
    }
    let lower = budget.correlation().clone().cholesky().ok_or(DrawError::Correlation)?.unpack();
    let mut x = vec![0.0; n];
    let mut z = vec![0.0; n];
    let values = (0..trials)
        .map(|_| {
            z.iter_mut().for_each(|z| *z = StandardNormal.sample(rng));
            for (i, input) in budget.inputs().iter().enumerate() {
                let unit = match input.distribution {
                    Distribution::Normal => (0..=i).map(|j| lower[(i, j)] * z[j]).sum(),
                    Distribution::Student => {
                        StudentT::new(input.degrees_of_freedom).map_or(z[i], |t| t.sample(rng))
                    }
                    Distribution::Rectangular => 3f64.sqrt() * (2.0 * rng.random::<f64>() - 1.0),
                    Distribution::Arcsine => {
                        2f64.sqrt() * (2.0 * std::f64::consts::PI * rng.random::<f64>()).sin()
                    }
                };
                x[i] = input.value + unit * input.standard_uncertainty;
            }
            model(&x)
        })
        .collect();
    Ok(Sampled::new(values))
}
