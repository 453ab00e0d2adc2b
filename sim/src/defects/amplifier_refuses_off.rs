//! The amplifier ignores its enable input once its output is on: only the supply relay stops it.

use super::{Act, Kind, Place, Values};
use crate::world::WorldConfig;

pub(super) static KIND: Kind = Kind {
    name: "amplifier_refuses_off",
    place: Place::Plate,
    in_library: false,
    in_tables: false,
    imitated: false,
    summary: "the amplifier ignores its enable input once its output is on",
    parameters: &[],
    act: Act { setup: Some(act), plate: None, contact: None, forces: None },
};

fn act(_: &Values, config: &mut WorldConfig) {
    config.amplifier.refuses_off = true;
}
