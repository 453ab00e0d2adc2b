//! The skin's lateral stretch does not vanish at lift-off but recovers at a finite rate.

use super::prelude::*;

/// A speed of recovery that falls with the stretch below a knee: a limit of speed for long stretches, of time for short ones.
const LIMITS: [Parameter; 2] = [
    Parameter::positive("inverse_recovery_speed", "s/m", 150.0, 3000.0),
    Parameter::shape("stretch_of_half_speed", "m", 1e-7, 1.3).bending(),
];

pub(super) static EFFECT: Effect = Effect {
    name: "lateral_recovery",
    place: Location::Contact,
    summary: "Stretch left from the last contact lets the friction force start higher in the next.",
    source: "section 5.3 of the paper (recovery at 1.5 to 15 mm/s); Kelvin-Voigt as the second form",
    laws: &[
        Law::new("rate limit, slower near rest", &LIMITS),
        Law::new("exponential", &[Parameter::positive("relaxation_time", "s", 30e-6, 1e-3)]),
        Law::new("slip against viscosity", &[Parameter::positive("relaxation_time", "s", 30e-6, 1e-3)]),
    ],
    needs: &[Need::Vibration],
    change: |law, theta, _, _, c| {
        c.viscous_slip = law == 2;
        match law {
            0 => (c.inverse_recovery_speed, c.recovery_knee) = (theta[0], theta[1]),
            _ => c.lateral_relaxation_time = theta[0],
        }
    },
    ..Effect::NONE
};
