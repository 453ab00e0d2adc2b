//! The normal force that is read is not the one that loads the contact.

use super::prelude::*;

const CHECK: &str = "Lift the finger and read the normal force; put a dead weight on it.";

pub(super) static EFFECT: Effect = Effect {
    name: "normal_offset",
    place: Location::Instrument,
    summary: "Measured normal force = true force + offset; the contact is loaded by the true one.",
    source: "taring with something on the cell; offsets up to 8 % of range",
    laws: &[
        Law::new("constant", &[Parameter::signed("offset", "N", 0.03, -0.5, 0.5)])
            .certified_by(CertifiedKey::NormalOffset)
            .seen_by(CHECK, 0.001),
        Law::new(
            "drift over the table",
            &[
                Parameter::signed("offset", "N", 0.03, -0.5, 0.5),
                Parameter::signed("share_at_start", "1", 0.5, -2.0, 2.0).bending(),
                IN_RUN,
                // A cable that trails along.
                ALONG,
            ],
        )
        .seen_by(CHECK, 0.001),
        // A cell rectifies what shakes it: by the square of the acceleration, if it is even.
        Law::new(
            "by the vibration",
            &[
                Parameter::signed("offset_at_full_vibration", "N", 0.03, -0.5, 0.5),
                Parameter::shape("exponent", "1", 1.6, 0.3).bending(),
                Parameter::signed("frequency_exponent", "1", 1.5, -2.0, 5.0).bending(),
            ],
        )
        .needs(&[Need::Vibration])
        .seen_by("Lift the finger, switch the drive on and off; read the normal force.", 0.001),
    ],
    acts: Some(Acts { on: Input::Load, over: &[&covariate::TIME] }),
    needs: &[Need::Loads],
    change: |law, theta, pass, design, c| {
        let share = match law {
            0 => 1.0,
            1 => {
                let elapsed = pass.elapsed_s(theta[2]) / design.duration_s.max(1e-9);
                (theta[1] + (1.0 - theta[1]) * elapsed) * bent(&[1.0, theta[3], 0.0, 0.0], pass, design)
            }
            _ => vibrating(&theta[1..], pass, design),
        };
        c.normal_force = (c.normal_force - theta[0] * share).max(LEAST_SHARE * c.normal_force);
    },
    ..Effect::NONE
};
