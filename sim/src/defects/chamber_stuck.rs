//! The chamber takes set-points, echoes them, and leaves the air as it is.

use super::{Act, Kind, Place, Values};
use crate::world::WorldConfig;

pub(super) static KIND: Kind = Kind {
    name: "chamber_stuck",
    place: Place::Instrument,
    in_library: false,
    in_tables: false,
    imitated: false,
    summary: "the chamber takes set-points and leaves the air as it is",
    parameters: &[],
    act: Act { setup: Some(act), plate: None, contact: None, forces: None },
};

fn act(_: &Values, config: &mut WorldConfig) {
    config.room.chamber.stuck = true;
}
