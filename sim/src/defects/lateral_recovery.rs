//! Ridges that recover late: skin springs back fast from a large stretch and ever more slowly towards rest.
//!
//! The speed saturates for stretches beyond a knee (yielding bonds, Eyring) and is proportional to them below it.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[Parameter::log("slowness_s_per_m", 10.0, 1000.0), Parameter::log("knee_m", 3e-8, 3e-7)],
    act: Act::Contact(|v, _, contact| {
        contact.recovery = crate::contact::StretchRecovery::Soft { speed_m_s: 1.0 / v[0], knee_m: v[1] };
    }),
    ..DefectKind::cause(DefectSite::Contact, "ridges recover their lateral stretch at a finite speed")
};
