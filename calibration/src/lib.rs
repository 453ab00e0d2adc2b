//! Calibrations, certificates and inverse analysis.

pub mod certificate;
pub mod force;
pub mod regression;
pub mod uncertainty;
