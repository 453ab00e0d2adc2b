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
        ],
    )],
    near: &["mode_shape"],
    needs: &[Need::Vibration, Need::Positions],
    change: |_, theta, pass, _, c| {
        let wave = (2.0 * PI * (pass.position_m / theta[1] + theta[2])).sin();
        c.speed *= (1.0 + theta[0] * wave).max(0.05);
    },
    ..Effect::NONE
};
