//! Certificates of a setup: verified when the setup is read, applied once in the loop.
//!
//! A force certificate takes the counts of the force instruments and gives newtons with cross-talk taken off;
//! the profile's own scale and the setup's `gain` and `offset_n` then play no part. What certificates leave
//! open goes into rig.toml as `[calibration]`.

use crate::setup::SetupFile;
use calibration::certificate::{Certificate, Circumstances, Kind};
use calibration::force::apply::ForceCalibration;
use calibration::force::zero::Zero;
use calibration::prior::CalibrationPriors;
use realtime::ports::{ForceSensor, Forces, Nanos, Quality, Reading};
use std::path::Path;

/// What a setup's certificates come to.
#[derive(Clone, Debug, Default)]
pub struct Certificates {
    /// The force calibration with its zero.
    pub force: Option<(ForceCalibration, Zero)>,
    /// What remains uncertain, for rig.toml.
    pub priors: CalibrationPriors,
    /// The files, for the record.
    pub files: Vec<(String, String)>,
}

impl Certificates {
    /// Reads and verifies the certificates of a setup, at an instant in seconds since 1970.
    ///
    /// # Errors
    /// The first certificate that may not be used, with the reason; two of one kind; readings that would be
    /// scaled twice.
    pub fn load(file: &SetupFile, folder: &Path, now_unix_s: i64) -> Result<Self, String> {
        let mut all = Certificates::default();
        let mut seen: Vec<Kind> = Vec::new();
        for path in &file.certificates {
            let path = folder.join(path);
            let name = path.display().to_string();
            let fail = |problem: String| format!("certificate {name}: {problem}");
            let text = crate::input::text_of(&path).map_err(|e| e.to_string())?;
            let certificate = Certificate::from_toml(&text).map_err(|e| fail(e.to_string()))?;
            let kind = certificate.kind;
            if seen.contains(&kind) {
                return Err(fail(format!("there is another {kind} certificate; which one holds?")));
            }
            seen.push(kind);
            let serial = serial(file, kind).map_err(&fail)?.unwrap_or(certificate.instrument.serial.clone());
            let at = Circumstances { kind, serial: &serial, now_unix_s, temperature_c: None };
            let verified = certificate.verify(&at).map_err(|e| fail(e.to_string()))?;
            all.priors.take(verified).map_err(|e| fail(e.to_string()))?;
            if kind == Kind::Force {
                let axes = file.force.iter().flat_map(|i| [&i.lateral, &i.normal]).flatten();
                if axes.into_iter().any(|a| a.gain != 1.0 || a.offset_n != 0.0) {
                    return Err(fail(
                        "the setup scales the forces too (gain, offset_n): leave that to the certificate"
                            .into(),
                    ));
                }
                let calibration =
                    ForceCalibration::compile(verified, None).map_err(|e| fail(e.to_string()))?;
                all.force = Some((calibration, zero(file, &certificate)));
            }
            let kept = path.file_name().map_or(name.clone(), |n| n.to_string_lossy().into_owned());
            all.files.push((format!("certificates/{kept}"), text));
        }
        Ok(all)
    }

    /// The force port with the certificate applied, or the port itself where there is none.
    pub fn calibrated(&self, force: Box<dyn ForceSensor>) -> Box<dyn ForceSensor> {
        match self.force {
            None => force,
            Some((calibration, zero)) => Box::new(Calibrated { inner: force, calibration, zero }),
        }
    }
}

/// Serial number that a certificate of that kind must name; `None` where the setup has no such instrument.
fn serial(file: &SetupFile, kind: Kind) -> Result<Option<String>, String> {
    let stated: Vec<Option<&String>> = match kind {
        Kind::Force => file.force.iter().map(|i| i.serial.as_ref()).collect(),
        Kind::Amplitude => vec![file.amplifier.serial.as_ref()],
        Kind::Latency | Kind::Phase | Kind::Finger => return Ok(None),
    };
    let known: Option<Vec<&str>> = stated.into_iter().map(|s| s.map(String::as_str)).collect();
    match known {
        Some(serials) => Ok(Some(serials.join("+"))),
        None => Err(format!(
            "the setup must state the `serial` of the instrument that the {kind} certificate is for"
        )),
    }
}

/// The setup's stated zero, or the one that was found with the certificate. Neither is silent: the first
/// stands in the setup, the second in the certificate.
fn zero(file: &SetupFile, certificate: &Certificate) -> Zero {
    let found =
        |name: &str| certificate.parameter(name).map_or([0.0, 0.0], |p| [p.value, p.standard_uncertainty]);
    let [lateral, normal] = [found("lateral.offset"), found("normal.offset")];
    Zero {
        counts: file.zero_counts.unwrap_or([lateral[0], normal[0]]),
        standard_uncertainty: [lateral[1], normal[1]],
        time_s: 0.0,
    }
}

/// A force port around a force port: counts in, calibrated newtons out. No allocation, no lock.
struct Calibrated {
    inner: Box<dyn ForceSensor>,
    calibration: ForceCalibration,
    zero: Zero,
}

impl ForceSensor for Calibrated {
    fn read(&mut self, now: Nanos) -> Forces {
        let raw = self.inner.read(now);
        // Without one axis the cross-talk onto the other is unknown: then neither is a calibrated force.
        let (lateral, normal) = match (raw.lateral, raw.normal) {
            (Ok(lateral), Ok(normal)) => (lateral, normal),
            (Err(reason), _) | (_, Err(reason)) => return Forces::missing(reason),
        };
        let force = self.calibration.apply([lateral.raw as f64, normal.raw as f64], &self.zero);
        let beyond = !self.calibration.in_range(force);
        let with = |reading: Reading, value: f64| Reading {
            value,
            quality: if beyond && reading.quality == Quality::Good {
                Quality::Degraded
            } else {
                reading.quality
            },
            ..reading
        };
        Forces { lateral: Ok(with(lateral, force[0])), normal: Ok(with(normal, force[1])) }
    }
}
