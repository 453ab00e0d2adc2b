//! The amplifier's scale of amplitude is wrong, and a little bent: the pick-up compresses large swings.

use super::{Act, Kind, Parameter, Place, Surroundings, Values};

pub(super) static KIND: Kind = Kind {
    name: "amplitude_miscalibration",
    place: Place::Plate,
    in_library: true,
    in_tables: true,
    imitated: true,
    summary: "the true amplitude is not the one stated",
    parameters: &[Parameter::factor("factor", 0.02, 1.0)],
    act: Act { setup: None, plate: Some(act), contact: None, forces: None },
};

/// Swing at which the pick-up is compressed by 5 % (m peak-to-peak).
const BEND_M: f64 = 5e-6;

fn act(v: &Values, _: &Surroundings, pp_m: f64) -> f64 {
    pp_m * v[0] * (1.0 + 0.05 * (v[0] - 1.0).clamp(-1.0, 1.0) * pp_m / BEND_M)
}
