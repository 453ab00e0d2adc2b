//! The resonance slides away from the drive: it falls as the plate warms and, a little, with the square of the swing
//! (a softening Duffing resonator). The amplifier does not follow. A neighbouring mode swings along, in phase on one side of
//! the resonance and against it on the other: the fall is not the same on both, and ends on what the neighbour moves.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[
        Parameter::log("relative_shift_per_k", 1e-5, 4e-3),
        Parameter::linear("softening_per_um2", 0.0, 2e-4),
        Parameter::linear("neighbour_over_mode", 0.3, 0.8),
        Parameter::linear("raised_k_per_n", 1.0, 5.0),
    ],
    act: Act::Plate(act),
    ..DefectKind::cause(DefectSite::Plate, "the plate is driven off its resonance as it warms")
};

const QUALITY: f64 = 150.0;
/// Share of the resonant amplitude lost per kelvin (1/K), in full where the shift is a thousandth per kelvin.
const LOSS_PER_K: f64 = 0.03;
/// Temperature at which drive and resonance were brought together (deg C).
const TUNED_AT_C: f64 = 22.0;

fn act(v: &Values, at: &Surroundings, pp_m: f64) -> f64 {
    let swing_um = pp_m * 1e6;
    let softening = v[1] * (v[0] / 1e-3).min(1.0) * swing_um * swing_um;
    let warmer = at.temperature_c - TUNED_AT_C;
    // The finger stiffens what it is pressed on, which raises the resonance as cooling does.
    let off = 2.0 * QUALITY * (v[0] * (warmer - v[3] * at.normal_force_n) + softening);
    // A warm plate swings less at its resonance too.
    let pp_m = pp_m * (1.0 - LOSS_PER_K * (v[0] / 1e-3).min(1.0) * warmer).max(0.2);
    let lorentz = 1.0 / (1.0 + off * off);
    pp_m * (v[2] - off * lorentz).hypot(lorentz) / v[2].hypot(1.0)
}
