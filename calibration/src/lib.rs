//! Calibrations, certificates and inverse analysis.

pub mod regression;
pub mod uncertainty;
