//! The ridges have mass: they are thrown off and fly.

use super::prelude::*;
use crate::operating::PLATE_SPEEDS;

/// Beyond critical damping a ridge does not fly, it lags: that is loss in the skin, whatever the mass.
const MOST_DAMPED: f64 = 1.0;

const FLIGHT: &[Parameter] = &[
    Parameter::positive("mass", "kg", 4e-6, 40e-6),
    Parameter::shape("damping_ratio", "1", 0.5, 0.7).at_most(MOST_DAMPED),
    // A damping of the square grows with the plate's speed; one that thins with shear falls.
    Parameter::signed("plate_speed_exponent", "1", 0.2, -1.0, 1.5).bending(),
    // Where sweat fills the grooves the ridges are heavy; the others follow the plate.
    Parameter::positive("share_without_mass", "1", 0.3, 0.9).bending(),
];

pub(super) static EFFECT: Effect = Effect {
    name: "ridge_inertia",
    place: Location::Contact,
    summary: "Ridges thrown off by the plate are touched for a shorter part of the cycle; breaks the collapse on w f.",
    source: "areal mass of 0.3 mm of skin over 34 mm2 gives 8 mg; damping ratios 0.05 to 1 (Friesen 2016)",
    laws: &[
        Law::new("landing without rebound", FLIGHT),
        Law::new("rebounding", FLIGHT),
        Law::new("within soft skin", FLIGHT),
    ],
    interpolation_error: crate::contact::impact::STATED_ERROR,
    needs: &[Need::Vibration],
    change: |law, theta, _, design, c| {
        c.mass = theta[0];
        c.ridge_damping_ratio = damping_ratio(theta, design.plate_speed(c));
        c.landing = law;
        c.massless_share = theta[3];
    },
    prepare: |law, theta| crate::contact::impact::prepare(law, PLATE_SPEEDS.map(|s| damping_ratio(theta, s))),
    ..Effect::NONE
};

/// Damping ratio at a peak speed of the plate over the design's largest.
fn damping_ratio(theta: &[f64], speed: f64) -> f64 {
    (theta[1] * speed.powf(theta[2])).min(MOST_DAMPED)
}
