//! Bonds need time to form after each touch-down.

use super::prelude::*;
use crate::contact::{Bonds, STILL_PLATE_M, half_contact_angle};
use std::f64::consts::PI;

/// Speed below which junctions get no older, m/s.
const LEAST_SPEED: f64 = 1e-6;

const TIME: Parameter = Parameter::positive("bonding_time", "s", 15e-6, 1e-3);
const WAITS: Parameter = Parameter::between("share_that_waits", "1", 0.1, 1.0);

pub(super) static EFFECT: Effect = Effect {
    name: "contact_ageing",
    place: Location::Contact,
    summary: "Short contacts have not yet formed all their bonds, so the limit is lower than mu0 F.",
    source: "stochastic adhesion (section 5.4 of the paper); bonding times of 1 to 100 us; ageing law of rock and \
             paper (Dieterich 1979)",
    laws: &[
        Law::new("first order", &[TIME]),
        Law::new(
            "a share at once, the rest stretched",
            &[TIME, WAITS, Parameter::shape("exponent", "1", 0.75, 0.3).bending()],
        ),
        Law::new("a share at once, the rest by mean contact time", &[TIME, WAITS]),
        // A junction forms as it is pressed: by the normal force of the instant over its mean.
        Law::new("a share at once, the rest by pressing", &[TIME, WAITS]),
        Law::new(
            "logarithm of the age, renewed by slip",
            &[
                Parameter::positive("growth_per_e_fold_of_age", "1", 0.1, 1.0),
                Parameter::shape("slip_distance", "m", 0.5e-6, 1.0),
                Parameter::shape("least_age", "s", 0.5e-6, 0.8).bending(),
            ],
        ),
    ],
    needs: &[Need::Vibration],
    change: |law, theta, _, _, c| match law {
        2 => {
            let vibrates = c.amplitude_pp > STILL_PLATE_M;
            let phi = if vibrates { half_contact_angle(c.load_ratio(), 0.0) } else { PI };
            if phi < PI {
                let time = phi / (PI * c.frequency);
                c.mu0 *= 1.0 - theta[1] * theta[0] / (time + theta[0]);
            }
        }
        // Of size zero they are there at once.
        _ if theta[0] == 0.0 => {}
        3 => c.bonds = Bonds::Pressed { time: theta[0], share: theta[1] },
        4 => {
            let steady = theta[1] / c.speed.max(LEAST_SPEED);
            c.bonds = Bonds::Renewed { strength: theta[0], time: theta[2], steady };
        }
        _ => {
            let shape = |i: usize| theta.get(i).copied().unwrap_or(1.0);
            c.bonds = Bonds::Stretched { time: theta[0], share: shape(1), exponent: shape(2) };
        }
    },
    ..Effect::NONE
};
