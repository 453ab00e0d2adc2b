//! The normal channel's sensitivity is wrong.

use super::prelude::*;

pub(super) static EFFECT: Effect = Effect {
    name: "normal_gain",
    place: Location::Instrument,
    summary: "Normal force read by a constant factor: an exact alias of mu0 and normal stiffness together.",
    source: "calibration drift of force cells; separable only with a dead weight on the normal axis",
    laws: &[Law::new("gain", &[Parameter::signed("log_gain", "1", 0.1, -1.0, 1.0)])
        .certified_by(CertifiedKey::NormalGain)
        .acts_as([-1.0, 1.0, 0.0])
        .seen_by("Hang a dead weight on the normal axis of the force sensor.", 0.005)],
    needs: &[Need::NormalStandard],
    change: |_, theta, _, _, c| c.normal_force *= (-theta[0]).exp(),
    ..Effect::NONE
};
