//! The ridges have a lateral resonance near the frequencies used: their dynamic stiffness falls towards it and rises beyond.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[Parameter::log("strength", 0.02, 1.0), Parameter::log("resonance_hz", 3e4, 5e4)],
    in_library: false,
    act: Act::Contact(|v, at, contact| {
        let x = at.frequency_hz / v[1];
        let (real, imaginary) = (1.0 - x * x, 0.3 * x);
        let response = real / (real * real + imaginary * imaginary);
        contact.lateral_stiffness_n_per_m *= (1.0 - v[0] * (response - 1.0) / 3.0).clamp(0.2, 4.0);
    }),
    ..DefectKind::cause(
        DefectSite::Finger,
        "the lateral stiffness of the ridges depends on frequency as a resonance does",
    )
};
