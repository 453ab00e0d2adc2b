//! The force sensor is slow. A steady mean does not show it.

use super::prelude::*;

pub(super) static EFFECT: Effect = Effect {
    name: "sensor_lag",
    place: Location::Instrument,
    summary: "A lagging force channel rounds edges and opens loops at reversals, but leaves steady means alone.",
    source: "first-order lag; reversal 10-90 time (models::spring_slider::transient)",
    laws: &[Law::new("first order", &[Parameter::positive("time_constant", "s", 0.01, 1.0)])],
    needs: &[Need::Record],
    ..Effect::NONE
};
