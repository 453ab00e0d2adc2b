//! Adhesion loads the contact beyond what the normal force does, and holds it until it is pulled off.

use super::prelude::*;
use crate::contact::{Attraction, STILL_PLATE_M, gap, half_contact_angle};
use std::f64::consts::PI;

const FORCE: Parameter = Parameter::positive("adhesive_force", "N", 0.06, 1.0);

pub(super) static EFFECT: Effect = Effect {
    name: "adhesion",
    place: Location::Contact,
    summary: "The friction limit is mu0 (F + Fa), and contact lasts until the spring pulls with Fa.",
    source: "Derjaguin, Muller, Toporov 1975; Johnson, Kendall, Roberts 1971; capillary and van der Waals pull of tens of mN on a finger; \
             between a sphere and a plane it falls with the inverse square of the distance (Israelachvili 2011)",
    laws: &[
        // The pull of a soft contact grows with its area, and with the speed at which it is peeled, or with
        // the drive's stray voltage.
        Law::new(
            "DMT",
            &[
                FORCE,
                Parameter::signed("load_exponent", "1", 0.15, -0.4, 0.7).bending(),
                Parameter::signed("plate_speed_exponent", "1", 0.7, -1.0, 2.2).bending(),
                Parameter::signed("frequency_exponent", "1", 0.7, -3.0, 3.0).bending(),
            ],
        ),
        Law::new(
            "constant shear on the touching time",
            &[FORCE, Parameter::shape("build_up_time", "s", 3e-7, 1.5).bending()],
        ),
        Law::new(
            "developing with the momentary load",
            &[
                FORCE,
                Parameter::shape("load_of_half_attraction", "N", 0.04, 1.0),
                // Peeling takes more force the faster it goes.
                Parameter::signed("speed_exponent", "1", 0.1, 0.0, 0.4).bending(),
            ],
        ),
        Law::new("JKR", &[Parameter::positive("pull_off_force", "N", 0.015, 0.5)]),
        Law::new("across the gap", &[FORCE, Parameter::shape("reach", "m", 3e-7, 1.2)]),
        // Water condenses about the asperities above a humidity.
        Law::new(
            "menisci",
            &[
                FORCE,
                Parameter::between("onset", "%", 25.0, 80.0),
                Parameter::shape("width", "%", 6.0, 0.5).bending(),
            ],
        )
        .needs(&[Need::Humidities]),
    ],
    needs: &[Need::Loads],
    change: |law, theta, pass, design, c| {
        match law {
            0 => {
                let load = (c.normal_force / design.reference_load_n).max(1e-3);
                let frequency = c.frequency / design.reference_frequency_hz;
                let plate = design.plate_speed(c).powf(theta[2]) * frequency.powf(theta[3]);
                c.adhesion = theta[0] * load.powf(theta[1]) * plate;
            }
            5 => {
                let humidity = pass.relative_humidity_pct.unwrap_or(theta[1]);
                c.adhesion = theta[0] / (1.0 + ((theta[1] - humidity) / theta[2]).exp());
            }
            1 => {
                // Added friction for the share of the cycle in which the surfaces touch.
                let touching = if c.amplitude_pp > STILL_PLATE_M {
                    built_up(half_contact_angle(c.load_ratio(), 0.0) / PI, theta[1] * c.frequency)
                } else {
                    1.0
                };
                c.mu0 *= 1.0 + theta[0] * touching / c.normal_force;
            }
            _ if theta[0].is_nan() || theta[0] <= 0.0 => c.attraction = Attraction::None,
            2 => {
                let force = theta[0] * (c.speed / design.reference_speed_m_s).powf(theta[2]);
                c.attraction = Attraction::Developing { force, scale: theta[1] };
            }
            3 => c.attraction = Attraction::Jkr { pull_off: theta[0] },
            _ => c.normal_force = gap::carried(c, theta[0], theta[1]),
        }
    },
    ..Effect::NONE
};

/// Mean over a cycle of an attraction that is fully there after some `time` of contact, in periods, with the
/// surfaces touching for a share of each. Where they never part all of it is there.
fn built_up(touching: f64, time: f64) -> f64 {
    if touching >= 1.0 {
        return 1.0;
    }
    let times = touching / time.max(1e-9);
    if times < 1e-3 { 0.5 * touching * times } else { touching * (1.0 + (-times).exp_m1() / times) }
}
