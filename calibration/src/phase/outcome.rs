//! The certificate of a phase calibration.

use super::RepeatedShift;
use crate::certificate::{BudgetLine, CalibrationResult, CertificateKind, Finding, Residuals, parameters};
use crate::regression::ends;
use models::PeakToPeak;
use nalgebra::DMatrix;
use std::collections::BTreeMap;

/// Circumstances that all repeats share.
#[derive(Clone, Debug, PartialEq)]
pub struct Acquisition {
    /// Frequency of the drive in Hz.
    pub frequency_hz: f64,
    /// Standard uncertainty of the difference of the decoders' delays in s.
    pub delay_sd_s: f64,
    /// Moist, dry or free text.
    pub condition: Option<String>,
    /// Normal force in N.
    pub normal_force_n: Option<f64>,
}

/// Everything that a phase certificate states: one parameter an amplitude.
pub fn outcome(found: &[(PeakToPeak, RepeatedShift)], at: &Acquisition) -> CalibrationResult {
    let finding = |(w, f): &(PeakToPeak, RepeatedShift)| {
        let (phase, name) = (&f.phase_deg, format!("phase_at_{:.3}_um_pp", w.micrometres()));
        Finding::new(name, "deg", [phase.value, phase.standard_uncertainty], phase.degrees_of_freedom)
    };
    let findings: Vec<Finding> = found.iter().map(finding).collect();
    // The delays' doubt turns all phases alike.
    let common = (360.0 * at.frequency_hz * at.delay_sd_s).powi(2);
    let covariance = DMatrix::from_fn(found.len(), found.len(), |i, j| {
        if i == j { found[i].1.phase_deg.standard_uncertainty.powi(2) } else { common }
    });
    let range = ends(found.iter().map(|(w, _)| w.metres()));
    let largest = found.iter().map(|(_, f)| f.repeat_sd_deg).fold(0.0, f64::max);
    let doubled = found.iter().filter(|(_, f)| f.period_doubled > 0);
    let doubled = doubled
        .map(|(w, f)| format!("the period doubled at {w} in {} of {} repeats", f.period_doubled, f.repeats));
    let few = found.iter().filter(|(_, f)| f.repeats < 10);
    let few = few.map(|(w, f)| format!("{} repeats at {w}; the paper takes 10", f.repeats));
    let mut settings = BTreeMap::from([("frequency_hz".to_string(), at.frequency_hz.to_string())]);
    settings.extend(at.condition.iter().map(|c| ("condition".to_string(), c.clone())));
    settings.extend(at.normal_force_n.iter().map(|f| ("normal_force_n".to_string(), f.to_string())));
    CalibrationResult {
        kind: CertificateKind::Phase,
        model: "Phi = 360 |t_pa - t_sa| / T (Eq. 1), mean on the circle over repeats".into(),
        settings,
        remarks: doubled.chain(few).collect(),
        parameters: parameters(&findings, &covariance),
        covariance,
        residuals: Residuals {
            count: found.iter().map(|(_, f)| f.repeats as u64).sum(),
            sd: (found.iter().map(|(_, f)| f.repeat_sd_deg.powi(2)).sum::<f64>() / found.len() as f64).sqrt(),
            largest,
            unit: "deg (sd of a repeat)".into(),
            lack_of_fit_p: None,
        },
        temperature_c: None,
        range: BTreeMap::from([("amplitude_pp_m".into(), range)]),
        budget: vec![BudgetLine::b("delays of the decoders, common to all", common.sqrt(), "deg")],
    }
}
