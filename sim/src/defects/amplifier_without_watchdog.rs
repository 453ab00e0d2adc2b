//! The amplifier's own watchdog does not act: whoever drives it must switch it off.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    act: Act::Setup(|_, config| config.amplifier.watchdog_s = 1e9),
    ..DefectKind::fault(DefectSite::Plate, "the amplifier's own watchdog does not act")
};
