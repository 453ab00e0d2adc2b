//! The normal spring is retarded: it pushes harder on the way up and lags on the way down.

use super::prelude::*;

/// See the module.
pub struct NormalDamping;

static LAWS: [Law; 3] = [
    Law::new("Kelvin-Voigt", &[Parameter::positive("retardation_time", "s", 4e-6, 1e-4)]),
    Law::new("constant loss factor", &[Parameter::positive("loss_factor", "1", 0.6, 10.0)]),
    // Storage and loss at the vibration's frequency of a spring beside a spring and dashpot in series.
    Law::new(
        "standard linear solid",
        &[
            Parameter::positive("relaxing_share", "1", 1.0, 10.0),
            Parameter::shape("relaxation_time", "s", 5e-6, 1.0),
        ],
    ),
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
    fn near(&self) -> &'static [&'static str] {
        &["ridge_inertia"]
    }
    fn needs(&self) -> &'static [Need] {
        &[Need::Vibration]
    }
    fn change(&self, law: usize, theta: &[f64], _: &Condition, _: &Design, c: &mut Contact) {
        let omega = 2.0 * std::f64::consts::PI * c.frequency;
        c.normal_retardation_time = match law {
            0 => theta[0],
            1 => theta[0] / omega,
            _ => {
                let x = omega * theta[1];
                let storage = 1.0 + theta[0] * x * x / (1.0 + x * x);
                c.normal_stiffness *= storage;
                theta[0] * theta[1] / (1.0 + x * x) / storage
            }
        };
    }
}
