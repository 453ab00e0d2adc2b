//! The stage does not move at the commanded speed.

use super::prelude::*;

const CHECK: &str = "Time the stage over its stroke, or read its encoder.";

pub(super) static EFFECT: Effect = Effect {
    name: "speed_error",
    place: Location::Instrument,
    summary: "True speed is a factor (or a constant) away from the commanded one; the factor may change with speed.",
    source: "wrong lead or step count; separable from a stiffness only with an encoder",
    laws: &[
        Law::new("gain", &[Parameter::signed("log_gain", "1", 0.15, -1.0, 1.0)])
            .certified_by(CertifiedKey::SpeedGain)
            .acts_as([0.0, 0.0, 1.0])
            .seen_by(CHECK, 0.003),
        // A motor without a loop slows by what it drags.
        Law::new(
            "constant",
            &[
                Parameter::signed("excess", "m/s", 0.003, -0.02, 0.05),
                Parameter::signed("load_exponent", "1", 0.5, -1.0, 2.0).bending(),
            ],
        )
        .seen_by(CHECK, 6e-5),
        // Slip and lag of a drive change with its speed: the error of the gain by this share for each factor
        // of e.
        Law::new(
            "gain that changes with speed",
            &[
                Parameter::signed("log_gain", "1", 0.15, -1.0, 1.0),
                Parameter::signed("growth_with_log_speed", "1", 0.1, -0.5, 0.5),
            ],
        )
        .seen_by(CHECK, 0.003),
        // Grease is stiff until it is warm.
        Law::new(
            "settling",
            &[
                Parameter::signed("log_gain_at_start", "1", 0.15, -1.5, 1.0),
                Parameter::shape("time_constant_over_duration", "1", 0.1, 1.0),
                IN_RUN,
            ],
        )
        .needs(&[Need::Time])
        .seen_by(CHECK, 0.003),
        // A cable pulls one way: as a lateral stiffness by direction does, prior and all.
        Law::new("by direction", &[Parameter::signed("log_gain_forward", "1", 0.3, -2.0, 2.0)])
            .needs(&[Need::Directions])
            .seen_by(CHECK, 0.003),
    ],
    acts: Some(Acts { on: Input::Speed, over: &[&covariate::SPEED] }),
    needs: &[Need::Vibration],
    change: |law, theta, pass, design, c| match law {
        0 => c.speed *= theta[0].exp(),
        1 => {
            let load = (c.normal_force / design.reference_load_n).max(0.0).powf(theta[1]);
            c.speed = (c.speed + theta[0] * load).max(0.05 * c.speed);
        }
        3 => {
            let time = pass.elapsed_s(theta[2]) / (theta[1] * design.duration_s.max(1e-9));
            c.speed *= (theta[0] * (-time).exp()).exp();
        }
        4 => c.speed *= (theta[0] * pass.direction.sign()).exp(),
        _ => {
            let faster = (c.speed / design.reference_speed_m_s).ln();
            c.speed *= (theta[0] * (1.0 + theta[1] * faster)).exp();
        }
    },
    ..Effect::NONE
};
