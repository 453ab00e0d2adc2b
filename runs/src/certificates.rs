//! Certificates of a setup: verified when the setup is read, applied once in the loop.
//!
//! A force certificate takes the counts of the force instruments and gives newtons with cross-talk taken off;
//! the profile's own scale and the setup's `gain` and `offset_n` then play no part. An amplitude certificate
//! turns the requested amplitude into the amplifier's set-point, and what the amplifier reads back into the
//! plate's true amplitude: every amplitude in the loop, its limits and its record is then the plate's. What
//! certificates leave open goes into rig.toml as `[calibration]`.

pub mod temperature;

use crate::setup::SetupFile;
use calibration::amplitude::apply::AmplitudeCalibration;
use calibration::certificate::{Certificate, CertificateKind, Circumstances, Verified};
use calibration::force::apply::ForceCalibration;
use calibration::force::zero::Zero;
use models::{Calibration, PeakToPeak};
use realtime::Ports;
use realtime::ports::{Amplifier, AmplifierState, ForceSensor, Forces, Nanos, NoData, Quality, Sample};
use realtime::safety::DriveCommand;
use std::path::Path;
use temperature::TemperatureRange;

/// Amplitude over set-point that a drive whose set-point is an amplitude may have. A factor of two is no
/// gain, it is a single amplitude taken for peak-to-peak.
const PLAUSIBLE: (f64, f64) = (0.55, 1.8);

/// What a setup's certificates come to.
#[derive(Clone, Debug, Default)]
pub struct Certificates {
    /// The force calibration with its zero.
    pub force: Option<(ForceCalibration, Zero)>,
    /// The amplitude calibration of a drive whose set-point is an amplitude.
    pub amplitude: Option<AmplitudeCalibration>,
    /// The gain in m per unit of a drive whose set-point is a current.
    pub amplitude_m_per_unit: Option<f64>,
    /// Ranges of temperature that the amplifier's own channel is compared with while the rig runs.
    pub temperature_ranges: Vec<TemperatureRange>,
    /// What remains uncertain, and which file says so, for rig.toml.
    pub calibration: Calibration,
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
        all.calibration.speed_gain_sd = file.speed_gain_sd;
        let mut seen: Vec<CertificateKind> = Vec::new();
        for path in &file.certificates {
            let path = folder.join(path);
            let name = path.display().to_string();
            let fail = |problem: String| format!("certificate {name}: {problem}");
            let text = crate::input::text_of(&path).map_err(|e| e.to_string())?;
            let certificate = Certificate::from_toml(&text).map_err(|e| fail(e.to_string()))?;
            let kind = certificate.kind;
            if !matches!(kind, CertificateKind::Force | CertificateKind::Amplitude) {
                return Err(fail(format!(
                    "a {kind} certificate changes nothing in a run. Leave it out, and write its values \
                     where they hold: in the fingertip, in [noise] of the setup, or in the profile"
                )));
            }
            if seen.contains(&kind) {
                return Err(fail(format!("there is another {kind} certificate; which one holds?")));
            }
            seen.push(kind);
            let serial = serial(file, kind).map_err(&fail)?;
            let at = Circumstances { kind, serial: &serial, now_unix_s, temperature_c: file.temperature_c };
            let verified = certificate.verify(&at).map_err(|e| fail(e.to_string()))?;
            if let (Some([low, high]), None) = (certificate.validity.temperature_c, file.temperature_c) {
                return Err(fail(format!(
                    "it holds from {low:.1} to {high:.1} deg C: state `temperature_c` in the setup, as read at the \
                     bench"
                )));
            }
            calibration::prior::take(&mut all.calibration, verified, file.temperature_c)
                .map_err(|e| fail(e.to_string()))?;
            if kind == CertificateKind::Force {
                let axes = file.force.iter().flat_map(|i| [&i.lateral, &i.normal]).flatten();
                if axes.into_iter().any(|a| a.gain != 1.0 || a.offset_n != 0.0) {
                    return Err(fail(
                        "the setup scales the forces too (gain, offset_n): leave that to the certificate"
                            .into(),
                    ));
                }
                let calibration = ForceCalibration::compile(verified, file.temperature_c)
                    .map_err(|e| fail(e.to_string()))?;
                // The setup's zero, or the one that was found with the certificate: both are written down.
                let none = Zero { counts: [0.0; 2], standard_uncertainty: [0.0; 2], time_s: 0.0 };
                let found = Zero::of_certificate(&certificate, file.temperature_c).unwrap_or(none);
                let zero = Zero { counts: file.zero_counts.unwrap_or(found.counts), ..found };
                all.force = Some((calibration, zero));
                if file.zero_counts.is_some() {
                    // The certificate speaks for its own zero, not for the one that the setup states.
                    (all.calibration.lateral_offset_sd_n, all.calibration.normal_offset_sd_n) = (None, None);
                }
            }
            if kind == CertificateKind::Amplitude {
                all.take_amplitude(file, verified).map_err(&fail)?;
            }
            let file_name = path.file_name().map_or(name.clone(), |n| n.to_string_lossy().into_owned());
            // No instrument of force reports a temperature to the loop; the amplifier does.
            if let (CertificateKind::Amplitude, Some(range_c)) = (kind, certificate.validity.temperature_c) {
                let certificate = format!("{kind} certificate ({file_name})");
                all.temperature_ranges.push(TemperatureRange { certificate, range_c });
            }
            all.calibration.certificates.insert(kind, file_name.clone());
            all.files.push((format!("certificates/{file_name}"), text));
        }
        Ok(all)
    }

    /// Takes in an amplitude certificate, by what the drive's set-point is.
    fn take_amplitude(&mut self, file: &SetupFile, verified: Verified) -> Result<(), String> {
        if file.amplifier.amplitude_m_per_unit.is_some() {
            return Err(
                "the setup scales the set-point too (amplitude_m_per_unit): leave that to the certificate"
                    .into(),
            );
        }
        let certificate = verified.certificate();
        let calibration = AmplitudeCalibration::compile(verified).map_err(|e| e.to_string())?;
        match certificate.settings.get("set_point_unit").map(String::as_str) {
            Some("A") => {
                if certificate.parameter("offset").or(certificate.parameter("bend")).is_some() {
                    return Err("a current is turned into an amplitude by a proportional gain only".into());
                }
                self.amplitude_m_per_unit = certificate.parameter("gain").map(|p| p.value);
            }
            Some("m") => {
                // A drive that states metres and is off by more than that states something else.
                let at = certificate.validity.range.get("set_point").map_or(1e-6, |r| r[1]);
                let ratio = calibration.free_amplitude(at).metres() / at;
                if !(PLAUSIBLE.0..=PLAUSIBLE.1).contains(&ratio) {
                    return Err(format!(
                        "its amplitude is {ratio:.3} of the set-point: a table in other units, or half a swing for a \
                         whole one? w is peak-to-peak"
                    ));
                }
                self.amplitude = Some(calibration);
            }
            other => return Err(format!("its set_point_unit is {other:?}, not m or A")),
        }
        Ok(())
    }

    /// A rig's ports, with the certificates applied to force and amplifier.
    pub fn applied(&self, mut ports: Ports) -> Ports {
        ports.force = self.calibrated(ports.force);
        if let Some(calibration) = self.amplitude {
            ports.amplifier = Box::new(CalibratedAmplifier { inner: ports.amplifier, calibration });
        }
        ports
    }

    /// The force port with the certificate applied, or the port itself where there is none.
    pub fn calibrated(&self, force: Box<dyn ForceSensor>) -> Box<dyn ForceSensor> {
        match self.force {
            None => force,
            Some((calibration, zero)) => Box::new(Calibrated { inner: force, calibration, zero }),
        }
    }
}

