//! Least squares: what every calibration here is made of.
//!
//! [`linear`] solves linear problems in double-double arithmetic, so that the answer carries the data's
//! uncertainty and none of the solver's (checked against NIST StRD, see `tests/nist.rs`). [`nonlinear`]
//! is a Levenberg-Marquardt for the few models that are not linear in their parameters.

pub mod double_double;
pub mod linear;
pub mod nonlinear;

use nalgebra::{DMatrix, DVector};

/// The result of a fit: estimates, their covariance, and what the model left.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// Parameter estimates, in the order of the design's columns.
    pub estimates: DVector<f64>,
    /// Covariance matrix of the estimates.
    pub covariance: DMatrix<f64>,
    /// Observation minus model, in the unit of the observations.
    pub residuals: DVector<f64>,
    /// Sum of squared residuals; of whitened residuals (chi squared) where a covariance was given.
    pub residual_sum_of_squares: f64,
    /// Observations minus parameters.
    pub degrees_of_freedom: f64,
}

impl Fit {
    /// Residual standard deviation `sqrt(RSS / nu)`; NaN without degrees of freedom.
    pub fn residual_sd(&self) -> f64 {
        (self.residual_sum_of_squares / self.degrees_of_freedom).sqrt()
    }

    /// The same, where it leaves so much less of these observations than their mean does that chance does not
    /// explain it. The F ratio is above ten: noise searched for its best frequency reaches three or four.
    ///
    /// # Errors
    /// [`FitError::Constant`].
    pub fn better_than_a_constant(self, observations: &[f64]) -> Result<Self, FitError> {
        let n = observations.len() as f64;
        let mean = observations.iter().sum::<f64>() / n;
        let constant = observations.iter().map(|y| (y - mean).powi(2)).sum::<f64>();
        let gained = (constant - self.residual_sum_of_squares) / (self.estimates.len() as f64 - 1.0);
        let ratio = gained * self.degrees_of_freedom / self.residual_sum_of_squares;
        // A fit without residuals has an infinite ratio, a constant that is fitted exactly none.
        if ratio > 10.0 { Ok(self) } else { Err(FitError::Constant { ratio }) }
    }

    /// Standard uncertainty of one parameter.
    pub fn standard_uncertainty(&self, parameter: usize) -> f64 {
        self.covariance[(parameter, parameter)].sqrt()
    }

    /// Standard uncertainty of `gradient . estimates`, for example of a prediction (GUM H.3.4).
    pub fn standard_uncertainty_along(&self, gradient: &[f64]) -> f64 {
        let g = DVector::from_column_slice(gradient);
        (g.transpose() * &self.covariance * &g)[(0, 0)].max(0.0).sqrt()
    }
}

/// The least and the greatest of some values.
pub(crate) fn ends(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
}

/// Why a fit gave no answer.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the message of an error says what its fields are")]
pub enum FitError {
    /// Fewer observations than parameters (or as many, where the scatter must be estimated).
    #[error("{observations} observations cannot determine {parameters} parameters and their scatter")]
    TooFew { observations: usize, parameters: usize },
    /// Columns of the design depend on each other.
    #[error("parameter {parameter} (counted from 0) cannot be separated from those before it")]
    Singular { parameter: usize },
    /// A number that is not finite went in or came out.
    #[error("a value is not finite ({place})")]
    NotFinite { place: &'static str },
    /// The observations are noise.
    #[error(
        "the model describes the values no better than a constant (F = {ratio:.1}, above 10 is needed): they are noise"
    )]
    Constant { ratio: f64 },
    /// The converter or the amplifier was at its end.
    #[error("the values are clipped at {end}, where they stay: take a larger range or a smaller force")]
    Clipped { end: f64 },
    /// The iteration of a non-linear fit did not settle.
    #[error("the fit did not converge in {iterations} iterations")]
    NotConverged { iterations: usize },
}
