//! Bonds need time to form after each touch-down.

use super::prelude::*;

const TIME: Parameter = Parameter::positive("bonding_time", "s", 15e-6, 1e-3);
const WAITS: Parameter = Parameter::between("share_that_waits", "1", 0.1, 1.0);

pub(super) static EFFECT: Effect = Effect {
    name: "contact_ageing",
    place: Location::Contact,
    summary: "Short contacts have not yet formed all their bonds, so the limit is lower than mu0 F.",
    source: "stochastic adhesion (section 5.4 of the paper); bonding times of 1 to 100 us",
    laws: &[
        Law::new("first order", &[TIME]),
        Law::new(
            "a share at once, the rest stretched",
            &[TIME, WAITS, Parameter::shape("exponent", "1", 0.75, 0.3).bending()],
        ),
        Law::new("a share at once, the rest by mean contact time", &[TIME, WAITS]),
        // A junction forms as it is pressed: by the normal force of the instant over its mean.
        Law::new("a share at once, the rest by pressing", &[TIME, WAITS]),
    ],
    needs: &[Need::Vibration],
    change: |law, theta, _, _, c| {
        if law != 2 {
            c.bonding_time = theta[0];
            c.bonding_share = theta.get(1).copied().unwrap_or(1.0);
            c.bonding_exponent = theta.get(2).copied().unwrap_or(1.0);
            c.bonding_by_pressure = law == 3;
        } else if c.amplitude_pp > crate::contact::STILL_PLATE_M {
            let phi = crate::contact::half_contact_angle(c.load_ratio(), 0.0);
            if phi < std::f64::consts::PI {
                let time = phi / (std::f64::consts::PI * c.frequency);
                c.mu0 *= 1.0 - theta[1] * theta[0] / (time + theta[0]);
            }
        }
    },
    ..Effect::NONE
};
