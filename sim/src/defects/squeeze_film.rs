//! Air trapped between ridges and plate carries part of the load.
//!
//! The trapped film's mean overpressure is that of a strongly squeezed isothermal film (Langlois 1962; Salbu 1964):
//! `p_a (sqrt((1 + 3/2 e^2) / (1 - e^2)) - 1)` with `e` the sine's amplitude over the mean gap. The gap is not
//! given: the asperities that hold it open yield by a power law of their approach, so a lighter load on them
//! opens it. Rarefaction lets the air out where its free path nears the gap. Only the rest of the load is rubbed.

use super::{Act, Kind, Parameter, Place, Surroundings, Values};
use crate::contact::Contact;

pub(super) static KIND: Kind = Kind {
    name: "squeeze_film",
    place: Place::Contact,
    in_library: true,
    in_tables: true,
    summary: "air trapped between ridges and plate carries part of the load",
    parameters: &[
        Parameter::log("film_area_m2", 2e-7, 4e-5),
        Parameter::log("open_gap_m", 3e-6, 6e-6),
        Parameter::log("asperity_load_n", 0.5, 3.0),
    ],
    act: Act { setup: None, plate: None, contact: Some(act), forces: None },
};

/// Mean free path of air at one atmosphere [m].
const FREE_PATH_M: f64 = 68e-9;
const ATMOSPHERE_PA: f64 = 101_325.0;

fn overpressure_pa(pressure_pa: f64, amplitude_m: f64, gap_m: f64) -> f64 {
    let e2 = (amplitude_m / gap_m).powi(2).min(0.95);
    let free_path = FREE_PATH_M * ATMOSPHERE_PA / pressure_pa.max(1.0);
    let tight = 1.0 / (1.0 + 6.0 * free_path / gap_m);
    pressure_pa * (((1.0 + 1.5 * e2) / (1.0 - e2)).sqrt() - 1.0) * tight
}

fn act(v: &Values, at: &Surroundings, contact: &mut Contact) {
    let [area, open, asperity, _] = *v;
    let a = contact.sine_amplitude_m;
    let load = contact.normal_force_n;
    if a <= 0.0 || load <= 0.0 {
        return;
    }
    // Find the gap at which asperities and film share the load: asperities carry W (1 - u/u0)^2, none beyond u0.
    let carried = |gap: f64| {
        let solid = asperity * (1.0 - gap / open).max(0.0).powi(2);
        (solid, solid + area * overpressure_pa(at.ambient_pressure_pa, a, gap))
    };
    let (mut low, mut high) = (0.02 * open, 3.0 * open);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if carried(middle).1 > load { low = middle } else { high = middle }
    }
    let film = area * overpressure_pa(at.ambient_pressure_pa, a, 0.5 * (low + high));
    contact.normal_force_n = (load - film).max(0.01 * load);
}
