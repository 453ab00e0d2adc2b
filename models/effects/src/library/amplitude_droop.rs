//! The finger loads the plate and its amplitude falls.

use super::prelude::*;

/// See the module.
pub struct AmplitudeDroop;

/// What sees it without friction.
const CHECK: &str = "Measure the plate with a vibrometer while the finger is pressed on it.";

static LAWS: [Law; 3] = [
    Law::new("impedance by load", &[Parameter::positive("droop_per_load", "1/N", 0.7, 10.0)])
        .seen_by(CHECK, 0.05),
    Law::new("impedance by Hertz area", &[Parameter::positive("droop_at_one_newton", "N^-2/3", 0.5, 8.0)])
        .seen_by(CHECK, 0.05),
    Law::new("linear loss", &[Parameter::positive("droop_per_load", "1/N", 0.4, 3.0)]).seen_by(CHECK, 0.05),
];

impl Effect for AmplitudeDroop {
    fn name(&self) -> &'static str {
        "amplitude_droop"
    }
    fn place(&self) -> Place {
        Place::Plate
    }
    fn summary(&self) -> &'static str {
        "An amplifier without amplitude control lets w fall as the finger's impedance is pressed on the plate."
    }
    fn source(&self) -> &'static str {
        "plate impedance M omega/Q of 9 N s/m against 50 to 150 N s/m of a fingertip (upper bound)"
    }
    fn laws(&self) -> &'static [Law] {
        &LAWS
    }
    fn needs(&self) -> &'static [Need] {
        &[Need::Vibration, Need::Loads]
    }
    fn change(&self, law: usize, theta: &[f64], _: &Condition, _: &Design, c: &mut Contact) {
        c.amplitude_pp *= match law {
            0 => 1.0 / (1.0 + theta[0] * c.normal_force),
            1 => 1.0 / (1.0 + theta[0] * c.normal_force.max(0.0).powf(2.0 / 3.0)),
            _ => (1.0 - theta[0] * c.normal_force).max(0.02),
        };
    }
}
