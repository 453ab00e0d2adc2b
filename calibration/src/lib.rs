//! Calibrations, certificates and inverse analysis.
