//! The plate vibrates in a standing wave with a travelling remainder: the amplitude under the finger depends
//! on where it is, and a near field of bending at the driven edge. The half wave of a 2 mm glass plate is 14
//! mm at 25 kHz and shortens as the square root of the frequency.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[
        Parameter::log("depth", 0.01, 0.95),
        Parameter::linear("phase_rad", 0.0, 3.1),
        Parameter::log("half_wave_at_25_khz_m", 8e-3, 2e-2),
        Parameter::linear("edge_over_wave", 0.1, 0.4),
    ],
    act: Act::Plate(|v, at, pp_m| {
        let half_wave = v[2] * (25e3 / at.frequency_hz.max(1.0)).sqrt();
        let phase = std::f64::consts::PI * at.position_m / half_wave + v[1];
        // Standing wave with the given share; the rest travels and leaves no node.
        // A bending wave's near field decays over a half wave over pi.
        let edge = v[0] * v[3] * (-std::f64::consts::PI * (at.position_m + EDGE_M) / half_wave).exp();
        pp_m * (1.0 - v[0] + v[0] * phase.cos().abs() + edge)
    }),
    ..DefectKind::cause(DefectSite::Plate, "the amplitude depends on the position along the plate")
};

/// Distance of the driven edge from the middle of the stroke (m).
const EDGE_M: f64 = 0.02;
