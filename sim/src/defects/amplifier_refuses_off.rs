//! The amplifier ignores its enable input once its output is on: only the supply relay stops it.

use super::*;

pub(super) static KIND: Kind = Kind {
    act: Act::Setup(|_, config| config.amplifier.refuses_off = true),
    ..Kind::fault(
        "amplifier_refuses_off",
        Place::Plate,
        "the amplifier ignores its enable input once its output is on",
    )
};
