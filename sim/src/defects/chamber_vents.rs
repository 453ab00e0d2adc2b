//! The chamber's valve opens during the run: what it held escapes.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[Parameter::linear("at_s", 5.0, 600.0)],
    act: Act::Setup(|v, config| config.room.chamber.vents_at_s = v[0]),
    ..DefectKind::fault(DefectSite::Instrument, "the chamber's valve opens during the run, and what it held escapes")
};
