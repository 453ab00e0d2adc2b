//! The skin's lateral stretch does not vanish at lift-off but recovers at a finite rate.

use super::prelude::*;
use crate::contact::SlipBack;

/// A speed of recovery that falls with the stretch below a knee: a limit of speed for long stretches, of time for short ones.
const LIMITS: [Parameter; 2] = [
    Parameter::positive("inverse_recovery_speed", "s/m", 150.0, 3000.0),
    Parameter::shape("stretch_of_half_speed", "m", 1e-7, 1.3).bending(),
];

/// See the module.
pub static EFFECT: Effect = Effect {
    name: "lateral_recovery",
    place: Place::Contact,
    summary: "Stretch left from the last contact lets the friction force start higher in the next.",
    source: "section 5.3 of the paper (recovery at 1.5 to 15 mm/s); Kelvin-Voigt as the second form",
    laws: &[
        Law::new("rate limit, slower near rest", &LIMITS),
        Law::new("exponential", &[Parameter::positive("relaxation_time", "s", 30e-6, 1e-3)]),
        Law::new(
            "spectrum of times, in flight",
            &[
                Parameter::positive("relaxation_time", "s", 30e-6, 1e-3),
                Parameter::between("exponent", "1", 0.2, 1.6),
            ],
        ),
        Law::new("rate limit, slower near rest, in flight", &LIMITS),
        Law::new("slip against viscosity", &[Parameter::positive("relaxation_time", "s", 30e-6, 1e-3)]),
    ],
    needs: &[Need::Vibration],
    change: |law, theta, _, _, c| {
        c.slip_back = match law {
            0 | 1 => SlipBack::Recovering,
            4 => SlipBack::Drawn,
            _ => SlipBack::Instant,
        };
        match law {
            1 | 4 => c.lateral_relaxation_time = theta[0],
            2 => {
                c.lateral_relaxation_time = theta[0];
                c.lateral_relaxation_exponent = theta[1];
            }
            _ => {
                c.inverse_recovery_speed = theta[0];
                c.recovery_knee = theta[1];
            }
        }
    },
    ..Effect::NONE
};
