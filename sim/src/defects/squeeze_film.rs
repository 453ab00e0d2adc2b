//! Air trapped between ridges and plate carries part of the load.
//!
//! The trapped film's mean overpressure is that of a strongly squeezed isothermal film (Langlois 1962; Salbu 1964):
//! `p_a (sqrt((1 + 3/2 e^2) / (1 - e^2)) - 1)` with `e` the sine's amplitude over the mean gap. The gap is not
//! given: asperities hold it open, with a force that falls as a power of the gap, so a lighter load on them
//! opens it. Rarefaction lets the air out where its free path nears the gap. Only the rest of the load is rubbed.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[
        Parameter::log("film_area_m2", 3e-8, 1.5e-5),
        Parameter::log("half_gap_m", 2e-6, 3.5e-6),
        Parameter::log("asperity_load_n", 0.5, 3.0),
    ],
    act: Act::Contact(act),
    ..DefectKind::cause(DefectSite::Contact, "air trapped between ridges and plate carries part of the load")
};

/// Mean free path of air at one atmosphere (m).
const FREE_PATH_M: f64 = 68e-9;
const ATMOSPHERE_PA: f64 = 101_325.0;

fn overpressure_pa(pressure_pa: f64, amplitude_m: f64, gap_m: f64) -> f64 {
    let e2 = (amplitude_m / gap_m).powi(2).min(0.9);
    let free_path = FREE_PATH_M * ATMOSPHERE_PA / pressure_pa.max(1.0);
    let tight = 1.0 / (1.0 + 6.0 * free_path / gap_m);
    pressure_pa * (((1.0 + 1.5 * e2) / (1.0 - e2)).sqrt() - 1.0) * tight
}

fn act(v: &Values, at: &Surroundings, contact: &mut Contact) {
    let [area, half, asperity, _] = *v;
    let a = contact.sine_amplitude_m;
    let load = contact.normal_force_n;
    if a <= 0.0 || load <= 0.0 {
        return;
    }
    // Find the gap at which asperities and film share the load.
    let carried = |gap: f64| {
        let solid = asperity / (1.0 + (gap / half).powi(4));
        solid + area * overpressure_pa(at.ambient_pressure_pa, a, gap)
    };
    let excess = |gap: f64| carried(gap) - load;
    let gap = falling_root(0.1 * half, 20.0 * half, excess);
    let film = area * overpressure_pa(at.ambient_pressure_pa, a, gap);
    contact.normal_force_n = (load - film).max(1e-3 * load);
}

/// Root of a falling function by the Illinois method; an end of the bracket where there is none.
fn falling_root(mut low: f64, mut high: f64, f: impl Fn(f64) -> f64) -> f64 {
    let (mut at_low, mut at_high) = (f(low), f(high));
    if at_low <= 0.0 {
        return low;
    }
    if at_high >= 0.0 {
        return high;
    }
    let mut side = 0;
    for _ in 0..60 {
        let middle = (low * at_high - high * at_low) / (at_high - at_low);
        let value = f(middle);
        if value.abs() < 1e-9 || (high - low) < 1e-13 {
            return middle;
        }
        if value > 0.0 {
            (low, at_low) = (middle, value);
            if side == 1 {
                at_high *= 0.5;
            }
            side = 1;
        } else {
            (high, at_high) = (middle, value);
            if side == -1 {
                at_low *= 0.5;
            }
            side = -1;
        }
    }
    0.5 * (low + high)
}
