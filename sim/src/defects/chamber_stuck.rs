//! The chamber takes set-points, echoes them, and leaves the air as it is.

use super::*;

pub(super) const KIND: Kind = Kind {
    act: Act::Setup(|_, config| config.room.chamber.stuck = true),
    ..Kind::fault(Place::Instrument, "the chamber takes set-points and leaves the air as it is")
};
