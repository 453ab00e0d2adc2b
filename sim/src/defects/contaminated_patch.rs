//! A patch of the plate is greasy or clean: friction differs there, whatever the vibration.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[
        Parameter::signed("relative_change", 0.01, 0.8),
        Parameter::linear("centre_m", -0.015, 0.015),
        Parameter::log("width_m", 2e-3, 8e-3),
    ],
    in_library: false,
    act: Act::Contact(|v, at, contact| {
        let bump = (-0.5 * ((at.position_m - v[1]) / v[2]).powi(2)).exp();
        contact.friction *= (1.0 + v[0] * bump).max(0.05);
    }),
    ..DefectKind::cause(DefectSite::Plate, "friction differs on a patch of the plate")
};
