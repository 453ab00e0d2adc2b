//! The fingertip: stiffness ([`stiffness`]) and friction without vibration ([`friction`]).
//!
//! The Young's modulus of the stratum corneum comes from a phase table by inverse analysis (Eq. 2), which
//! is a room of its own.

pub mod friction;
pub mod stiffness;

use crate::amplitude::apply::block_diagonal;
use crate::certificate::{BudgetLine, Evaluation, Kind, Outcome, Residuals, parameters};
use crate::identify::Identified;
use crate::regression::FitError;
use friction::FrictionFit;
use nalgebra::DMatrix;
use std::collections::BTreeMap;
use stiffness::Stiffness;

/// Why there is no finger calibration.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FingerError {
    /// Not enough data.
    #[error("{what}: {found} are too few, {needed} are needed")]
    TooFew {
        /// Of what.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// How many it takes.
        needed: usize,
    },
    /// A row that cannot be.
    #[error("row {row}: {reason}")]
    Bad {
        /// Number of the row, from 1.
        row: usize,
        /// What is wrong.
        reason: String,
    },
    /// The plate left the finger.
    #[error(
        "at {amplitude_pp_m:.3e} m peak-to-peak the contact is lost (half of it exceeds Fn/kn = {limit_m:.3e} m): the \
         ultrasonic stiffness is defined in full contact; use smaller amplitudes or more load"
    )]
    ContactLost {
        /// Largest amplitude, peak-to-peak.
        amplitude_pp_m: f64,
        /// Static indentation in m.
        limit_m: f64,
    },
    /// A stiffness that is not positive.
    #[error("the {0} stiffness comes out negative: check the sign of force and displacement")]
    Negative(&'static str),
    /// The regression failed.
    #[error(transparent)]
    Fit(#[from] FitError),
}

/// What was measured of a fingertip; each part may be missing.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct FingerFit {
    /// Named stiffnesses: `normal_quasi_static`, `lateral_quasi_static`, `normal_ultrasonic`, `lateral_ultrasonic`.
    pub stiffness: Vec<(String, Stiffness)>,
    /// Friction without vibration.
    pub friction: Option<FrictionFit>,
    /// Modulus of the stratum corneum from a phase table (Eq. 2).
    pub modulus: Option<Identified>,
}

impl FingerFit {
    /// Everything that the certificate states.
    pub fn outcome(&self) -> Outcome {
        let mut names: Vec<(String, &str)> = Vec::new();
        let (mut values, mut dofs, mut blocks) = (Vec::new(), Vec::new(), Vec::new());
        let mut range = BTreeMap::new();
        let mut budget = Vec::new();
        let mut count = 0;
        let (mut sd, mut largest, mut unit) = (0.0, 0.0, String::new());
        for (name, s) in &self.stiffness {
            names.push((format!("{name}.stiffness"), "N/m"));
            values.push(s.value_n_per_m[0]);
            dofs.push(s.degrees_of_freedom);
            blocks.push(DMatrix::from_element(1, 1, s.value_n_per_m[1].powi(2)));
            names.push((format!("{name}.loss_tangent"), "1"));
            values.push(s.loss_tangent[0]);
            dofs.push(s.degrees_of_freedom);
            blocks.push(DMatrix::from_element(1, 1, s.loss_tangent[1].powi(2)));
            budget.push(BudgetLine {
                source: format!("{name}: force and displacement calibration"),
                evaluation: Evaluation::B,
                standard_uncertainty: s.scale_relative_sd,
                unit: "1".into(),
            });
            range.insert(format!("{name}.displacement_m"), s.range_m);
            count += s.points as u64;
            (sd, largest, unit) = (s.residual_sd_n, s.largest_residual_n, "N".into());
        }
        let mut remarks = Vec::new();
        if let Some(f) = &self.friction {
            for (i, (name, u)) in f.names().into_iter().enumerate() {
                names.push((name, u));
                values.push(f.fit.estimates[i]);
                dofs.push(f.fit.degrees_of_freedom);
            }
            blocks.push(f.fit.covariance.clone());
            count += f.fit.residuals.len() as u64;
            (sd, largest, unit) = (f.fit.residual_sd(), f.fit.residuals.amax(), "1 (of ln mu0)".into());
            range.extend(f.range());
            remarks.extend(f.remarks());
        }
        if let Some(m) = &self.modulus {
            names.push(("stratum_corneum.young_modulus".into(), "Pa"));
            values.push(m.young_modulus_pa);
            dofs.push((m.points as f64 - 1.0).max(1.0));
            // The profile interval is not symmetric; the certificate's uncertainty is its half-width.
            let sd = 0.5 * (m.ci95_pa[1] - m.ci95_pa[0]) / 1.96;
            blocks.push(DMatrix::from_element(1, 1, sd * sd));
            count += m.points as u64;
            remarks.push(format!(
                "modulus: 95 % profile interval {:.3e} to {:.3e} Pa, residual {:.1} deg rms",
                m.ci95_pa[0],
                m.ci95_pa[1],
                (m.objective_deg2 / m.points as f64).sqrt()
            ));
            remarks.extend(m.cannot_tell.iter().map(|what| format!("the phases cannot tell {what}")));
        }
        let covariance = block_diagonal(&blocks);
        let mut settings = BTreeMap::new();
        if let Some(f) = &self.friction {
            settings.insert("reference_force_n".into(), f.reference_force_n.to_string());
            settings.insert("reference_speed_m_s".into(), f.reference_speed_m_s.to_string());
        }
        Outcome {
            kind: Kind::Finger,
            model: "F = F0 + k (x - x0) + loop; F1 = (k' + i k'') a in full contact; \
                    ln mu0 = ln m + (n - 1) ln(F/F0) + s ln(U/U0) + ln(1 + g (1 - exp(-t/tau)))"
                .into(),
            settings,
            remarks,
            parameters: parameters(&names, &values, &covariance, &dofs),
            covariance,
            residuals: Residuals { count, sd, largest, unit, lack_of_fit_p: None },
            temperature_c: None,
            range,
            budget,
        }
    }
}
