//! Forces arrive later than they are stamped: the link holds them back. A table of means does not show it.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[Parameter::log("delay_s", 2e-3, 0.1)],
    in_tables: false,
    act: Act::Setup(|v, config| {
        config.sensor.latency_s += v[0];
        config.sensor.unstated_latency_s += v[0];
    }),
    ..DefectKind::cause(DefectSite::Instrument, "forces arrive later than stated")
};
