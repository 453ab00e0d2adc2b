//! The amplifier distorts: the plate also moves at twice the frequency. The library does not name this cause.

use super::prelude::*;
use crate::contact::distorted::Harmonic;

pub(super) static EFFECT: Effect = Effect {
    name: "second_harmonic",
    place: Location::Plate,
    summary: "The plate's motion carries a second harmonic that grows with the amplitude.",
    source: "a distortion of second order goes with the square of the drive; some per cent to tens of per cent where twice the frequency meets a \
             mode of the plate",
    laws: &[Law::new(
        "distortion of second order",
        &[
            Parameter::positive("ratio_at_largest_amplitude", "1", 0.25, 0.9),
            Parameter::between("phase", "rad", 0.0, 2.0 * std::f64::consts::PI),
        ],
    )],
    words: Some("a plate that also moves at twice the frequency"),
    needs: &[Need::Amplitudes],
    change: |_, theta, _, design, c| {
        let swing = c.amplitude_pp / design.largest_amplitude_m.max(1e-12);
        c.harmonic = Harmonic { ratio: (theta[0] * swing).min(0.9), phase: theta[1] };
    },
    ..Effect::NONE
};
