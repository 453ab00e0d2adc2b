//! The finger loads the plate and its amplitude droops: the more contact area, the more.
//!
//! The area of a soft sphere grows as the 2/3 power of the load (Hertz); each area of skin takes power from
//! the plate in proportion to the square of its speed, and to how much of the cycle it touches.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[
        Parameter::log("load_ratio_at_1_n", 0.01, 3.0),
        Parameter::linear("flight_per_um", 0.1, 0.6),
    ],
    act: Act::Plate(|v, at, pp_m| {
        let area = at.normal_force_n.max(0.0).cbrt().powi(2);
        // The larger the swing under a load, the smaller the part of the cycle in which the finger touches.
        let touched = 1.0 / (1.0 + v[1] * pp_m * 1e6 * (1.0 - area).max(0.0));
        pp_m / (1.0 + v[0] * area * touched)
    }),
    ..DefectKind::cause(DefectSite::Plate, "the plate's amplitude droops under the finger's load")
};
