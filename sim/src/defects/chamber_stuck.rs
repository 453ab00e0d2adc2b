//! The chamber takes set-points, echoes them, and leaves the air as it is.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    act: Act::Setup(|_, config| config.room.chamber.stuck = true),
    ..DefectKind::fault(DefectSite::Instrument, "the chamber takes set-points and leaves the air as it is")
};
