//! What a force sensor is besides its matrix, as a certificate: creep, orientation, noise, dynamics.

use crate::certificate::{BudgetLine, Evaluation, Kind, Outcome, Parameter, Residuals};
use crate::uncertainty::student::coverage_factor;
use nalgebra::DMatrix;
use std::collections::BTreeMap;

/// One finding: name, unit, value with standard uncertainty, degrees of freedom.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// Name of the parameter.
    pub name: String,
    /// Unit of the value.
    pub unit: &'static str,
    /// Value and standard uncertainty.
    pub estimate: [f64; 2],
    /// Degrees of freedom of the uncertainty.
    pub degrees_of_freedom: f64,
}

impl Finding {
    /// A finding.
    pub fn new(name: impl Into<String>, unit: &'static str, estimate: [f64; 2], dof: f64) -> Self {
        Finding { name: name.into(), unit, estimate, degrees_of_freedom: dof }
    }
}

/// The certificate's contents of a set of findings that were determined apart (their correlations are not stated).
pub fn outcome(model: &str, findings: &[Finding], residuals: Residuals, remarks: Vec<String>) -> Outcome {
    let parameter = |f: &Finding| {
        let [value, u] = f.estimate;
        let half = u * coverage_factor(0.95, f.degrees_of_freedom);
        Parameter {
            name: f.name.clone(),
            value,
            unit: f.unit.into(),
            standard_uncertainty: u,
            degrees_of_freedom: f.degrees_of_freedom,
            ci95: [value - half, value + half],
        }
    };
    let line = |f: &Finding| {
        BudgetLine::new(format!("statistics of {}", f.name), Evaluation::A, f.estimate[1], f.unit)
    };
    let n = findings.len();
    Outcome {
        kind: Kind::Sensor,
        model: model.into(),
        settings: BTreeMap::new(),
        remarks,
        parameters: findings.iter().map(parameter).collect(),
        covariance: DMatrix::from_fn(n, n, |i, k| if i == k { findings[i].estimate[1].powi(2) } else { 0.0 }),
        residuals,
        temperature_c: None,
        range: BTreeMap::new(),
        budget: findings.iter().map(line).collect(),
    }
}
