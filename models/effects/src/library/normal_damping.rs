//! The normal spring has a retardation time: it pushes harder on the way up and lags on the way down.

use super::prelude::*;

/// A dashpot of skin is seldom linear: by what power of the plate's peak speed its retardation time goes,
/// one in a square law, less than zero where it thins with shear.
const THICKENS: Parameter = Parameter::signed("plate_speed_exponent", "1", 0.4, -1.0, 1.5).bending();

pub(super) static EFFECT: Effect = Effect {
    name: "normal_damping",
    place: Location::Contact,
    summary: "A dashpot beside the normal spring changes how long, and how hard, ridge and plate touch.",
    source: "Kelvin-Voigt normal spring; damping ratios 0.05 to 1 of ridges at 26 to 114 kHz; Friesen 2016; \
             Hunt and Crossley 1975",
    laws: &[
        Law::new("Kelvin-Voigt", &[Parameter::positive("retardation_time", "s", 4e-6, 1e-4), THICKENS]),
        Law::new("constant loss factor", &[Parameter::positive("loss_factor", "1", 0.6, 10.0), THICKENS]),
        // Storage and loss at the vibration's frequency of a spring beside a spring and dashpot in series.
        Law::new(
            "standard linear solid",
            &[
                Parameter::positive("relaxing_share", "1", 1.0, 10.0),
                Parameter::shape("relaxation_time", "s", 5e-6, 1.0),
            ],
        ),
        // A dashpot that grows with the indentation, so that the force does not jump at touch-down.
        Law::new("Hunt and Crossley", &[Parameter::positive("damping_per_speed", "s/m", 6.0, 60.0)]),
    ],
    needs: &[Need::Vibration],
    change: |law, theta, _, design, c| {
        if law == 3 {
            c.indentation_damping = theta[0];
            return;
        }
        let omega = 2.0 * std::f64::consts::PI * c.frequency;
        c.normal_retardation_time = match law {
            0 => theta[0] * design.plate_speed(c).powf(theta[1]),
            1 => theta[0] / omega * design.plate_speed(c).powf(theta[1]),
            _ => {
                let x = omega * theta[1];
                let storage = 1.0 + theta[0] * x * x / (1.0 + x * x);
                c.normal_stiffness *= storage;
                theta[0] * theta[1] / (1.0 + x * x) / storage
            }
        };
    },
    ..Effect::NONE
};
