//! Ridges lean: they are stiffer when stroked one way than the other, as fur is.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[Parameter::signed("asymmetry", 0.02, 0.8)],
    in_library: false,
    act: Act::Contact(|v, at, contact| contact.lateral_stiffness_n_per_m *= (v[0] * at.direction).exp()),
    ..DefectKind::cause(DefectSite::Finger, "ridges are stiffer in one direction than in the other")
};
