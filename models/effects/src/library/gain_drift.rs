//! The gain of the lateral channel drifts. A cause that the library does not name.

use super::prelude::*;

pub(super) static EFFECT: Effect = Effect {
    name: "gain_drift",
    place: Location::Instrument,
    summary: "The sensitivity of the lateral channel drifts over the table.",
    source: "charge amplifiers and gauges that warm up change their gain by some per cent in a session",
    laws: &[Law::new("linear drift", &[Parameter::signed("drift_over_table", "1", 0.05, -0.5, 0.5)])],
    words: Some("a drifting gain of the lateral channel"),
    needs: &[Need::Time],
    read: |_, theta, pass, design, reading| {
        reading.gain *= 1.0 + theta[0] * (pass.time_s / design.duration_s.max(1e-9) - 0.5);
    },
    ..Effect::NONE
};
