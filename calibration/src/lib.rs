//! Calibrations, certificates and inverse analysis: what makes counts newtons, set-points micrometres and
//! arrivals instants, each with an uncertainty that can be defended.
//!
//! | room | purpose |
//! |---|---|
//! | [`force`] | dead weights to a matrix; zeros; noise; dynamics |
//! | [`amplitude`] | drive to peak-to-peak amplitude; resonance; mode shape; droop |
//! | [`latency`] | delay and jitter of a channel; clocks |
//! | [`phase`] | contact phase shift of Eq. 1 from waveforms; the phase table |
//! | [`finger`] | stiffness and friction of a fingertip |
//! | [`identify`] | inverse analysis of Eq. 2: modulus, penalty and retardation time of the skin from a phase table |
//! | [`certificate`] | the file that a calibration leaves, and the gate before its use |
//! | [`prior`] | what certificates leave open, for the diagnosis |
//! | [`regression`], [`uncertainty`] | least squares; GUM and its Supplement 1 |
//!
//! The way through: data file -> a room's fit, which refuses what is unfit -> [`certificate::Outcome`] ->
//! [`certificate::Certificate`] (a sealed TOML file) -> [`certificate::Certificate::verify`] ->
//! [`force::apply::ForceCalibration`] or [`amplitude::apply::AmplitudeCalibration`] in the loop.
//!
//! ```
//! use muprime_calibration::uncertainty::{Budget, Input};
//!
//! // A dead weight: its mass by a certificate, and gravity known within 1e-4 m/s^2.
//! let budget = Budget::independent(vec![
//!     Input::normal("mass, kg", 0.1, 2e-6),
//!     Input::rectangular("gravity, m/s^2", 9.81, 1e-4),
//! ]);
//! let weight = budget.propagate(|x| x[0] * x[1]);
//! assert!((weight.value - 0.981).abs() < 1e-12);
//! assert!((weight.standard_uncertainty - 2.045e-5).abs() < 1e-8);
//! ```

pub mod amplitude;
pub mod certificate;
pub mod finger;
pub mod force;
pub mod identify;
pub mod latency;
pub mod phase;
pub mod prior;
pub mod regression;
pub mod uncertainty;
