//! The amplifier cannot deliver the largest amplitudes.

use super::prelude::*;

const CHECK: &str = "Measure the plate with a vibrometer at the largest drives.";

pub(super) static EFFECT: Effect = Effect {
    name: "amplitude_saturation",
    place: Location::Plate,
    summary: "Above some command the amplitude no longer follows.",
    source: "rail voltage and depolarisation limits of piezo drives",
    laws: &[Law::new(
        "limit with a bend",
        &[
            Parameter::positive("inverse_limit", "1/m", 0.3e6, 5e6),
            Parameter::shape("sharpness", "1", 4.0, 0.6),
            // A current that is limited drives less the higher the frequency; a voltage, the same.
            Parameter::signed("frequency_exponent", "1", 0.5, -1.0, 2.0).bending(),
            // Beyond its limit a drive that heats up or loses its resonance gives less, not as much.
            Parameter::shape("steepness_beyond_limit", "1", 1.0, 0.4).bending(),
        ],
    )
    .seen_by(CHECK, 2e4)],
    acts: Some(Acts { on: Input::Amplitude, over: &[&covariate::AMPLITUDE] }),
    needs: &[Need::Vibration, Need::Amplitudes],
    change: |_, theta, _, design, c| {
        let x = theta[0] * c.amplitude_pp * (c.frequency / design.reference_frequency_hz).powf(theta[2]);
        c.amplitude_pp *= (1.0 + x.powf(theta[1])).powf(-theta[3] / theta[1]);
    },
    ..Effect::NONE
};
