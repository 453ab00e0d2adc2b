//! The drive runs out of current: the amplitude bends smoothly to a ceiling that falls as the frequency
//! rises, for a piezo draws current in proportion to both.

use super::{Act, Kind, Parameter, Place, Surroundings, Values};

pub(super) static KIND: Kind = Kind {
    name: "amplitude_saturation",
    place: Place::Plate,
    in_library: true,
    in_tables: true,
    imitated: false,
    summary: "the amplitude stops growing with the set-point",
    parameters: &[Parameter::log("inverse_ceiling_at_25_khz_per_m", 1.2e5, 1.5e6), Parameter::linear("frequency_exponent", 0.3, 1.0)],
    act: Act { setup: None, plate: Some(act), contact: None, forces: None },
};

/// How sharp the bend is (-).
const SHARPNESS: f64 = 6.0;

fn act(v: &Values, at: &Surroundings, pp_m: f64) -> f64 {
    let inverse = v[0] * (at.frequency_hz.max(1.0) / 25e3).powf(v[1]);
    pp_m / (1.0 + (pp_m * inverse).powf(SHARPNESS)).powf(1.0 / SHARPNESS)
}
