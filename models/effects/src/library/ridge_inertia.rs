//! The ridges have mass: they are thrown off and fly.

use super::prelude::*;

/// See the module.
pub struct RidgeInertia;

// Beyond critical damping a ridge does not fly, it lags: that is loss in the skin, whatever the mass.
static LAWS: [Law; 2] = [
    Law::new(
        "landing without rebound",
        &[
            Parameter::positive("mass", "kg", 4e-6, 40e-6),
            Parameter::shape("damping_ratio", "1", 0.5, 0.7).at_most(1.0),
        ],
    ),
    Law::new(
        "rebounding",
        &[
            Parameter::positive("mass", "kg", 4e-6, 40e-6),
            Parameter::shape("damping_ratio", "1", 0.5, 0.7).at_most(1.0),
        ],
    ),
];

impl Effect for RidgeInertia {
    fn name(&self) -> &'static str {
        "ridge_inertia"
    }
    fn place(&self) -> Place {
        Place::Contact
    }
    fn summary(&self) -> &'static str {
        "Ridges thrown off by the plate are touched for a shorter part of the cycle; breaks the collapse on w f."
    }
    fn source(&self) -> &'static str {
        "areal mass of 0.3 mm of skin over 34 mm2 gives 8 mg; damping ratios 0.05 to 1 (Friesen 2016)"
    }
    fn laws(&self) -> &'static [Law] {
        &LAWS
    }
    fn interpolation_error(&self) -> f64 {
        crate::contact::impact::STATED_ERROR
    }
    fn needs(&self) -> &'static [Need] {
        &[Need::Vibration]
    }
    fn change(&self, law: usize, theta: &[f64], _: &Condition, _: &Design, c: &mut Contact) {
        c.mass = theta[0];
        c.ridge_damping_ratio = theta[1];
        c.landing = law;
    }
    fn prepare(&self, law: usize, theta: &[f64]) {
        crate::contact::impact::prepare(law, theta[1]);
    }
}
