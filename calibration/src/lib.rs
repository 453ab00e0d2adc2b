//! Calibrations, certificates and inverse analysis.

pub mod certificate;
pub mod regression;
pub mod uncertainty;
