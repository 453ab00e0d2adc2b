//! Calibrations, certificates and inverse analysis.

pub mod amplitude;
pub mod certificate;
pub mod force;
pub mod latency;
pub mod phase;
pub mod regression;
pub mod uncertainty;
