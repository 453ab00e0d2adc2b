//! The fingertip: stiffness ([`stiffness`]) and friction without vibration ([`friction`]).
//!
//! The Young's modulus of the stratum corneum comes from a phase table by inverse analysis (Eq. 2), which
//! has its own module: [`crate::identify`].

pub mod friction;
pub mod springs;
pub mod stiffness;

use crate::certificate::{
    BudgetLine, CalibrationResult, CertificateKind, Finding, Parameter, Residuals, parameters,
};
use crate::identify::Identified;
use crate::identify::skin::{IdentifiedSkin, ProfileInterval};
use crate::regression::FitError;
use friction::FrictionFit;
use nalgebra::DMatrix;
use springs::Springs;
use std::collections::BTreeMap;
use stiffness::Stiffness;

/// Why there is no finger calibration.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the message of an error says what its fields are")]
pub enum FingerError {
    /// Not enough data.
    #[error("{what}: {found} are too few, {needed} are needed")]
    TooFew { what: &'static str, found: usize, needed: usize },
    /// A row that cannot be.
    #[error("row {row}: {reason}")]
    Bad { row: usize, reason: String },
    /// The plate left the finger.
    #[error(
        "at {amplitude_pp_m:.3e} m peak-to-peak the contact is lost (half of it exceeds Fn/kn = {limit_m:.3e} m): the \
         ultrasonic stiffness is defined in full contact; use smaller amplitudes or more load"
    )]
    ContactLost { amplitude_pp_m: f64, limit_m: f64 },
    /// A stiffness that is not positive.
    #[error("the {0} stiffness comes out negative: check the sign of force and displacement")]
    Negative(&'static str),
    /// A finger that gives energy to the plate.
    #[error(
        "the quadrature force is negative beyond its scatter: a finger cannot drive the plate; check the sign of the \
         quadrature (a quarter period ahead of the displacement is positive) and the delay between the channels"
    )]
    NegativeLoss,
    /// Passes that the spring-slider does not explain.
    #[error(
        "the spring-slider does not explain the {passes} passes: chi-square {reduced_chi2:.1} a degree of freedom (p < \
         0.001), so its stiffnesses would be those of a law that does not hold; run `muprime diagnose` on the run first and \
         use passes where the model holds, or state what the rig repeats to (--pass-relative-sd, --pass-force-sd-n)"
    )]
    Misfit { reduced_chi2: f64, passes: usize },
    /// The regression failed.
    #[error(transparent)]
    Fit(#[from] FitError),
}

/// Refuses what is not enough of something.
fn enough(what: &'static str, found: usize, needed: usize) -> Result<(), FingerError> {
    if found < needed { Err(FingerError::TooFew { what, found, needed }) } else { Ok(()) }
}

/// What was measured of a fingertip; each part may be missing.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct FingerFit {
    /// Named stiffnesses: `normal_quasi_static`, `lateral_quasi_static`, `normal_ultrasonic`, `lateral_ultrasonic`.
    pub stiffness: Vec<(String, Stiffness)>,
    /// Friction without vibration.
    pub friction: Option<FrictionFit>,
    /// Both stiffnesses and their ratio from passes with vibration.
    pub springs: Option<Springs>,
    /// Modulus of the stratum corneum from a phase table (Eq. 2).
    pub modulus: Option<Identified>,
    /// The same with penalty and retardation time free.
    pub skin: Option<IdentifiedSkin>,
}

