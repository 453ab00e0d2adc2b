//! Amplitude: drive set-point to the peak-to-peak amplitude of the plate, where the finger touches it.
//!
//! | module | purpose |
//! |---|---|
//! | [`vibrometer`] | range and delay of a vibrometer's decoder; waveform to amplitude |
//! | [`gain`] | set-point (or current) to amplitude |
//! | [`resonance`] | resonance and quality factor from a sweep |
//! | [`map`] | amplitude over position: the mode shape |
//! | [`droop`] | amplitude under load |
//! | [`apply`] | all of these in one certificate, and its use |
//!
//! Amplitudes are peak-to-peak throughout ([`models::quantity::PeakToPeak`]).

pub mod apply;
pub mod droop;
pub mod gain;
pub mod map;
pub mod resonance;
pub mod vibrometer;

use crate::regression::{Fit, FitError};

/// One amplitude as a vibrometer measured it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AmplitudePoint {
    /// What was set: set-point in m, drive current in A, frequency in Hz, position in m or load in N, as the
    /// module that takes the point says.
    pub at: f64,
    /// Measured peak-to-peak amplitude in m.
    pub amplitude_pp_m: f64,
}

/// Why points give no calibration.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the message of an error says what its fields are")]
pub enum AmplitudeError {
    /// Not enough points, or not spread enough.
    #[error("{what}: {found} are too few, {needed} are needed")]
    TooFew { what: &'static str, found: usize, needed: usize },
    /// A value that cannot be.
    #[error("point {row}: {reason}")]
    Bad { row: usize, reason: String },
    /// The amplitude stops growing with the set-point.
    #[error(
        "the amplitude saturates: from set-point {from:.4e} to {to:.4e} it grows by {share:.0} % of what the points \
         below predict; leave out what lies above, or lower the range"
    )]
    Saturated { from: f64, to: f64, share: f64 },
    /// The sweep does not reach both flanks of the resonance.
    #[error("the sweep does not hold the resonance: its maximum is at the {0} end; shift the range")]
    OffRange(&'static str),
    /// The model does not describe the points within their repeatability.
    #[error("the points do not follow the model (lack of fit p = {p:.1e}): {remedy}")]
    LackOfFit { p: f64, remedy: &'static str },
    /// The regression itself failed.
    #[error(transparent)]
    Fit(#[from] FitError),
}

/// Points with finite numbers and amplitudes that are not negative.
fn check(points: &[AmplitudePoint], what: &'static str, needed: usize) -> Result<(), AmplitudeError> {
    for (i, p) in points.iter().enumerate() {
        if !p.at.is_finite() || !p.amplitude_pp_m.is_finite() || p.amplitude_pp_m < 0.0 {
            let reason = format!("{} m at {} is not an amplitude", p.amplitude_pp_m, p.at);
            return Err(AmplitudeError::Bad { row: i + 1, reason });
        }
    }
    let mut places: Vec<f64> = points.iter().map(|p| p.at).collect();
    places.sort_by(f64::total_cmp);
    places.dedup();
    if places.len() < needed {
        return Err(AmplitudeError::TooFew { what, found: places.len(), needed });
    }
    Ok(())
}

/// A fit, or why there is none.
type FitResult = Result<Fit, FitError>;

/// A fit to amplitudes over their scatter: up to a factor, proportional to the amplitude (speckle, drive)
/// above a floor of a fifth of the largest (noise of the vibrometer). The scatter is that of the fitted curve:
/// by the measured amplitudes, those that scattered low would weigh more.
fn weighted(points: &[AmplitudePoint], fit: impl Fn(&[f64]) -> FitResult) -> FitResult {
    let scatter = |curve: Vec<f64>| -> Vec<f64> {
        let largest = curve.iter().fold(0f64, |m, w| m.max(w.abs()));
        curve.iter().map(|w| w.hypot(0.2 * largest)).collect()
    };
    let measured = scatter(points.iter().map(|p| p.amplitude_pp_m).collect());
    let first = fit(&measured)?;
    let left = first.residuals.iter().zip(&measured).map(|(r, s)| r * s);
    fit(&scatter(points.iter().zip(left).map(|(p, left)| p.amplitude_pp_m - left).collect()))
}

/// Lack of fit of weighted residuals against replicates at one place; `None` without enough replicates.
fn lack_of_fit(points: &[AmplitudePoint], weighted: &[f64], parameters: usize) -> Option<f64> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|a, b| points[*a].at.total_cmp(&points[*b].at));
    let groups = order.chunk_by(|a, b| points[*a].at == points[*b].at);
    let groups: Vec<Vec<f64>> = groups.map(|group| group.iter().map(|i| weighted[*i]).collect()).collect();
    crate::uncertainty::student::lack_of_fit(&groups, parameters)
}
