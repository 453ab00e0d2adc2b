//! What a force sensor is besides its matrix, as a certificate: creep, orientation, noise, dynamics.

use crate::certificate::{BudgetLine, CalibrationResult, CertificateKind, Finding, Residuals, parameters};
use std::collections::BTreeMap;

/// The certificate's contents of a set of findings that were determined apart (their correlations are not stated).
pub fn outcome(
    model: &str,
    findings: &[Finding],
    residuals: Residuals,
    remarks: Vec<String>,
) -> CalibrationResult {
    let line = |f: &Finding| BudgetLine::a(format!("statistics of {}", f.name), f.estimate[1], &f.unit);
    let covariance = Finding::covariance(findings, &[]);
    CalibrationResult {
        kind: CertificateKind::Sensor,
        model: model.into(),
        settings: BTreeMap::new(),
        remarks,
        parameters: parameters(findings, &covariance),
        covariance,
        residuals,
        temperature_c: None,
        range: BTreeMap::new(),
        budget: findings.iter().map(line).collect(),
    }
}
