//! The amplifier ignores its enable input once its output is on: only the supply relay stops it.

use super::*;

pub(super) const KIND: Kind = Kind {
    act: Act::Setup(|_, config| config.amplifier.refuses_off = true),
    ..Kind::fault(Place::Plate, "the amplifier ignores its enable input once its output is on")
};
