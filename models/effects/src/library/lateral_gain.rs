//! The lateral channel's sensitivity is wrong.

use super::prelude::*;

/// See the module.
pub struct LateralGain;

static LAWS: [Law; 1] = [Law::new("gain", &[Parameter::signed("log_gain", "1", 0.1, -1.0, 1.0)])
    .certified_by(CertifiedKey::LateralGain)
    .acts_as([1.0, 0.0, 1.0])
    .seen_by("Hang a dead weight on the lateral axis of the force sensor.", 0.005)];

impl Effect for LateralGain {
    fn name(&self) -> &'static str {
        "lateral_gain"
    }
    fn place(&self) -> Place {
        Place::Instrument
    }
    fn summary(&self) -> &'static str {
        "Lateral force read by a constant factor: an exact alias of mu0 and lateral stiffness together."
    }
    fn source(&self) -> &'static str {
        "calibration drift of force cells; separable only with a dead weight on the lateral axis"
    }
    fn laws(&self) -> &'static [Law] {
        &LAWS
    }
    fn needs(&self) -> &'static [Need] {
        &[Need::OutsideStandard]
    }
    fn read(&self, _: usize, theta: &[f64], _: &Condition, _: &Design, reading: &mut Reading) {
        reading.gain *= theta[0].exp();
    }
}
