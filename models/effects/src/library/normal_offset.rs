//! The normal force that is read is not the one that loads the contact.

use super::prelude::*;

/// See the module.
pub struct NormalOffset;

/// What sees it without friction.
const CHECK: &str = "Lift the finger and read the normal force; put a dead weight on it.";

static LAWS: [Law; 2] = [
    Law::new("constant", &[Parameter::signed("offset", "N", 0.03, -0.5, 0.5)])
        .certified_by(CertifiedKey::NormalOffset)
        .seen_by(CHECK, 0.001),
    Law::new("drift over the table", &[Parameter::signed("offset", "N", 0.03, -0.5, 0.5)])
        .seen_by(CHECK, 0.001),
];

impl Effect for NormalOffset {
    fn name(&self) -> &'static str {
        "normal_offset"
    }
    fn place(&self) -> Place {
        Place::Instrument
    }
    fn summary(&self) -> &'static str {
        "Measured normal force = true force + offset; the contact is loaded by the true one."
    }
    fn source(&self) -> &'static str {
        "taring with something on the cell; offsets up to 8 % of range"
    }
    fn laws(&self) -> &'static [Law] {
        &LAWS
    }
    fn needs(&self) -> &'static [Need] {
        &[Need::Loads]
    }
    fn change(&self, law: usize, theta: &[f64], pass: &Condition, design: &Design, c: &mut Contact) {
        let share = if law == 0 { 1.0 } else { pass.time_s / design.duration_s.max(1e-9) };
        c.normal_force = (c.normal_force - theta[0] * share).max(LEAST_SHARE * c.normal_force);
    }
}
