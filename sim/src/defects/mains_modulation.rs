//! The amplifier's supply hums: the amplitude swings at twice the mains frequency, far slower than the plate and far faster
//! than a pass, and friction is the mean over it. It is worst at low set-points, where the supply is least loaded.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[Parameter::log("depth", 0.05, 0.95), Parameter::log("corner_m", 6e-6, 3e-5)],
    in_library: false,
    act: Act::Contact(|v, _, contact| {
        let pp = 2.0 * contact.sine_amplitude_m;
        contact.motion.modulation = (v[0] / (1.0 + pp / v[1])).min(0.95);
    }),
    ..DefectKind::cause(DefectSite::Plate, "the amplitude is modulated at twice the mains frequency")
};
