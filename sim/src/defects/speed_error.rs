//! The stage does not slide as fast as it says: a scale, and a slip that grows with speed.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[Parameter::factor("factor", 0.02, 0.8)],
    imitated: true,
    act: Act::Contact(|v, _, contact| {
        let speed = contact.speed_m_s;
        contact.speed_m_s = speed * (1.0 + (v[0] - 1.0) * (0.9 + 0.2 * speed / (speed + 0.05)));
    }),
    ..DefectKind::cause(DefectSite::Instrument, "the true sliding speed is not the one stated")
};
