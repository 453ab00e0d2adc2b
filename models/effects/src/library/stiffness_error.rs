//! A stiffness of the finger is not what its certificate says.

use super::prelude::*;

pub(super) static EFFECT: Effect = Effect {
    name: "stiffness_error",
    place: Location::Finger,
    summary: "Normal or lateral stiffness lies outside the range that its calibration states.",
    source: "spread of ultrasonic stiffness in the paper (0.2 to 4 MN/m); rig.toml's prior is the nuisance",
    laws: &[
        Law::new("lateral stiffness", &[Parameter::signed("log_lateral_factor", "1", 0.5, -2.0, 2.0)])
            .acts_as([0.0, 0.0, 1.0]),
        Law::new("normal stiffness", &[Parameter::signed("log_normal_factor", "1", 0.5, -2.0, 2.0)])
            .acts_as([0.0, 1.0, 0.0]),
        Law::new("both", &[Parameter::signed("log_common_factor", "1", 0.5, -2.0, 2.0)])
            .acts_as([0.0, 1.0, 1.0]),
    ],
    near: &["speed_error", "amplitude_miscalibration", "subsurface_relaxation"],
    acts: Some(Acts { on: Input::Stiffness, over: &[&covariate::NORMAL_FORCE] }),
    needs: &[Need::Vibration],
    change: |law, theta, _, _, c| {
        let factor = theta[0].exp();
        if law != 1 {
            c.lateral_stiffness *= factor;
        }
        if law != 0 {
            c.normal_stiffness *= factor;
        }
    },
    ..Effect::NONE
};
