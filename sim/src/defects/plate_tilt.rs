//! The plate is tilted against the sensor, and waved: the tilt changes along the stroke.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[
        Parameter::signed("tilt_rad", 0.0015, 0.12),
        Parameter::linear("wave_over_tilt", -0.6, 0.6),
    ],
    imitated: true,
    act: Act::Forces(|v, at, forces| {
        let wave = (2.0 * std::f64::consts::PI * at.position_m / WAVE_M).sin();
        let tilt = v[0] * (1.0 + v[1] * wave);
        let (sin, cos) = tilt.sin_cos();
        let Forces { lateral_n, normal_n } = *forces;
        forces.lateral_n = lateral_n * cos + normal_n * sin;
        forces.normal_n = normal_n * cos - lateral_n * sin;
    }),
    ..DefectKind::cause(DefectSite::Instrument, "the plate is tilted against the sensor")
};

/// Length of the waves (m).
const WAVE_M: f64 = 0.012;
