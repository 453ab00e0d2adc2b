//! Stiffnesses that are not the nominal ones, beyond their stated scatter. What changed the normal one (modulus, area,
//! thickness) changes the lateral one by some power of it; the logarithms of both lie at an angle: the normal one
//! alone at none, both alike at an eighth of a turn, the lateral one alone at a quarter.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[Parameter::factor("factor", 0.04, 1.8), Parameter::linear("angle_rad", -0.46, 2.0)],
    imitated: true,
    act: Act::Contact(|v, _, contact| {
        contact.normal_stiffness_n_per_m *= v[0].powf(v[1].cos());
        contact.lateral_stiffness_n_per_m *= v[0].powf(v[1].sin());
    }),
    ..DefectKind::cause(DefectSite::Finger, "the true stiffnesses are far from the nominal ones")
};
