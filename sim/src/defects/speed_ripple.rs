//! The spindle's eccentricity makes the speed rise and fall along the stroke, with a third harmonic
//! from a coupling of three jaws.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[
        Parameter::log("ripple", 0.01, 0.7),
        Parameter::log("pitch_m", 3e-3, 1.2e-2),
        Parameter::linear("phase_rad", 0.0, 6.2),
    ],
    act: Act::Contact(|v, at, contact| {
        let phase = 2.0 * std::f64::consts::PI * at.position_m / v[1] + v[2];
        let wave = phase.sin() + 0.2 * (3.0 * phase).sin();
        contact.speed_m_s *= (1.0 + v[0] * wave).max(0.02);
    }),
    ..DefectKind::cause(DefectSite::Instrument, "the speed rises and falls along the stroke")
};
