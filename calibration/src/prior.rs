//! What certificates leave open, as the `[calibration]` section of rig.toml: the diagnosis blames an
//! instrument only within what its certificate leaves.

use crate::amplitude::apply::AmplitudeCalibration;
use crate::certificate::{CertificateKind, Refusal, Verified};
use crate::force::apply::ForceCalibration;
use crate::force::zero::Zero;
use models::Calibration;

/// Takes one verified certificate into what is known, at a temperature. Kinds that say nothing of the
/// readings change nothing.
///
/// # Errors
/// A certificate that cannot be compiled.
pub fn take(known: &mut Calibration, verified: Verified, temperature_c: Option<f64>) -> Result<(), Refusal> {
    let certificate = verified.certificate();
    match certificate.kind {
        CertificateKind::Force => {
            let force = ForceCalibration::compile(verified, temperature_c)?;
            force.take_into(known);
            let pull = certificate.budget.iter().find(|line| line.source == "direction of the normal pull");
            known.tilt_sd_rad = pull.map(|line| line.standard_uncertainty);
            if let Some(zero) = Zero::of_certificate(certificate, temperature_c) {
                // Without load only the zero and the hysteresis are left of the uncertainty.
                let [lateral, normal] = force.standard_uncertainty([0.0, 0.0], &zero);
                (known.lateral_offset_sd_n, known.normal_offset_sd_n) = (Some(lateral), Some(normal));
            }
        }
        CertificateKind::Amplitude => {
            known.amplitude_gain_sd = Some(AmplitudeCalibration::compile(verified)?.gain_relative_sd);
        }
        CertificateKind::Latency
        | CertificateKind::Phase
        | CertificateKind::Finger
        | CertificateKind::Sensor => {}
    }
    Ok(())
}
