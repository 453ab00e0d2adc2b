//! The baseline's parameters, what the whole design says about scales, and what a reading is.

use crate::contact::{Contact, Held};
use models::Condition;

/// Reference scales of a whole table: effects that need a zero of time, load or temperature take it from here.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
pub struct Design {
    /// Time from the first to the last pass, s.
    pub duration_s: f64,
    /// Geometric mean of the normal force, N.
    pub reference_load_n: f64,
    /// Geometric mean of the speed, m/s.
    pub reference_speed_m_s: f64,
    /// Geometric mean of the frequency, Hz.
    pub reference_frequency_hz: f64,
    /// Temperature of the first pass, degrees Celsius.
    pub reference_temperature_c: f64,
    /// Range of positions, m.
    pub stroke_m: f64,
    /// Largest commanded amplitude, peak to peak, m.
    pub largest_amplitude_m: f64,
}

/// Peak speeds of the plate over a design's largest between which laws follow it: a power runs away beyond.
pub(crate) const PLATE_SPEEDS: [f64; 2] = [0.05, 2.0];

impl Design {
    /// Peak speed of the plate over that at the largest amplitude and the reference frequency, from 0.05 to 2;
    /// 1 for a design without vibration.
    pub fn plate_speed(&self, contact: &Contact) -> f64 {
        let largest = self.largest_amplitude_m * self.reference_frequency_hz;
        let speed = contact.amplitude_pp * contact.frequency / largest;
        // A design without vibration has no largest one.
        if largest > 0.0 { speed.clamp(PLATE_SPEEDS[0], PLATE_SPEEDS[1]) } else { 1.0 }
    }
}

/// The parameters of the baseline: all that recalibration may move.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
pub struct Baseline {
    /// Intrinsic friction coefficient.
    pub mu0: f64,
    /// Normal stiffness, N/m.
    pub normal_stiffness_n_per_m: f64,
    /// Lateral stiffness, N/m.
    pub lateral_stiffness_n_per_m: f64,
}

/// How the instruments turn the friction force into a reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorError {
    /// Factor on the lateral force.
    pub gain: f64,
    /// Lateral force read per newton of normal force, the same in both directions.
    pub crosstalk: f64,
    /// Lateral force read without load, N.
    pub offset_n: f64,
}

impl Baseline {
    /// The contact that this baseline gives a pass before any effect.
    pub fn contact(&self, pass: &Condition, design: &Design) -> Contact {
        Contact {
            mu0: self.mu0,
            normal_stiffness: self.normal_stiffness_n_per_m,
            lateral_stiffness: self.lateral_stiffness_n_per_m,
            amplitude_pp: pass.amplitude.metres(),
            frequency: pass.frequency_hz,
            speed: pass.speed_m_s,
            normal_force: pass.normal_force_n,
            solid_share: 1.0,
            friction_factor: 1.0,
            reference_load: design.reference_load_n,
            held: Held::NOTHING,
            ridge_damping_ratio: 1.0,
            // What effects alone bring in is absent.
            ..Contact::default()
        }
    }
}

/// Share of a pass's load that is left at least where an effect takes load away: a contact without any has no closed form.
pub const LEAST_SHARE: f64 = 3e-4;

/// Pressure in units of one standard atmosphere; one where it was not measured.
pub fn atmospheres(pass: &Condition) -> f64 {
    pass.ambient_pressure_pa.map_or(1.0, |p| p / 101_325.0)
}
