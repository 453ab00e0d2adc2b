//! The stage stalls: from a time on its slide stands still, whatever its command.

use super::{Act, Kind, Parameter, Place, Values};
use crate::world::WorldConfig;

pub(super) static KIND: Kind = Kind {
    name: "stage_stall",
    place: Place::Instrument,
    in_library: false,
    in_tables: false,
    imitated: false,
    summary: "the stage's slide stands still from a time on",
    parameters: &[Parameter::log("from_s", 0.5, 30.0)],
    act: Act { setup: Some(act), plate: None, contact: None, forces: None },
};

fn act(v: &Values, config: &mut WorldConfig) {
    config.stage.stalls_at_s = v[0];
}
