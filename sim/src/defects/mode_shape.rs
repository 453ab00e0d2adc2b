//! The plate vibrates in a standing wave with a travelling remainder: the amplitude under the finger depends on where it
//! is. The half wave of a 2 mm glass plate is 14 mm at 25 kHz and shortens as the square root of the frequency.

use super::{Act, Kind, Parameter, Place, Surroundings, Values};

pub(super) static KIND: Kind = Kind {
    name: "mode_shape",
    place: Place::Plate,
    in_library: true,
    in_tables: true,
    imitated: false,
    summary: "the amplitude depends on the position along the plate",
    parameters: &[Parameter::log("depth", 0.01, 0.95), Parameter::linear("phase_rad", 0.0, 3.1), Parameter::log("half_wave_at_25_khz_m", 8e-3, 2e-2)],
    act: Act { setup: None, plate: Some(act), contact: None, forces: None },
};

fn act(v: &Values, at: &Surroundings, pp_m: f64) -> f64 {
    let half_wave = v[2] * (25e3 / at.frequency_hz.max(1.0)).sqrt();
    let phase = std::f64::consts::PI * at.position_m / half_wave + v[1];
    // Standing wave with the given share; the rest travels and leaves no node.
    pp_m * (1.0 - v[0] + v[0] * phase.cos().abs())
}
