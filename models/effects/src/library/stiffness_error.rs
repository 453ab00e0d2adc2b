//! A stiffness of the finger is not what its certificate says.

use super::prelude::*;

/// Loads below this share of the reference load change the stiffness no further.
const LEAST_LOAD: f64 = 1e-3;

pub(super) static EFFECT: Effect = Effect {
    name: "stiffness_error",
    place: Location::Finger,
    summary: "Normal or lateral stiffness lies outside the range that its calibration states.",
    source: "spread of ultrasonic stiffness in the paper (0.2 to 4 MN/m); rig.toml's prior is the nuisance; \
             a Hertzian contact's stiffness grows with the cube root of the load",
    laws: &[
        Law::new("lateral stiffness", &[Parameter::signed("log_lateral_factor", "1", 0.5, -2.0, 2.0)])
            .acts_as([0.0, 0.0, 1.0]),
        Law::new("normal stiffness", &[Parameter::signed("log_normal_factor", "1", 0.5, -2.0, 2.0)])
            .acts_as([0.0, 1.0, 0.0]),
        Law::new("both", &[Parameter::signed("log_common_factor", "1", 0.5, -2.0, 2.0)])
            .acts_as([0.0, 1.0, 1.0]),
        // A power of the load leads away from where the certificate holds, and the two need not err alike.
        Law::new(
            "both, certified at another load",
            &[
                Parameter::signed("log_normal_factor", "1", 0.5, -2.0, 2.0),
                Parameter::signed("growth_per_e_fold_of_load", "1", 0.3, -1.0, 1.0).bending(),
                Parameter::signed("lateral_over_normal_e_folds", "1", 0.3, -1.0, 1.0).bending(),
                // Skin has a grain, in springs that are wrong both ways, too.
                Parameter::signed("lateral_forward_e_folds", "1", 0.1, -1.0, 1.0).bending(),
            ],
        ),
        Law::new("both, growing with the load", &[Parameter::signed("load_exponent", "1", 0.25, -0.7, 1.0)])
            .needs(&[Need::Loads]),
        // Skin has a grain: as a speed by direction does, prior and all, so that neither is named beside the other.
        Law::new(
            "lateral stiffness by direction",
            &[Parameter::signed("log_factor_forward", "1", 0.3, -2.0, 2.0)],
        )
        .needs(&[Need::Directions]),
    ],
    acts: Some(Acts { on: Input::Stiffness, over: &[&covariate::NORMAL_FORCE] }),
    needs: &[Need::Vibration],
    change: |law, theta, pass, design, c| {
        let load_e_folds = (c.normal_force / design.reference_load_n).max(LEAST_LOAD).ln();
        let [normal, lateral] = match law {
            0 => [0.0, theta[0]],
            1 => [theta[0], 0.0],
            2 => [theta[0]; 2],
            3 => {
                let normal = theta[0] * (1.0 + theta[1] * load_e_folds);
                [normal, normal * (1.0 + theta[2]) + theta[0] * theta[3] * pass.direction.sign()]
            }
            5 => [0.0, theta[0] * pass.direction.sign()],
            _ => [theta[0] * load_e_folds; 2],
        };
        c.normal_stiffness *= normal.exp();
        c.lateral_stiffness *= lateral.exp();
    },
    ..Effect::NONE
};
