//! The plate does not move straight up and down: a share of its motion lies along the sliding direction, at
//! the same frequency, so the ridges are dragged to and fro in every contact.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[Parameter::log("share", 0.003, 0.5), Parameter::linear("phase_rad", 0.0, 6.2)],
    in_library: false,
    act: Act::Contact(|v, at, contact| {
        contact.motion.in_plane = v[0];
        // Seen along the sliding direction the phase turns by half a turn when the direction does.
        contact.motion.in_plane_phase_rad = v[1] + if at.direction < 0.0 { std::f64::consts::PI } else { 0.0 };
    }),
    ..DefectKind::cause(DefectSite::Plate, "the plate also vibrates along the sliding direction")
};
