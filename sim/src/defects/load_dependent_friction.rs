//! Part of the friction is carried by an area that grows as the 2/3 power of the force (Bowden and Tabor on a
//! Hertzian junction), the rest is Coulomb's. It acts on the force of each instant, so it lowers friction
//! under vibration even where nothing sticks.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[Parameter::log("area_share", 0.01, 0.95)],
    act: Act::Contact(|v, _, contact| {
        contact.limit.area_share = v[0].min(1.0);
        contact.limit.area_reference_n = REFERENCE_N;
    }),
    ..DefectKind::cause(DefectSite::Contact, "part of the friction limit grows as the 2/3 power of the force")
};

/// Force at which the share leaves the friction as it was (N).
const REFERENCE_N: f64 = 0.25;
