//! The chamber's valve opens during the run: what it held escapes.

use super::{Act, Kind, Parameter, Place, Values};
use crate::world::WorldConfig;

pub(super) static KIND: Kind = Kind {
    name: "chamber_vents",
    place: Place::Instrument,
    in_library: false,
    in_tables: false,
    imitated: false,
    summary: "the chamber's valve opens during the run, and what it held escapes",
    parameters: &[Parameter::linear("at_s", 5.0, 600.0)],
    act: Act { setup: Some(act), plate: None, contact: None, forces: None },
};

fn act(v: &Values, config: &mut WorldConfig) {
    config.room.chamber.vents_at_s = v[0];
}
