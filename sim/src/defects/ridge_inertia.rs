//! Ridges with mass: they overshoot, fly and land on a lossy skin.
//!
//! A ridge's landing takes as long as its mass needs on the skin's own stiffness, and gives back what the skin's loss
//! leaves. Areal mass of the stratum corneum and papillary dermis over the contact area: up to some 8 mg.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[
        Parameter::log("mass_kg", 1e-7, 8e-6),
        Parameter::log("damping_ratio", 0.3, 1.0),
        Parameter::log("skin_loss", 0.15, 0.6),
    ],
    act: Act::Contact(|v, _, contact| {
        let critical = 2.0 * (contact.normal_stiffness_n_per_m * v[0]).sqrt();
        contact.ridge.mass_kg = v[0];
        contact.ridge.damping_n_s_per_m = v[1] * critical;
        contact.ridge.skin_ratio = 20.0;
        contact.ridge.skin_loss = v[2];
    }),
    ..DefectKind::cause(DefectSite::Contact, "ridges have mass: they overshoot, fly and land")
};
