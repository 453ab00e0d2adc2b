//! The sensor is slower than its data sheet: its bandwidth is lower. A table of means does not show it.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[Parameter::log("bandwidth_hz", 2.0, 80.0)],
    in_tables: false,
    act: Act::Setup(|v, config| config.sensor.bandwidth_hz = v[0]),
    ..DefectKind::cause(DefectSite::Instrument, "the bandwidth of the force sensor is lower than stated")
};
