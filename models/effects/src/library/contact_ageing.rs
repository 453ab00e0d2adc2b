//! Bonds need time to form after each touch-down.

use super::prelude::*;

/// See the module.
pub struct ContactAgeing;

static LAWS: [Law; 4] = [
    Law::new("first order", &[Parameter::positive("bonding_time", "s", 15e-6, 1e-3)]),
    Law::new("stretched (root)", &[Parameter::positive("bonding_time", "s", 15e-6, 1e-3)]),
    Law::new("by mean contact time", &[Parameter::positive("bonding_time", "s", 10e-6, 1e-3)]),
    Law::new(
        "a share at once, the rest by mean contact time",
        &[
            Parameter::positive("bonding_time", "s", 15e-6, 1e-3),
            Parameter::between("share_that_waits", "1", 0.1, 1.0),
        ],
    ),
];

impl Effect for ContactAgeing {
    fn name(&self) -> &'static str {
        "contact_ageing"
    }
    fn place(&self) -> Place {
        Place::Contact
    }
    fn summary(&self) -> &'static str {
        "Short contacts have not yet formed all their bonds, so the limit is lower than mu0 F."
    }
    fn source(&self) -> &'static str {
        "stochastic adhesion (section 5.4 of the paper); bonding times of 1 to 100 us"
    }
    fn laws(&self) -> &'static [Law] {
        &LAWS
    }
    fn needs(&self) -> &'static [Need] {
        &[Need::Vibration]
    }
    fn change(&self, law: usize, theta: &[f64], _: &Condition, _: &Design, c: &mut Contact) {
        if law < 2 {
            c.bonding_time = theta[0];
            c.bonding_exponent = if law == 0 { 1.0 } else { 0.5 };
        } else if c.amplitude_pp > crate::contact::STILL_PLATE_M {
            let phi = crate::contact::half_contact_angle(c.load_ratio(), 0.0);
            if phi < std::f64::consts::PI {
                let time = phi / (std::f64::consts::PI * c.frequency);
                let bound = time / (time + theta[0]);
                c.mu0 *= if law == 2 { bound } else { 1.0 - theta[1] * (1.0 - bound) };
            }
        }
    }
}