impl FingerFit {
    /// Everything that the certificate states.
    pub fn outcome(&self) -> CalibrationResult {
        let mut parts = Parts::default();
        self.stiffness.iter().for_each(|(name, stiffness)| parts.stiffness(name, stiffness));
        let mut settings = BTreeMap::new();
        if let Some(friction) = &self.friction {
            parts.friction(friction);
            settings.insert("reference_force_n".into(), friction.reference_force_n.to_string());
            settings.insert("reference_speed_m_s".into(), friction.reference_speed_m_s.to_string());
        }
        self.springs.iter().for_each(|springs| parts.springs(springs));
        self.modulus.iter().for_each(|modulus| parts.modulus(modulus, self.skin.as_ref()));
        let Parts { findings, blocks, ends, range, budget, mut remarks, residuals } = parts;
        let covariance = Finding::covariance(&findings, &blocks);
        let parameters: Vec<_> = parameters(&findings, &covariance)
            .into_iter()
            .zip(&ends)
            .map(|(parameter, ends)| match ends {
                Ends::Free => parameter,
                Ends::AtLeast(least) => parameter.at_least(*least),
                Ends::Both(ci95) => Parameter { ci95: *ci95, ..parameter },
            })
            .collect();
        for (p, ends) in parameters.iter().zip(&ends) {
            if matches!(ends, Ends::AtLeast(least) if p.ci95[0] == *least) {
                remarks.push(format!(
                    "{}: the data give an upper bound only ({:.3e} {}); the interval begins where the quantity does",
                    p.name, p.ci95[1], p.unit
                ));
            }
        }
        CalibrationResult {
            kind: CertificateKind::Finger,
            model: "F = F0 + k (x - x0) + loop; F1 = (k' + i k'') a in full contact; \
                    ln mu0 = ln m + (n - 1) ln(F/F0) + s ln(U/U0) + ln(1 + g (1 - exp(-t/tau)))"
                .into(),
            settings,
            remarks,
            parameters,
            covariance,
            residuals,
            temperature_c: None,
            range,
            budget,
        }
    }
}

/// What the parts of a calibration add to the certificate, one after the other.
#[derive(Default)]
struct Parts {
    findings: Vec<Finding>,
    /// Covariances of findings that were fitted together, from the first of each.
    blocks: Vec<(usize, DMatrix<f64>)>,
    /// Intervals that are not value +- k u: where each begins at the earliest, or the whole of it.
    ends: Vec<Ends>,
    range: BTreeMap<String, [f64; 2]>,
    budget: Vec<BudgetLine>,
    remarks: Vec<String>,
    /// Counts all rows; the rest is that of the last part.
    residuals: Residuals,
}

impl Parts {
    fn residuals(&mut self, count: usize, sd: f64, largest: f64, unit: &str) {
        let count = self.residuals.count + count as u64;
        self.residuals = Residuals { count, sd, largest, unit: unit.into(), lack_of_fit_p: None };
    }

    /// A finding whose interval comes from a profile of the likelihood.
    fn profiled(&mut self, name: &'static str, unit: &'static str, value: f64, ci95: [f64; 2], dof: f64) {
        // It is not symmetric; the certificate's standard uncertainty is that of its half-width.
        let sd = 0.5 * (ci95[1] - ci95[0]) / 1.96;
        self.findings.push(Finding::new(name, unit, [value, sd], dof.max(1.0)));
        self.ends.push(Ends::Both(ci95));
    }

    fn stiffness(&mut self, name: &str, s: &Stiffness) {
        let dof = s.degrees_of_freedom;
        self.findings.push(Finding::new(format!("{name}.stiffness"), "N/m", s.value_n_per_m, dof));
        self.findings.push(Finding::new(format!("{name}.loss_tangent"), "1", s.loss_tangent, dof));
        self.ends.extend([Ends::AtLeast(0.0); 2]);
        let source = format!("{name}: force and displacement calibration");
        self.budget.push(BudgetLine::b(source, s.scale_relative_sd, "1"));
        self.range.insert(format!("{name}.displacement_m"), s.range_m);
        self.residuals(s.points, s.residual_sd_n, s.largest_residual_n, "N");
    }

    fn friction(&mut self, f: &FrictionFit) {
        self.blocks.push((self.findings.len(), f.fit.covariance.clone()));
        for (i, (name, unit)) in f.names().into_iter().enumerate() {
            // mu0 (1 + growth) is the coefficient of friction in the end: it cannot be negative.
            self.ends.push(if name.ends_with(".growth") { Ends::AtLeast(-1.0) } else { Ends::Free });
            let estimate = [f.fit.estimates[i], f.fit.standard_uncertainty(i)];
            self.findings.push(Finding::new(name, unit, estimate, f.fit.degrees_of_freedom));
        }
        let residuals = &f.fit.residuals;
        self.residuals(residuals.len(), f.fit.residual_sd(), residuals.amax(), "1 (of ln mu0)");
        self.range.extend(f.range());
        self.remarks.extend(f.remarks());
    }

