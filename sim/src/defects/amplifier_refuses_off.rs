//! The amplifier ignores its enable input once its output is on: only the supply relay stops it.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    act: Act::Setup(|_, config| config.amplifier.refuses_off = true),
    ..DefectKind::fault(DefectSite::Plate, "the amplifier ignores its enable input once its output is on")
};
