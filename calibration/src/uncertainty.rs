//! Measurement uncertainty by the GUM (JCGM 100:2008): type A evaluation; coverage factors in [`student`].
//!
//! `tests/gum.rs` reproduces the worked examples H.2 and H.3.

pub mod student;

/// A quantity with its uncertainty.
#[derive(Clone, Debug, PartialEq)]
pub struct Input {
    /// Best estimate.
    pub value: f64,
    /// Standard uncertainty, in the unit of the value.
    pub standard_uncertainty: f64,
    /// Degrees of freedom of that uncertainty; infinite where it is taken as known.
    pub degrees_of_freedom: f64,
}

impl Input {
    /// The mean of repeated observations with its type A uncertainty (GUM 4.2).
    /// With fewer than two observations the uncertainty is infinite: nothing is known of the scatter.
    pub fn type_a(observations: &[f64]) -> Self {
        let n = observations.len() as f64;
        let value = observations.iter().sum::<f64>() / n;
        let variance = observations.iter().map(|x| (x - value).powi(2)).sum::<f64>() / (n - 1.0);
        let standard_uncertainty = if n < 2.0 { f64::INFINITY } else { (variance / n).sqrt() };
        Input { value, standard_uncertainty, degrees_of_freedom: n - 1.0 }
    }
}
