//! Calibrations, certificates and inverse analysis: what makes counts newtons, set-points micrometres and
//! arrivals instants, each with an uncertainty that can be defended.
//!
//! | module | purpose |
//! |---|---|
//! | [`force`] | dead weights to a matrix; zeros; noise; dynamics |
//! | [`amplitude`] | drive to peak-to-peak amplitude; resonance; mode shape; droop |
//! | [`latency`] | delay and jitter of a channel; clocks |
//! | [`phase`] | contact phase shift of Eq. 1 from waveforms; the phase table |
//! | [`finger`] | stiffness and friction of a fingertip |
//! | [`identify`] | inverse analysis of Eq. 2: modulus, penalty and retardation time of the skin from a phase table |
//! | [`certificate`] | the file that a calibration leaves, and the gate before its use |
//! | [`prior`] | what certificates leave open, for the diagnosis |
//! | [`regression`], [`uncertainty`] | least squares; GUM |
//! | `rows` | rows of a CSV table, with the column of what cannot be read |
//!
//! The way through: data file -> a module's fit, which refuses what is unfit ->
//! [`certificate::CalibrationResult`] -> [`certificate::Certificate`] (a sealed TOML file) ->
//! [`certificate::Certificate::verify`] -> in the loop: [`force::apply::ForceCalibration`] or
//! [`amplitude::apply::AmplitudeCalibration`].

pub mod amplitude;
pub mod certificate;
pub mod finger;
pub mod force;
pub mod identify;
pub mod latency;
pub mod phase;
pub mod prior;
pub mod regression;
mod rows;
pub mod uncertainty;
