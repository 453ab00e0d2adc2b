//! Bonds need time to form after each touch-down.

use super::prelude::*;

pub(super) static EFFECT: Effect = Effect {
    name: "contact_ageing",
    place: Location::Contact,
    summary: "Short contacts have not yet formed all their bonds, so the limit is lower than mu0 F.",
    source: "stochastic adhesion (section 5.4 of the paper); bonding times of 1 to 100 us",
    laws: &[
        Law::new("first order", &[Parameter::positive("bonding_time", "s", 15e-6, 1e-3)]),
        Law::new("stretched (root)", &[Parameter::positive("bonding_time", "s", 15e-6, 1e-3)]),
        Law::new("by mean contact time", &[Parameter::positive("bonding_time", "s", 10e-6, 1e-3)]),
        Law::new(
            "a share at once, the rest by mean contact time",
            &[
                Parameter::positive("bonding_time", "s", 15e-6, 1e-3),
                Parameter::between("share_that_waits", "1", 0.1, 1.0),
            ],
        ),
    ],
    needs: &[Need::Vibration],
    change: |law, theta, _, _, c| {
        if law < 2 {
            c.bonding_time = theta[0];
            c.bonding_exponent = if law == 0 { 1.0 } else { 0.5 };
        } else if c.amplitude_pp > crate::contact::STILL_PLATE_M {
            let phi = crate::contact::half_contact_angle(c.load_ratio(), 0.0);
            if phi < std::f64::consts::PI {
                let time = phi / (std::f64::consts::PI * c.frequency);
                let bound = time / (time + theta[0]);
                c.mu0 *= if law == 2 { bound } else { 1.0 - theta[1] * (1.0 - bound) };
            }
        }
    },
    ..Effect::NONE
};
