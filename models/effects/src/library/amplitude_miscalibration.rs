//! The plate does not move by the amplitude that the drive was calibrated to.

use super::prelude::*;

const CHECK: &str = "Measure the plate with a vibrometer at three drives.";

/// Below this share of the largest amplitude a gain changes no further; beyond these e-folds it is none.
const LEAST_AMPLITUDE: f64 = 0.05;
const MOST_E_FOLDS: f64 = 2.0;

pub(super) static EFFECT: Effect = Effect {
    name: "amplitude_miscalibration",
    place: Location::Plate,
    summary: "True amplitude is a factor, which may follow frequency and amplitude, or a dead zone away from \
              the commanded one.",
    source: "vibrometer calibrations of drives; confusion of peak and peak-to-peak is a factor of two",
    laws: &[
        Law::new("gain", &[Parameter::signed("log_gain", "1", 0.3, -1.5, 1.5)])
            .certified_by(CertifiedKey::AmplitudeGain)
            .acts_as([0.0, 1.0, 0.0])
            .seen_by(CHECK, 0.02),
        Law::new("dead zone", &[Parameter::signed("missing_amplitude", "m", 0.2e-6, -1e-6, 1e-6)])
            .seen_by(CHECK, 4e-8),
        // A vibrometer's roll-off, or a drive that is not linear.
        Law::new(
            "gain over frequency and amplitude",
            &[
                Parameter::signed("log_gain", "1", 0.3, -1.5, 1.5),
                Parameter::signed("growth_per_e_fold_of_frequency", "1", 0.7, -3.0, 3.0).bending(),
                Parameter::signed("growth_per_e_fold_of_amplitude", "1", 0.3, -1.0, 1.0).bending(),
            ],
        )
        .seen_by(CHECK, 0.02),
    ],
    acts: Some(Acts { on: Input::Amplitude, over: &[&covariate::AMPLITUDE] }),
    needs: &[Need::Vibration],
    change: |law, theta, _, design, c| {
        if c.amplitude_pp <= 0.0 {
            return;
        }
        match law {
            0 => c.amplitude_pp *= theta[0].exp(),
            1 => c.amplitude_pp = (c.amplitude_pp - theta[0]).max(0.0),
            _ => {
                let amplitude =
                    (c.amplitude_pp / design.largest_amplitude_m.max(1e-12)).max(LEAST_AMPLITUDE).ln();
                let frequency = (c.frequency / design.reference_frequency_hz).ln();
                let log_gain = theta[0] * (1.0 + theta[1] * frequency) * (1.0 + theta[2] * amplitude);
                c.amplitude_pp *= log_gain.clamp(-MOST_E_FOLDS, MOST_E_FOLDS).exp();
            }
        }
    },
    ..Effect::NONE
};
