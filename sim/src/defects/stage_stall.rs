//! The stage stalls: from a time on its slide stands still, whatever its command.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[Parameter::log("from_s", 0.5, 30.0)],
    act: Act::Setup(|v, config| config.stage.stalls_at_s = v[0]),
    ..DefectKind::fault(DefectSite::Instrument, "the stage's slide stands still from a time on")
};
