//! The ridges have mass: they are thrown off and fly.

use crate::prelude::*;

/// See the module.
pub struct RidgeInertia;

static LAWS: [Law; 4] = [
    Law { name: "damping ratio 0.3", parameters: &[Parameter::positive("mass", "kg", 4e-6, 40e-6)] },
    Law { name: "damping ratio 1", parameters: &[Parameter::positive("mass", "kg", 4e-6, 40e-6)] },
    Law {
        name: "rebounding, damping ratio 0.15",
        parameters: &[Parameter::positive("mass", "kg", 4e-6, 40e-6)],
    },
    Law {
        name: "rebounding, damping ratio 0.5",
        parameters: &[Parameter::positive("mass", "kg", 4e-6, 40e-6)],
    },
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
        "areal mass of 0.3 mm of skin over 34 mm2 gives 8 mg; bouncing oscillator with inelastic touch-down"
    }
    fn laws(&self) -> &'static [Law] {
        &LAWS
    }
    fn needs(&self) -> &'static [Need] {
        &[Need::Vibration]
    }
    fn change(&self, law: usize, theta: &[f64], _: &Operating, _: &Design, c: &mut Contact) {
        c.mass = theta[0];
        c.damping_class = law;
    }
}
