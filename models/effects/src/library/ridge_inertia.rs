//! The ridges have mass: they are thrown off and fly.

use super::prelude::*;

/// Beyond critical damping a ridge does not fly, it lags: that is loss in the skin, whatever the mass.
const FLIGHT: &[Parameter] = &[
    Parameter::positive("mass", "kg", 4e-6, 40e-6),
    Parameter::shape("damping_ratio", "1", 0.5, 0.7).at_most(1.0),
];

pub(super) static EFFECT: Effect = Effect {
    name: "ridge_inertia",
    place: Location::Contact,
    summary: "Ridges thrown off by the plate are touched for a shorter part of the cycle; breaks the collapse on w f.",
    source: "areal mass of 0.3 mm of skin over 34 mm2 gives 8 mg; damping ratios 0.05 to 1 (Friesen 2016)",
    laws: &[Law::new("landing without rebound", FLIGHT), Law::new("rebounding", FLIGHT)],
    interpolation_error: crate::contact::impact::STATED_ERROR,
    needs: &[Need::Vibration],
    change: |law, theta, _, _, c| {
        c.mass = theta[0];
        c.ridge_damping_ratio = theta[1];
        c.landing = law;
    },
    prepare: |law, theta| crate::contact::impact::prepare(law, theta[1]),
    ..Effect::NONE
};