    fn springs(&mut self, s: &Springs) {
        let normal = (s.normal_stiffness_n_per_m, s.normal_ci95_n_per_m, s.normal_closed);
        let ratio = (s.lateral_over_normal, s.ratio_ci95, s.ratio_closed);
        let fits =
            [("sweep.normal_stiffness", "N/m", normal), ("sweep.lateral_over_normal_stiffness", "1", ratio)];
        for (name, unit, (value, ci95, closed)) in fits {
            if closed == [true; 2] {
                self.profiled(name, unit, value, ci95, s.passes as f64 - 3.0);
            } else {
                let [low, high] = [0, 1].map(|i| end(ci95[i], closed[i]));
                self.remarks.push(format!(
                    "{name}: {value:.3e} {unit}, but the passes leave its interval open: {low} to {high}"
                ));
            }
        }
        self.remarks.push(format!(
            "the sweep's stiffnesses are those of the spring-slider that fits {} passes best, chi-square {:.2} a degree of freedom",
            s.passes, s.reduced_chi2
        ));
        if s.left_out > 0 {
            self.remarks.push(format!(
                "{} passes were left out: without a force, or at a condition that the slider does not take",
                s.left_out
            ));
        }
        self.residuals(s.passes, s.residual_rms_n, s.residual_largest_n, "N");
    }

    /// Elastic skin where that will do, as the paper has it; otherwise the skin with all three free. Penalty
    /// and time are parameters only where both ends of their interval were found.
    fn modulus(&mut self, elastic: &Identified, skin: Option<&IdentifiedSkin>) {
        let dof = elastic.points as f64 - 1.0;
        let (value, ci95) = match skin {
            Some(skin) if !skin.elastic_will_do() => (skin.young_modulus_pa.best, skin.young_modulus_pa.ci95),
            _ => (elastic.young_modulus_pa, elastic.ci95_pa),
        };
        self.profiled("stratum_corneum.young_modulus", "Pa", value, ci95, dof);
        self.residuals(elastic.points, elastic.residual_deg[0], elastic.residual_deg[1], "deg");
        self.remarks.push(format!(
            "modulus of elastic skin: {:.3e} Pa, 95 % profile interval {:.3e} to {:.3e} Pa, residual {:.1} deg rms",
            elastic.young_modulus_pa, elastic.ci95_pa[0], elastic.ci95_pa[1], elastic.residual_deg[0]
        ));
        let mut cannot = elastic.cannot_tell.clone();
        if let Some(skin) = skin {
            let gain = skin.chi2_elastic - skin.chi2;
            let verdict =
                if skin.elastic_will_do() { "elastic skin will do" } else { "elastic skin does not fit" };
            self.remarks.push(format!(
                "{verdict}: freeing penalty and retardation time lowers chi-square by {gain:.1} to {:.1}",
                skin.chi2
            ));
            let quantities: [(&str, &str, &'static str, &ProfileInterval); 3] = [
                ("modulus", " Pa", "", &skin.young_modulus_pa),
                ("penalty over modulus", "", "stratum_corneum.penalty_ratio", &skin.penalty_ratio),
                ("retardation time", " s", "stratum_corneum.retardation_time", &skin.retardation_time_s),
            ];
            for (quantity, unit, parameter, profile) in quantities {
                let [low, high] = [0, 1].map(|i| end(profile.ci95[i], profile.closed[i]));
                self.remarks.push(format!(
                    "all three free: {quantity} {:.3e}{unit}, 95 % profile interval {low} to {high}{unit}{}",
                    profile.best,
                    if profile.gaps { ", with gaps" } else { "" }
                ));
                if !parameter.is_empty() && profile.closed == [true; 2] && !profile.gaps {
                    let unit = if unit.is_empty() { "1" } else { "s" };
                    self.profiled(parameter, unit, profile.best, profile.ci95, dof);
                }
            }
            cannot.extend(skin.cannot_tell.iter().cloned());
        }
        self.remarks.extend(cannot.iter().map(|what| format!("the phases cannot tell {what}")));
        let else_wrong = "a wrong mean pressure or damping of the model: it would shift the modulus";
        self.remarks.push(format!("the phases cannot tell {else_wrong} without a trace in the misfit"));
    }
}

/// What is known of the ends of a parameter's interval.
#[derive(Clone, Copy, Debug)]
enum Ends {
    /// Value and uncertainty tell them.
    Free,
    /// The quantity cannot be less.
    AtLeast(f64),
    /// Both limits come from a profile of the likelihood.
    Both([f64; 2]),
}

/// An end of a profile interval, in words.
fn end(value: f64, closed: bool) -> String {
    format!("{value:.3e}{}", if closed { "" } else { " (end of the range searched)" })
}
