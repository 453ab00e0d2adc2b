//! The skin's lateral stretch does not vanish at lift-off but recovers at a finite rate.

use super::prelude::*;

/// A speed of recovery that falls with the stretch below a knee: a limit of speed for long stretches, of time for short ones.
const LIMITS: [Parameter; 2] = [
    Parameter::positive("inverse_recovery_speed", "s/m", 150.0, 3000.0),
    Parameter::shape("stretch_of_half_speed", "m", 1e-7, 1.3).bending(),
];

/// A relaxation time, and how much of its rate grows with the stretch: skin stiffens as it is stretched, and
/// draws back the faster.
const RELAXES: [Parameter; 2] = [
    Parameter::positive("relaxation_time", "s", 30e-6, 1e-3),
    Parameter::positive("share_that_grows_with_stretch", "1", 0.5, 0.99).bending(),
];

pub(super) static EFFECT: Effect = Effect {
    name: "lateral_recovery",
    place: Location::Contact,
    summary: "Stretch left from the last contact lets the friction force start higher in the next.",
    source: "section 5.3 of the paper (recovery at 1.5 to 15 mm/s); Kelvin-Voigt as the second form",
    laws: &[
        Law::new("rate limit, slower near rest", &LIMITS),
        Law::new("exponential", &RELAXES),
        Law::new("slip against viscosity", &RELAXES),
    ],
    needs: &[Need::Vibration],
    change: |law, theta, _, _, c| {
        c.viscous_slip = law == 2;
        match law {
            0 => (c.inverse_recovery_speed, c.recovery_knee) = (theta[0], theta[1]),
            _ => (c.lateral_relaxation_time, c.relaxation_growth) = (theta[0], theta[1]),
        }
    },
    ..Effect::NONE
};
