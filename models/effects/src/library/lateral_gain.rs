//! The lateral channel's sensitivity is wrong.

use super::prelude::*;

pub(super) static EFFECT: Effect = Effect {
    name: "lateral_gain",
    place: Location::Instrument,
    summary: "Lateral force read by a constant factor: an exact alias of mu0 and lateral stiffness together.",
    source: "calibration drift of force cells; separable only with a dead weight on the lateral axis",
    laws: &[Law::new("gain", &[Parameter::signed("log_gain", "1", 0.1, -1.0, 1.0)])
        .certified_by(CertifiedKey::LateralGain)
        .acts_as([1.0, 0.0, 1.0])
        .seen_by("Hang a dead weight on the lateral axis of the force sensor.", 0.005)],
    needs: &[Need::OutsideStandard],
    read: |_, theta, _, _, reading| reading.gain *= theta[0].exp(),
    ..Effect::NONE
};
