//! The zero of the normal force is off: the contact is loaded by the true force, the table holds another. The
//! zero sinks in part while the finger warms the sensor.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[Parameter::signed("offset_n", 1.5e-3, 0.12), Parameter::linear("sinking", 0.1, 0.5)],
    act: Act::Forces(|v, at, forces| {
        forces.normal_n += v[0] * (1.0 - v[1] * (1.0 - (-at.time_s / 200.0).exp()));
    }),
    ..DefectKind::cause(DefectSite::Instrument, "the zero of the normal force is off")
};
