//! Bonds need time: the friction limit of a fresh contact grows as t/(t + tau), second-order kinetics.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[Parameter::log("half_time_s", 1e-8, 3e-5)],
    act: Act::Contact(|v, _, contact| contact.limit.dwell_s = v[0]),
    ..DefectKind::cause(DefectSite::Contact, "the friction limit of a fresh contact grows with its age")
};
