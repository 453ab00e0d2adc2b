//! The lateral channel of the force sensor feels the normal force, or the other way round.

use super::prelude::*;

/// See the module.
pub struct ForceCrosstalk;

/// What sees it without friction.
const CHECK: &str =
    "Press on the sensor with a dead weight and no motion, plate levelled; read the lateral axis.";

static LAWS: [Law; 2] = [
    Law::new("normal into lateral", &[Parameter::signed("crosstalk", "1", 0.03, -0.3, 0.3)])
        .certified_by(CertifiedKey::Crosstalk)
        .same_as("plate_tilt", "rotation")
        .seen_by(CHECK, 0.001),
    Law::new("lateral into normal", &[Parameter::signed("crosstalk", "1", 0.08, -0.5, 0.5)])
        .certified_by(CertifiedKey::CrosstalkOntoNormal)
        .seen_by(CHECK, 0.001),
];

impl Effect for ForceCrosstalk {
    fn name(&self) -> &'static str {
        "force_crosstalk"
    }
    fn place(&self) -> Place {
        Place::Instrument
    }
    fn summary(&self) -> &'static str {
        "A share of the normal force is read as lateral force, the same in both directions (or the reverse)."
    }
    fn source(&self) -> &'static str {
        "cross-talk of 0.3 to 13 % of uncalibrated multi-axis cells"
    }
    fn laws(&self) -> &'static [Law] {
        &LAWS
    }
    fn departs_by(&self) -> f64 {
        0.05
    }
    fn near(&self) -> &'static [&'static str] {
        &["plate_tilt"]
    }
    fn needs(&self) -> &'static [Need] {
        &[Need::Directions]
    }
    fn change(&self, law: usize, theta: &[f64], pass: &Condition, _: &Design, c: &mut Contact) {
        if law == 1 {
            super::plate_tilt::unload(c, pass.direction.sign(), -theta[0]);
        }
    }
    fn read(&self, law: usize, theta: &[f64], _: &Condition, _: &Design, reading: &mut Reading) {
        if law == 0 {
            reading.crosstalk += theta[0];
        }
    }
}
