//! The skin's lateral stretch does not vanish at lift-off but recovers at a finite rate.

use super::prelude::*;
use crate::contact::Held;

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

/// A share of each contact's stretch stays in the tissue below and is added to that of the next.
const HELD: [Parameter; 5] = [
    Parameter::positive("share_held", "1", 0.4, 3.0),
    Parameter::shape("relaxation_time", "s", 25e-6, 1.0),
    // Tissue has many relaxation times: none of spread is an exponential, one a hyperbola.
    Parameter::positive("spread_of_times", "1", 0.7, 3.0).bending(),
    // The bulk follows the mean stretch of a cycle, the skin its largest.
    Parameter::between("weight_of_mean", "1", 0.0, 1.0).bending(),
    // Stretch within an elastic range comes back.
    Parameter::positive("elastic_range", "m", 0.15e-6, 2e-6).bending(),
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
        Law::new("held in the tissue", &HELD),
    ],
    needs: &[Need::Vibration],
    change: |law, theta, _, _, c| {
        c.viscous_slip = law == 2;
        match law {
            0 => (c.inverse_recovery_speed, c.recovery_knee) = (theta[0], theta[1]),
            3 => {
                let [share, time, spread, of_mean, elastic] = *theta else { return };
                c.held = Held { share, time, spread, of_mean, elastic };
            }
            _ => (c.lateral_relaxation_time, c.relaxation_growth) = (theta[0], theta[1]),
        }
    },
    ..Effect::NONE
};
