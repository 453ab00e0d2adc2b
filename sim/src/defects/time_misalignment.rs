//! Forces arrive later than they are stamped: the link holds them back. A table of means does not show it.

use super::{Act, Kind, Parameter, Place, Values};
use crate::world::WorldConfig;

pub(super) static KIND: Kind = Kind {
    name: "time_misalignment",
    place: Place::Instrument,
    in_library: true,
    in_tables: false,
    imitated: false,
    summary: "forces arrive later than stated",
    parameters: &[Parameter::log("delay_s", 2e-3, 0.1)],
    act: Act { setup: Some(act), plate: None, contact: None, forces: None },
};

fn act(v: &Values, config: &mut WorldConfig) {
    config.sensor.latency_s += v[0];
}
