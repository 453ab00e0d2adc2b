//! The friction coefficient depends on the sliding speed.

use super::prelude::*;

/// Most by which a curve changes mu0, in e-folds: beyond the speeds of a table a polynomial runs away.
const MOST_E_FOLDS: f64 = 2.0;

/// Stribeck's curve is one over speed by pressure (Hersey). The pressure of a soft contact grows with the
/// cube root of its load (Hertz), of a rough one hardly.
const HERSEY: Parameter = Parameter::positive("load_exponent_of_speed", "1", 0.3, 0.6).bending();

pub(super) static EFFECT: Effect = Effect {
    name: "rate_dependent_friction",
    place: Location::Contact,
    summary: "Faster or slower sliding changes mu0 itself; seen with the plate still.",
    source: "exponents of -0.2 to 0.3 on skin; Stribeck minimum near 10 mm/s on steel (Luo 2024)",
    laws: &[
        Law::new("power", &[Parameter::signed("exponent", "1", 0.12, -0.6, 0.8)]),
        Law::new(
            "Stribeck",
            &[
                Parameter::signed("static_excess", "1", 0.4, -0.8, 3.0),
                Parameter::shape("stribeck_speed", "m/s", 0.025, 0.8),
                HERSEY,
            ],
        ),
        // Thermally activated sliding; the first term of rate-and-state friction.
        Law::new("logarithmic", &[Parameter::signed("slope_per_log_speed", "1", 0.12, -0.4, 0.6)]),
        // Any smooth law of speed: linear, one that rises and falls again, or bends at a speed of its own.
        Law::new(
            "curve",
            &[
                Parameter::signed("exponent", "1", 0.12, -0.6, 0.8),
                Parameter::signed("bend_per_e_fold", "1", 0.7, -5.0, 5.0).bending(),
                Parameter::signed("change_of_bend_per_e_fold", "1", 0.4, -3.0, 3.0).bending(),
                HERSEY,
            ],
        ),
    ],
    acts: Some(Acts { on: Input::Friction, over: &[&covariate::SPEED] }),
    needs: &[Need::Speeds],
    change: |law, theta, _, design, c| {
        let reference = design.reference_speed_m_s;
        // The speed that does the same at the reference load.
        let speed = |exponent: f64| match exponent {
            0.0 => c.speed,
            e => c.speed * (c.normal_force / design.reference_load_n).powf(-e),
        };
        c.mu0 *= match law {
            0 => (c.speed / reference).powf(theta[0]),
            1 => 1.0 + theta[0] * (-(speed(theta[2]) / theta[1]).powi(2)).exp(),
            2 => (1.0 + theta[0] * (c.speed / reference).ln()).max(0.05),
            _ => {
                let x = (speed(theta[3]) / reference).ln();
                (theta[0] * x * (1.0 + x * (theta[1] + x * theta[2])))
                    .clamp(-MOST_E_FOLDS, MOST_E_FOLDS)
                    .exp()
            }
        };
    },
    ..Effect::NONE
};
