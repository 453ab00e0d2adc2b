//! The normal spring is retarded: it pushes harder on the way up and lags on the way down.

use crate::prelude::*;

/// See the module.
pub struct NormalDamping;

static LAWS: [Law; 2] = [
    Law { name: "Kelvin-Voigt", parameters: &[Parameter::positive("retardation_time", "s", 4e-6, 1e-4)] },
    Law { name: "constant loss factor", parameters: &[Parameter::positive("loss_factor", "1", 0.6, 10.0)] },
];

impl Effect for NormalDamping {
    fn name(&self) -> &'static str {
        "normal_damping"
    }
    fn place(&self) -> Place {
        Place::Contact
    }
    fn summary(&self) -> &'static str {
        "A dashpot beside the normal spring changes how long, and how hard, ridge and plate touch."
    }
    fn source(&self) -> &'static str {
        "Kelvin-Voigt normal spring; damping ratios 0.05 to 1 of ridges at 26 to 114 kHz; Friesen 2016"
    }
    fn laws(&self) -> &'static [Law] {
        &LAWS
    }
    fn needs(&self) -> &'static [Need] {
        &[Need::Vibration]
    }
    fn change(&self, law: usize, theta: &[f64], _: &Operating, _: &Design, c: &mut Contact) {
        c.normal_retardation_time = match law {
            0 => theta[0],
            _ => theta[0] / (2.0 * std::f64::consts::PI * c.frequency),
        };
    }
}
