//! The drive runs out of voltage: the amplitude bends smoothly to a ceiling.

use super::{Act, Kind, Parameter, Place, Surroundings, Values};

pub(super) static KIND: Kind = Kind {
    name: "amplitude_saturation",
    place: Place::Plate,
    in_library: true,
    in_tables: true,
    imitated: false,
    summary: "the amplitude stops growing with the set-point",
    parameters: &[Parameter::log("inverse_ceiling_per_m", 1.2e5, 1.5e6)],
    act: Act { setup: None, plate: Some(act), contact: None, forces: None },
};

/// How sharp the bend is (-).
const SHARPNESS: f64 = 6.0;

fn act(v: &Values, _: &Surroundings, pp_m: f64) -> f64 {
    pp_m / (1.0 + (pp_m * v[0]).powf(SHARPNESS)).powf(1.0 / SHARPNESS)
}
