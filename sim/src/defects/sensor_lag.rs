//! The sensor is slower than its data sheet: its bandwidth is lower. A table of means does not show it.

use super::{Act, Kind, Parameter, Place, Values};
use crate::world::WorldConfig;

pub(super) static KIND: Kind = Kind {
    name: "sensor_lag",
    place: Place::Instrument,
    in_library: true,
    in_tables: false,
    imitated: false,
    summary: "the bandwidth of the force sensor is lower than stated",
    parameters: &[Parameter::log("bandwidth_hz", 2.0, 80.0)],
    act: Act { setup: Some(act), plate: None, contact: None, forces: None },
};

fn act(v: &Values, config: &mut WorldConfig) {
    config.sensor.bandwidth_hz = v[0];
}
