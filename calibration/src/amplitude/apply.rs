//! One certificate for the amplitude, and its use.

use super::droop::{Droop, Exponent};
use super::gain::GainFit;
use super::map::ModeShape;
use super::resonance::Resonance;
use crate::certificate::{
    BudgetLine, CalibrationResult, CertificateKind, Finding, Refusal, Residuals, Verified, parameters,
};
use models::PeakToPeak;
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// What was measured; the gain is always needed.
#[derive(Clone, Debug, PartialEq)]
pub struct AmplitudeFit {
    /// Set-point to amplitude at the place of the table, without load.
    pub gain: GainFit,
    /// Unit of the set-point: `m` (peak-to-peak) or `A`.
    pub set_point_unit: String,
    /// Where on the stroke the table was taken, in m.
    pub table_at_m: f64,
    /// Relative standard uncertainty of the vibrometer.
    pub vibrometer_relative_sd: f64,
    /// Resonance, where a sweep was made.
    pub resonance: Option<Resonance>,
    /// Mode shape, where a map was made.
    pub mode_shape: Option<ModeShape>,
    /// Droop, where loads were put on.
    pub droop: Option<Droop>,
}

impl AmplitudeFit {
    /// Everything that the certificate states.
    pub fn outcome(&self) -> CalibrationResult {
        let gain = &self.gain;
        let covariance = &gain.fit.covariance + &gain.type_b;
        let gained = |(i, (name, unit)): (usize, (String, String))| {
            let dof =
                gain.fit.degrees_of_freedom * (covariance[(i, i)] / gain.fit.covariance[(i, i)]).powi(2);
            Finding::new(name, unit, [gain.fit.estimates[i], covariance[(i, i)].sqrt()], dof)
        };
        let names = gain.form.names(&self.set_point_unit);
        let mut findings: Vec<Finding> = names.into_iter().enumerate().map(gained).collect();
        let mut blocks = vec![(0, covariance)];
        let mut remarks = Vec::new();
        let mut settings = BTreeMap::from([
            ("set_point_unit".into(), self.set_point_unit.clone()),
            ("table_at_m".into(), self.table_at_m.to_string()),
        ]);
        let mut range = BTreeMap::from([("set_point".into(), gain.range)]);
        if let Some(r) = &self.resonance {
            findings.push(Finding::new("resonance_hz", "Hz", r.frequency_hz, r.degrees_of_freedom));
            findings.push(Finding::new("quality_factor", "1", r.quality_factor, r.degrees_of_freedom));
        } else {
            remarks.push("no sweep: resonance and quality factor were not determined".into());
        }
        if let Some(m) = &self.mode_shape {
            let dof = m.fit.degrees_of_freedom;
            blocks.push((findings.len(), m.fit.covariance.view((1, 1), (3, 3)).into_owned()));
            findings.push(Finding::new("mode.antinode_at_m", "m", m.antinode_at_m, dof));
            findings.push(Finding::new("mode.wavelength_m", "m", m.wavelength_m, dof));
            findings.push(Finding::new("mode.standing_share", "1", m.standing_share, dof));
            range.insert("position_m".into(), m.range_m);
        } else {
            remarks.push("no map: the amplitude was measured at one place of the stroke only".into());
        }
        if let Some(d) = &self.droop {
            let unit = if d.exponent == Exponent::Hertz { "1/N^(2/3)" } else { "1/N" };
            findings.push(Finding::new("droop", unit, d.coefficient, d.fit.degrees_of_freedom));
            settings.insert("droop_exponent".into(), d.exponent.value().to_string());
            range.insert("normal_force_n".into(), [0.0, d.largest_n]);
        } else {
            remarks.push("no loads: the amplitude was measured without a finger only".into());
        }
        let sd = gain.fit.residual_sd();
        let covariance = Finding::covariance(&findings, &blocks);
        CalibrationResult {
            kind: CertificateKind::Amplitude,
            model:
                "w(s, x, F) = (gain s [+ offset] [+ bend s^2]) shape(x) / shape(x_table) / (1 + droop F^p), \
                    shape(x) = 1 - d + d |cos(2 pi (x - x0) / lambda)|, w peak-to-peak"
                    .into(),
            settings,
            remarks,
            parameters: parameters(&findings, &covariance),
            covariance,
            residuals: Residuals {
                count: gain.fit.residuals.len() as u64,
                sd,
                largest: gain.fit.residuals.amax(),
                unit: "1 (relative to the amplitude)".into(),
                lack_of_fit_p: gain.lack_of_fit_p,
            },
            temperature_c: None,
            range,
            budget: vec![
                BudgetLine::b("vibrometer, common to all points", self.vibrometer_relative_sd, "1"),
                BudgetLine::a(
                    "repeatability of the gain",
                    gain.fit.standard_uncertainty(0) / gain.fit.estimates[0].abs(),
                    "1",
                ),
            ],
        }
    }
}

/// The calibration in use, from a verified certificate only, without allocation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AmplitudeCalibration {
    gain: f64,
    offset: f64,
    bend: f64,
    /// Relative standard uncertainty of the gain: what the diagnosis takes as `amplitude_gain_sd`.
    pub gain_relative_sd: f64,
}

impl AmplitudeCalibration {
    /// Compiles a verified amplitude certificate.
    ///
    /// # Errors
    /// A missing gain, or a table that was taken at a node.
    pub fn compile(verified: Verified) -> Result<Self, Refusal> {
        let c = verified.certificate();
        let malformed = |reason: &str| Refusal::Malformed { reason: reason.into() };
        let value = |name: &str| c.parameter(name).map(|p| p.value);
        let gain = c
            .parameter("gain")
            .filter(|p| p.value > 0.0)
            .ok_or_else(|| malformed("its gain is missing or not positive"))?;
        let setting = |name: &str| c.settings.get(name).and_then(|s| s.parse::<f64>().ok());
        let wave_number = value("mode.wavelength_m").map_or(0.0, |l| 2.0 * PI / l);
        let antinode_at_m = value("mode.antinode_at_m").unwrap_or(0.0);
        let table_at = setting("table_at_m").unwrap_or(0.0);
        let standing_share = value("mode.standing_share").unwrap_or(0.0);
        let table_relative =
            1.0 - standing_share * (1.0 - (wave_number * (table_at - antinode_at_m)).cos().abs());
        if table_relative < 0.05 {
            return Err(malformed("its table was taken at a node of the plate"));
        }
        Ok(AmplitudeCalibration {
            gain: gain.value,
            offset: value("offset").unwrap_or(0.0),
            bend: value("bend").unwrap_or(0.0),
            gain_relative_sd: gain.standard_uncertainty / gain.value,
        })
    }

    /// Peak-to-peak amplitude of the free plate at the table's place for a set-point.
    pub fn free_amplitude(&self, set_point: f64) -> PeakToPeak {
        let free = self.gain * set_point + self.offset + self.bend * set_point * set_point;
        PeakToPeak::from_metres(free.max(0.0))
    }

    /// The set-point for an amplitude of the free plate at the table's place: the inverse of
    /// [`AmplitudeCalibration::free_amplitude`]. `None` beyond where a bent curve still rises.
    pub fn free_set_point(&self, amplitude: PeakToPeak) -> Option<f64> {
        let free = amplitude.metres() - self.offset;
        if self.bend == 0.0 {
            return Some(free / self.gain);
        }
        let root = self.gain * self.gain + 4.0 * self.bend * free;
        (root > 0.0).then(|| 2.0 * free / (self.gain + root.sqrt()))
    }
}
