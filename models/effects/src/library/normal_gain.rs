//! The normal channel's sensitivity is wrong.

use super::prelude::*;

/// See the module.
pub struct NormalGain;

static LAWS: [Law; 1] = [Law::new("gain", &[Parameter::signed("log_gain", "1", 0.1, -1.0, 1.0)])
    .certified_by(CertifiedKey::NormalGain)
    .acts_as([-1.0, 1.0, 0.0])
    .seen_by("Hang a dead weight on the normal axis of the force sensor.", 0.005)];

impl Effect for NormalGain {
    fn name(&self) -> &'static str {
        "normal_gain"
    }
    fn place(&self) -> Place {
        Place::Instrument
    }
    fn summary(&self) -> &'static str {
        "Normal force read by a constant factor: an exact alias of mu0 and normal stiffness together."
    }
    fn source(&self) -> &'static str {
        "calibration drift of force cells; separable only with a dead weight on the normal axis"
    }
    fn laws(&self) -> &'static [Law] {
        &LAWS
    }
    fn needs(&self) -> &'static [Need] {
        &[Need::NormalStandard]
    }
    fn change(&self, _: usize, theta: &[f64], _: &Condition, _: &Design, c: &mut Contact) {
        c.normal_force *= (-theta[0]).exp();
    }
}
