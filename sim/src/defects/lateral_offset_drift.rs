//! The lateral zero is off and settles as the sensor warms: an offset that relaxes exponentially to another.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[
        Parameter::signed("end_n", 4e-4, 0.04),
        Parameter::linear("start_over_end", -1.0, 1.0),
        Parameter::log("time_s", 40.0, 600.0),
    ],
    act: Act::Forces(|v, at, forces| {
        let settled = 1.0 - (-at.time_s / v[2]).exp();
        forces.lateral_n += v[0] * (v[1] + (1.0 - v[1]) * settled);
    }),
    ..DefectKind::cause(DefectSite::Instrument, "the zero of the lateral force is off and drifts")
};
