//! The friction limit is not proportional to the load.

use super::prelude::*;

pub(super) static EFFECT: Effect = Effect {
    name: "load_dependent_friction",
    place: Location::Contact,
    summary: "The friction coefficient depends on the load, as area-controlled (non-Coulombic) friction has it.",
    source: "F = k W^n with n from 2/3 to 1 (Dzidek 2014); n scatters in active touch (Inoue 2022)",
    laws: &[
        Law::new(
            "power of the momentary load",
            &[Parameter::signed("exponent_minus_one", "1", 0.2, -0.6, 0.4)],
        ),
        Law::new("power of the mean load", &[Parameter::signed("exponent_minus_one", "1", 0.2, -0.8, 0.6)]),
        Law::new(
            "saturating with the mean load",
            &[Parameter::signed("inverse_load", "1/N", 0.8, -0.6, 8.0)],
        ),
    ],
    acts: Some(Acts { on: Input::Friction, over: &[&covariate::NORMAL_FORCE] }),
    needs: &[Need::Loads],
    change: |law, theta, _, design, c| {
        let relative = (c.normal_force / design.reference_load_n).max(1e-3);
        match law {
            0 => c.load_exponent = theta[0],
            1 => c.mu0 *= relative.powf(theta[0]),
            _ => {
                let k = theta[0] * design.reference_load_n;
                c.mu0 *= (1.0 + k).max(0.05) / (1.0 + k * relative).max(0.05);
            }
        }
    },
    ..Effect::NONE
};
