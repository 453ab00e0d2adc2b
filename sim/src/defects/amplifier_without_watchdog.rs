//! The amplifier's own watchdog does not act: whoever drives it must switch it off.

use super::{Act, Kind, Place, Values};
use crate::world::WorldConfig;

pub(super) static KIND: Kind = Kind {
    name: "amplifier_without_watchdog",
    place: Place::Plate,
    in_library: false,
    in_tables: false,
    imitated: false,
    summary: "the amplifier's own watchdog does not act",
    parameters: &[],
    act: Act { setup: Some(act), plate: None, contact: None, forces: None },
};

fn act(_: &Values, config: &mut WorldConfig) {
    config.amplifier.watchdog_s = 1e9;
}
