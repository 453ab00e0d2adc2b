//! The data vocabulary: one steady pass, and tables of them.

mod table;

use crate::condition::Condition;
use crate::quantity::{Direction, PeakToPeak};
use serde::{Deserialize, Serialize};
pub use table::{FAULTS, Readable, TableError, read_passes, read_readable, write_passes};

/// One steady pass: a row of the point table. Forces are means over the steady part of the pass.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pass {
    /// Number of the point in the table.
    pub point: u64,
    /// Start of the pass in s from the start of the run.
    pub time_s: f64,
    /// Peak-to-peak amplitude, as measured or echoed by the amplifier.
    pub amplitude: PeakToPeak,
    /// Vibration frequency in Hz, as echoed.
    pub frequency_hz: f64,
    /// Sliding speed (magnitude) in m/s.
    pub speed_m_s: f64,
    /// Direction of sliding.
    pub direction: Direction,
    /// Mean position in m.
    pub position_m: f64,
    /// Mean normal force in N, positive in compression.
    pub normal_force_n: f64,
    /// Mean lateral force in N, signed in the sensor's frame. `None` in a table of conditions only.
    pub lateral_force_n: Option<f64>,
    /// Standard deviation of the normal force samples within the pass in N.
    pub normal_force_sd_n: Option<f64>,
    /// Standard deviation of the lateral force samples within the pass in N.
    pub lateral_force_sd_n: Option<f64>,
    /// Number of samples behind the means.
    pub samples: Option<u64>,
    /// Ambient pressure in Pa.
    pub ambient_pressure_pa: Option<f64>,
    /// Temperature in degrees Celsius.
    pub temperature_c: Option<f64>,
    /// Relative humidity in per cent.
    pub relative_humidity_pct: Option<f64>,
    /// Contact phase shift of Eq. 1 in degrees, where a vibrometer gave it.
    pub phase_shift_deg: Option<f64>,
    /// Number of the repeat of one condition.
    pub replicate: Option<u64>,
    /// Name of the run, in tables of several.
    pub run: Option<String>,
    /// Number of the session of its run, from 1: a run that is stopped and resumed has several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub session: Option<u64>,
}

impl Pass {
    /// A pass at a condition, with nothing optional.
    pub fn at(point: u64, condition: &Condition, lateral_force_n: Option<f64>) -> Self {
        Pass {
            point,
            time_s: condition.time_s,
            amplitude: condition.amplitude,
            frequency_hz: condition.frequency_hz,
            speed_m_s: condition.speed_m_s,
            direction: condition.direction,
            position_m: condition.position_m,
            normal_force_n: condition.normal_force_n,
            lateral_force_n,
            normal_force_sd_n: None,
            lateral_force_sd_n: None,
            samples: None,
            ambient_pressure_pa: condition.ambient_pressure_pa,
            temperature_c: condition.temperature_c,
            relative_humidity_pct: condition.relative_humidity_pct,
            phase_shift_deg: None,
            replicate: None,
            run: None,
            session: None,
        }
    }

    /// The condition of the pass, given the friction coefficient without vibration.
    pub fn condition(&self, mu0: f64) -> Condition {
        Condition {
            amplitude: self.amplitude,
            frequency_hz: self.frequency_hz,
            speed_m_s: self.speed_m_s,
            direction: self.direction,
            normal_force_n: self.normal_force_n,
            mu0,
            position_m: self.position_m,
            time_s: self.time_s,
            run_time_s: None,
            ambient_pressure_pa: self.ambient_pressure_pa,
            temperature_c: self.temperature_c,
            relative_humidity_pct: self.relative_humidity_pct,
        }
    }

    /// Lateral force in the direction of sliding in N, `direction * L`.
    pub fn friction_force_n(&self) -> Option<f64> {
        self.lateral_force_n.map(|l| self.direction.sign() * l)
    }
}

/// What to do about a lateral axis that points the other way.
pub const REVERSED: &str = "friction pushes along the sliding: the lateral axis is reversed. Set `gain = -1` for \
    `lateral` in [[force]] of the setup, or turn the sensor; in a table turn the signs of lateral_force_n";
/// Share of passes from which on the sign of friction is that of the axis, not of the scatter.
const OF_ONE_SIGN: f64 = 0.95;

/// Whether the lateral force points along the sliding in the passes without vibration; without any, in all.
pub fn is_reversed<'a>(passes: impl Iterator<Item = &'a Pass> + Clone) -> bool {
    let any_still = passes.clone().any(|p| p.amplitude == PeakToPeak::ZERO);
    let judged = passes.filter(|p| !any_still || p.amplitude == PeakToPeak::ZERO);
    let frictions: Vec<f64> = judged.filter_map(Pass::friction_force_n).collect();
    let against = frictions.iter().filter(|f| **f < 0.0).count();
    against > 0 && against as f64 >= OF_ONE_SIGN * frictions.len() as f64
}

/// `mu_0 = sum(direction L F) / sum(F^2)` over the passes without vibration; `None` without such passes.
pub fn coulomb_coefficient<'a>(passes: impl IntoIterator<Item = &'a Pass>) -> Option<f64> {
    let still = passes.into_iter().filter(|p| p.amplitude == PeakToPeak::ZERO);
    let forces = still.filter_map(|p| Some((p.friction_force_n()?, p.normal_force_n)));
    let (top, bottom) = forces.fold((0.0, 0.0), |(top, bottom), (l, f)| (top + l * f, bottom + f * f));
    (bottom > 0.0).then(|| top / bottom)
}
