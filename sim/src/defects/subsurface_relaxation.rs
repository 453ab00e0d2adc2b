//! The tissue under the ridges creeps: the compression under a given load grows with the time in contact, by a power law
//! without any relaxation time of its own (fractional viscoelasticity, exponent 0.25); the ridges lean with it, and their lateral stiffness falls more or less along.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[
        Parameter::log("creep", 0.01, 1.0),
        Parameter::log("time_s", 1.0, 30.0),
        Parameter::linear("lateral_over_normal", 0.2, 1.5),
    ],
    act: Act::Contact(|v, at, contact| {
        let crept = (1.0 + at.contact_time_s.max(0.0) / v[1]).powf(0.25) - 1.0;
        contact.normal_stiffness_n_per_m /= 1.0 + v[0] * crept;
        contact.lateral_stiffness_n_per_m /= 1.0 + v[2] * v[0] * crept;
    }),
    ..DefectKind::cause(DefectSite::Contact, "the tissue under the ridges creeps with the time in contact")
};
