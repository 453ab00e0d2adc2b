//! Moisture gathers under the finger: friction grows with the time in contact, by a second-order uptake t/(t + tau) and a
//! slow tail, and the ridges soften a little with it. Lifting off starts it anew; a table counts the run as one contact.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[
        Parameter::signed("relative_gain", 0.006, 0.8),
        Parameter::log("half_time_s", 15.0, 400.0),
        Parameter::linear("softening", 0.0, 0.15),
    ],
    act: Act::Contact(|v, at, contact| {
        let t = at.contact_time_s;
        let uptake = 0.8 * t / (t + v[1]) + 0.2 * (1.0 - (-t / (8.0 * v[1])).exp());
        contact.friction *= (1.0 + v[0] * uptake).max(0.05);
        let soft = 1.0 - v[2] * uptake * v[0].abs().min(1.0);
        contact.normal_stiffness_n_per_m *= soft;
        contact.lateral_stiffness_n_per_m *= soft;
    }),
    ..DefectKind::cause(DefectSite::Contact, "friction and softness change with the time in contact")
};
