//! Ridges that are damped on their normal spring: they follow the falling plate late and let go early.
//!
//! A light mass (0.1 mg) on spring and dashpot, landing without rebound; the damping is given by the ridge's
//! retardation time.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[Parameter::log("retardation_s", 3e-8, 1e-5)],
    act: Act::Contact(|v, _, contact| {
        contact.ridge.mass_kg = contact.ridge.mass_kg.max(1e-7);
        contact.ridge.damping_n_s_per_m += v[0] * contact.normal_stiffness_n_per_m;
    }),
    ..DefectKind::cause(DefectSite::Contact, "ridges are damped on their normal spring")
};
