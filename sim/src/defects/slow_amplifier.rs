//! The amplifier's amplitude control is slower than the plate. Steady passes do not show it.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[Parameter::log("response_s", 1.5e-3, 6e-3)],
    act: Act::Setup(|v, config| config.amplifier.response_s = v[0]),
    ..DefectKind::fault(DefectSite::Plate, "the amplitude control of the amplifier follows its set-point slowly")
};
