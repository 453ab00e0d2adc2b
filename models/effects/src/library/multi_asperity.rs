//! Not one slider but many, of unequal height.

use super::prelude::*;
use crate::contact::asperities::Heights;

/// See the module.
pub struct MultiAsperity;

static LAWS: [Law; 3] = [
    Law::new("Gaussian heights", &[Parameter::positive("height_sd", "m", 0.5e-6, 6e-6)]),
    Law::new("exponential heights", &[Parameter::positive("height_scale", "m", 0.5e-6, 6e-6)]),
    Law::new("even heights", &[Parameter::positive("height_sd", "m", 0.5e-6, 6e-6)]),
];

impl Effect for MultiAsperity {
    fn name(&self) -> &'static str {
        "multi_asperity"
    }
    fn place(&self) -> Place {
        Place::Contact
    }
    fn summary(&self) -> &'static str {
        "Asperities of unequal height touch for unequal times: no kink at the onset, a tail at large amplitude."
    }
    fn source(&self) -> &'static str {
        "roughness scale of 0.5 to 3 um; independent sliders on shares of the springs"
    }
    fn laws(&self) -> &'static [Law] {
        &LAWS
    }
    fn needs(&self) -> &'static [Need] {
        &[Need::Vibration, Need::Amplitudes]
    }
    fn change(&self, law: usize, theta: &[f64], _: &Condition, _: &Design, c: &mut Contact) {
        c.asperity_height = theta[0];
        c.asperity_heights = match law {
            0 => Heights::Gaussian,
            1 => Heights::Exponential,
            _ => Heights::Even,
        };
    }
}
