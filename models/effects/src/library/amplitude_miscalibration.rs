//! The plate does not move by the amplitude that the drive was calibrated to.

use super::prelude::*;

/// What sees it without friction.
const CHECK: &str = "Measure the plate with a vibrometer at three drives.";

pub(super) static EFFECT: Effect = Effect {
    name: "amplitude_miscalibration",
    place: Location::Plate,
    summary: "True amplitude is a constant factor (or a dead zone) away from the commanded one.",
    source: "vibrometer calibrations of drives; confusion of peak and peak-to-peak is a factor of two",
    laws: &[
        Law::new("gain", &[Parameter::signed("log_gain", "1", 0.3, -1.5, 1.5)])
            .certified_by(CertifiedKey::AmplitudeGain)
            .acts_as([0.0, 1.0, 0.0])
            .seen_by(CHECK, 0.02),
        Law::new("dead zone", &[Parameter::signed("missing_amplitude", "m", 0.2e-6, -1e-6, 1e-6)])
            .seen_by(CHECK, 4e-8),
    ],
    acts: Some(Acts { on: Input::Amplitude, over: &[&covariate::AMPLITUDE] }),
    needs: &[Need::Vibration],
    change: |law, theta, _, _, c| {
        if c.amplitude_pp <= 0.0 {
            return;
        }
        match law {
            0 => c.amplitude_pp *= theta[0].exp(),
            _ => c.amplitude_pp = (c.amplitude_pp - theta[0]).max(0.0),
        }
    },
    ..Effect::NONE
};
