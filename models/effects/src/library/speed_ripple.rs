//! The stage's speed ripples with the pitch of its screw.

use super::prelude::*;
use std::f64::consts::PI;

pub(super) static EFFECT: Effect = Effect {
    name: "speed_ripple",
    place: Location::Instrument,
    summary: "Speed varies along the stroke with the screw's pitch, and friction follows where it depends on speed.",
    source: "lead screws of 1 to 10 mm pitch",
    laws: &[Law::new(
        "sine along the plate",
        &[
            Parameter::positive("relative_ripple", "1", 0.2, 0.9),
            Parameter::between("pitch", "m", 0.0008, 0.012),
            Parameter::between("phase", "1", -0.25, 1.25),
            // A stage's mass smooths the ripple at high speed; cogging adds a speed rather than a share.
            Parameter::signed("speed_exponent", "1", 0.4, -1.2, 0.8).bending(),
            Parameter::signed("second_harmonic_sine", "1", 0.3, -1.0, 1.0).bending(),
            Parameter::signed("second_harmonic_cosine", "1", 0.3, -1.0, 1.0).bending(),
        ],
    )],
    needs: &[Need::Vibration, Need::Positions],
    change: |_, theta, pass, design, c| {
        let (sin, cos) = (2.0 * PI * (pass.position_m / theta[1] + theta[2])).sin_cos();
        let wave = sin + 2.0 * theta[4] * sin * cos + theta[5] * (1.0 - 2.0 * sin * sin);
        let ripple = theta[0] * (c.speed / design.reference_speed_m_s).powf(theta[3]);
        c.speed *= (1.0 + ripple * wave).max(0.05);
    },
    ..Effect::NONE
};
