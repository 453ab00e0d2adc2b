//! Sliding charges the plate, vibration sheds the charge: an attraction that grows with speed, and is shaken off by swing.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[Parameter::log("attraction_n", 1e-3, 0.15), Parameter::log("speed_m_s", 5e-3, 5e-2)],
    in_library: false,
    act: Act::Contact(|v, _, contact| {
        let shed = 1.0 / (1.0 + (2.0 * contact.sine_amplitude_m / 1e-6).powi(2));
        contact.normal_force_n += v[0] * shed * contact.speed_m_s / (contact.speed_m_s + v[1]);
    }),
    ..DefectKind::cause(DefectSite::Contact, "sliding charges the plate, and the charge attracts the finger")
};
