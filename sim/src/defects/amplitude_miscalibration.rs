//! The amplifier's scale of amplitude is wrong, and a little bent: the pick-up compresses large swings.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[Parameter::factor("factor", 0.02, 1.0)],
    imitated: true,
    act: Act::Plate(|v, _, pp_m| pp_m * v[0] * (1.0 + 0.05 * (v[0] - 1.0).clamp(-1.0, 1.0) * pp_m / BEND_M)),
    ..DefectKind::cause(DefectSite::Plate, "the true amplitude is not the one stated")
};

/// Swing at which the pick-up is compressed by 5 % (m peak-to-peak).
const BEND_M: f64 = 5e-6;
