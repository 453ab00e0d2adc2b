//! The plate is tilted against the sensor, and bent: the tilt changes along the stroke.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[
        Parameter::signed("tilt_rad", 0.0015, 0.12),
        Parameter::linear("bend_over_tilt", -0.6, 0.6),
    ],
    imitated: true,
    act: Act::Forces(act),
    ..DefectKind::cause(Location::Instrument, "the plate is tilted against the sensor")
};

/// Distance from the middle at which the bend is stated (m).
const HALF_STROKE_M: f64 = 0.015;

fn act(v: &Values, at: &Surroundings, forces: &mut Forces) {
    let tilt = v[0] * (1.0 + v[1] * at.position_m / HALF_STROKE_M);
    let (sin, cos) = tilt.sin_cos();
    let Forces { lateral_n, normal_n } = *forces;
    forces.lateral_n = lateral_n * cos + normal_n * sin;
    forces.normal_n = normal_n * cos - lateral_n * sin;
}
