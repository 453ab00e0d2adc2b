//! The resonance slides away from the drive: it falls as the plate warms and, a little, with the square of the swing
//! (a softening Duffing resonator). The amplifier does not follow.

use super::{Act, Kind, Parameter, Place, Surroundings, Values};

pub(super) static KIND: Kind = Kind {
    name: "resonance_detuning",
    place: Place::Plate,
    in_library: true,
    in_tables: true,
    imitated: false,
    summary: "the plate is driven off its resonance as it warms",
    parameters: &[
        Parameter::log("relative_shift_per_k", 1e-5, 4e-3),
        Parameter::linear("softening_per_um2", 0.0, 2e-4),
    ],
    act: Act { setup: None, plate: Some(act), contact: None, forces: None },
};

const QUALITY: f64 = 150.0;
/// Temperature at which drive and resonance were brought together (deg C).
const TUNED_AT_C: f64 = 22.0;

fn act(v: &Values, at: &Surroundings, pp_m: f64) -> f64 {
    let swing_um = pp_m * 1e6;
    let softening = v[1] * (v[0] / 1e-3).min(1.0) * swing_um * swing_um;
    let off = v[0] * (at.temperature_c - TUNED_AT_C) + softening;
    pp_m / (1.0 + (2.0 * QUALITY * off).powi(2)).sqrt()
}