/// Serial number that a certificate of that kind must name.
fn serial(file: &SetupFile, kind: CertificateKind) -> Result<String, String> {
    let amplifier = std::slice::from_ref(&file.amplifier);
    let instruments = if kind == CertificateKind::Force { file.force.as_slice() } else { amplifier };
    let known: Option<Vec<&str>> = instruments.iter().map(|i| i.serial.as_deref()).collect();
    known.map(|serials| serials.join("+")).ok_or_else(|| {
        format!("the setup must state the `serial` of the instrument that the {kind} certificate is for")
    })
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
        let with = |reading: Sample, value: f64| Sample {
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

/// An amplifier's port around an amplifier's port: the plate's amplitude in, the drive's set-point out, and back. The
/// curve is that of the free plate at the table's place; mode shape and droop are the diagnosis's. No allocation.
struct CalibratedAmplifier {
    inner: Box<dyn Amplifier>,
    calibration: AmplitudeCalibration,
}

impl Amplifier for CalibratedAmplifier {
    fn command(&mut self, command: DriveCommand, now: Nanos) {
        let set_point = |w| self.calibration.free_set_point(w).map(PeakToPeak::from_metres);
        self.inner.command(command.on_scale(set_point), now);
    }

    fn state(&mut self, now: Nanos) -> Result<AmplifierState, NoData> {
        let state = self.inner.state(now)?;
        // Nothing driven is nothing moving, whatever the curve's offset: a reading of zero stays zero.
        let plate = |drive: f64| {
            if drive > 0.0 { self.calibration.free_amplitude(drive) } else { PeakToPeak::from_metres(drive) }
        };
        Ok(AmplifierState {
            amplitude: state.amplitude.map(|r| Sample { value: plate(r.value).metres(), ..r }),
            echoed_amplitude: plate(state.echoed_amplitude.metres()),
            ..state
        })
    }
}
