//! The tissue under the ridges creeps: the contact grows, and with it both stiffnesses, while mu0 stays.

use super::prelude::*;

/// The parameters of a creep with one time constant.
const ONE_TIME: &[Parameter] = &[
    Parameter::signed("relative_change", "1", 0.4, -0.8, 4.0),
    Parameter::shape("time_constant", "s", 30.0, 1.5),
];
/// Tissue has no single relaxation time: Kohlrausch's function, the usual one for a broad spectrum of times.
const BROAD: &[Parameter] = &[ONE_TIME[0], ONE_TIME[1], Parameter::shape("exponent", "1", 0.6, 0.3), IN_RUN];
/// Those of a creep with one time constant and rests.
const RESTED: &[Parameter] = &[ONE_TIME[0], ONE_TIME[1], IN_RUN];
/// Those of a logarithmic creep.
const LOGARITHMIC: &[Parameter] = &[
    Parameter::signed("relative_change_per_e_fold", "1", 0.12, -0.15, 1.5),
    Parameter::shape("onset_time", "s", 5.0, 1.2),
    IN_RUN,
];

pub(super) static EFFECT: Effect = Effect {
    name: "subsurface_relaxation",
    place: Location::Contact,
    summary: "Creep of the soft tissue changes the stiffness of the contact with time, not its friction coefficient.",
    source: "longest relaxation time of a finger pad about 3 s (the paper's introduction); area grows as log t",
    laws: &[
        Law::new("exponential creep", RESTED),
        Law::new("logarithmic creep", LOGARITHMIC),
        Law::new("normal stiffness alone", ONE_TIME),
        Law::new("normal stiffness alone, logarithmic", LOGARITHMIC),
        Law::new("normal stiffness alone, stretched exponential", BROAD),
    ],
    near: &["speed_error", "amplitude_miscalibration", "resonance_detuning"],
    acts: Some(Acts { on: Input::Stiffness, over: &[&covariate::TIME] }),
    needs: &[Need::Vibration, Need::Time],
    change: |law, theta, pass, _, c| {
        let rests = if law == 2 { 0.0 } else { theta[theta.len() - 1] };
        let time = pass.elapsed_s(rests) / theta[1];
        let factor = match law {
            1 | 3 => 1.0 + theta[0] * (1.0 + time).ln(),
            4 => 1.0 - theta[0] * (-time.powf(theta[2])).exp_m1(),
            _ => 1.0 - theta[0] * (-time).exp_m1(),
        }
        .max(0.05);
        c.normal_stiffness *= factor;
        if law < 2 {
            c.lateral_stiffness *= factor;
        }
    },
    ..Effect::NONE
};
