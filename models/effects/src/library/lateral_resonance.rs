//! Ridges that resonate sideways are soft or stiff near a frequency. A cause that the library does not name.

use super::prelude::*;

pub(super) static EFFECT: Effect = Effect {
    name: "lateral_resonance",
    place: Location::Finger,
    summary: "The lateral stiffness has a resonance among the frequencies of the table.",
    source: "a damped mass on a spring, hung on the pad (any text on vibration, as Den Hartog 1956, sec. 3.2); a damping ratio of skin, 0.15",
    laws: &[Law::new(
        "a damped mass",
        &[
            Parameter::signed("share_of_stiffness", "1", 0.15, -0.9, 0.9),
            Parameter::between("resonance_over_reference", "1", 0.5, 2.0),
        ],
    )],
    words: Some("ridges that resonate sideways"),
    needs: &[Need::Frequencies],
    change: |_, theta, _, design, c| {
        let x = c.frequency / (theta[1] * design.reference_frequency_hz);
        let (real, imaginary) = (1.0 - x * x, 2.0 * DAMPING * x);
        let response = real / (real * real + imaginary * imaginary);
        c.lateral_stiffness *= (1.0 - theta[0] * response).max(0.05);
    },
    ..Effect::NONE
};

/// Damping ratio of the ridges.
const DAMPING: f64 = 0.15;
