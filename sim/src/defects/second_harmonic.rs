//! The amplifier distorts: the plate carries a second harmonic, which sharpens or broadens each contact. It
//! grows with the swing, as a distortion does.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[Parameter::log("ratio_at_2_um", 0.01, 0.6), Parameter::linear("phase_rad", 0.0, 6.2)],
    in_library: false,
    act: Act::Contact(|v, _, contact| {
        let swing = 2.0 * contact.sine_amplitude_m / 2e-6;
        contact.motion.second_harmonic = (v[0] * swing.min(2.0)).min(0.9);
        contact.motion.second_phase_rad = v[1];
    }),
    ..DefectKind::cause(DefectSite::Plate, "the plate also vibrates at twice the frequency")
};
