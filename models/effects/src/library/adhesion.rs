//! Adhesion loads the contact beyond what the normal force does, and holds it until it is pulled off.

use super::prelude::*;
use crate::contact::Attraction;

/// See the module.
pub static EFFECT: Effect = Effect {
    name: "adhesion",
    place: Place::Contact,
    summary: "The friction limit is mu0 (F + Fa), and contact lasts until the spring pulls with Fa.",
    source: "Derjaguin, Muller, Toporov 1975; Johnson, Kendall, Roberts 1971; capillary and van der Waals pull of tens of mN on a finger",
    laws: &[
        Law::new("DMT", &[Parameter::positive("adhesive_force", "N", 0.06, 1.0)]),
        Law::new(
            "constant shear on the touching time",
            &[Parameter::positive("adhesive_force", "N", 0.06, 1.0)],
        ),
        Law::new(
            "developing with the momentary load",
            &[
                Parameter::positive("adhesive_force", "N", 0.06, 1.0),
                Parameter::shape("load_of_half_attraction", "N", 0.04, 1.0),
                // Peeling takes more force the faster it goes.
                Parameter::signed("speed_exponent", "1", 0.1, 0.0, 0.4).bending(),
            ],
        ),
        Law::new("JKR", &[Parameter::positive("pull_off_force", "N", 0.015, 0.5)]),
    ],
    near: &["normal_offset"],
    needs: &[Need::Loads],
    change: |law, theta, _, design, c| {
        if law == 0 {
            c.adhesion = theta[0];
        } else if law == 2 {
            c.attraction = if theta[0] > 0.0 {
                let force = theta[0] * (c.speed / design.reference_speed_m_s).powf(theta[2]);
                Attraction::Developing { force, scale: theta[1] }
            } else {
                Attraction::None
            };
        } else if law == 3 {
            c.attraction =
                if theta[0] > 0.0 { Attraction::Jkr { pull_off: theta[0] } } else { Attraction::None };
        } else {
            // Added friction for the share of the cycle in which the surfaces touch.
            let touching = if c.amplitude_pp > crate::contact::STILL_PLATE_M {
                crate::contact::half_contact_angle(c.load_ratio(), 0.0) / std::f64::consts::PI
            } else {
                1.0
            };
            c.mu0 *= 1.0 + theta[0] * touching / c.normal_force;
        }
    },
    ..Effect::NONE
};
