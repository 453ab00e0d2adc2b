//! The data of a dead-weight calibration: one row for each steady reading.

use super::Axis;
use crate::rows;
use serde::Deserialize;
use std::io::Read;

/// Standard acceleration of free fall in m/s^2 (CGPM 1901): a nominal value. Local gravity differs by up to
/// 0.3 %, so give the local one where newtons matter.
pub const STANDARD_GRAVITY_M_S2: f64 = 9.806_65;

/// Which way the weights of a reading changed last, for hysteresis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Branch {
    /// Weight was added.
    Up,
    /// Weight was taken off.
    Down,
}

impl Branch {
    /// `1` for up, `-1` for down.
    pub fn sign(self) -> f64 {
        if self == Branch::Up { 1.0 } else { -1.0 }
    }
}

/// One steady reading: the mean counts of both channels under a known load on one axis.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadReading {
    /// Time in s from the start of the series.
    pub time_s: f64,
    /// Loaded axis; `None` for a zero reading.
    pub axis: Option<Axis>,
    /// Load in N, signed along the axis; zero for a zero reading.
    pub load_n: f64,
    /// Mean counts, lateral and normal.
    pub counts: [f64; 2],
    /// Branch of the hysteresis loop.
    pub branch: Option<Branch>,
    /// Temperature in degrees Celsius.
    pub temperature_c: Option<f64>,
    /// Whether the instrument reported the end of its range.
    pub saturated: bool,
}

/// How masses become loads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weighing {
    /// Local acceleration of free fall in m/s^2.
    pub gravity_m_s2: f64,
    /// Relative standard uncertainty of it.
    pub gravity_relative_sd: f64,
    /// Relative standard uncertainty of the masses, taken as common to all of them: weights of one set
    /// were compared with one standard (OIML R 111 class M1 below 100 g: about 2e-4 or better).
    pub mass_relative_sd: f64,
    /// Ratio of the air's to the weights' density (1.2 / 8000 for steel).
    pub buoyancy: f64,
    /// Standard uncertainty of the direction of the lateral and of the normal pull, in rad.
    pub alignment_sd_rad: [f64; 2],
}

impl Default for Weighing {
    fn default() -> Self {
        Weighing {
            gravity_m_s2: STANDARD_GRAVITY_M_S2,
            gravity_relative_sd: 1e-3,
            mass_relative_sd: 2e-4,
            buoyancy: 1.2 / 8_000.0,
            alignment_sd_rad: [2e-3; 2],
        }
    }
}

impl Weighing {
    /// Load of a mass in N.
    pub fn load_n(&self, mass_kg: f64) -> f64 {
        mass_kg * self.gravity_m_s2 * (1.0 - self.buoyancy)
    }

    /// Relative standard uncertainty that all loads share.
    pub fn relative_sd(&self) -> f64 {
        self.gravity_relative_sd.hypot(self.mass_relative_sd)
    }
}

/// Why a series cannot be read.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("row {row}: {reason}")]
pub struct SeriesError {
    /// Line in the file, the header being line 1.
    pub row: u64,
    /// What is wrong.
    pub reason: String,
}

#[derive(Deserialize)]
struct Row {
    time_s: f64,
    axis: String,
    mass_kg: Option<f64>,
    load_n: Option<f64>,
    lateral_counts: f64,
    normal_counts: f64,
    branch: Option<Branch>,
    temperature_c: Option<f64>,
    saturated: Option<u8>,
}

/// Reads a series from CSV: `time_s,axis,mass_kg,lateral_counts,normal_counts` with optional
/// `load_n` (instead of the mass), `branch` (up or down), `temperature_c`, `saturated` (0 or 1).
/// `axis` is `zero`, `lateral` or `normal`; mass and load are signed along the axis.
///
/// # Errors
/// The first row that cannot be read, with its line.
pub fn read(input: impl Read, weighing: &Weighing) -> Result<Vec<LoadReading>, SeriesError> {
    let mut readings = Vec::new();
    for (row, cells) in rows::read::<Row>(input).map_err(|(row, reason)| SeriesError { row, reason })? {
        let fail = |reason: String| SeriesError { row, reason };
        let axis = match cells.axis.as_str() {
            "zero" => None,
            "lateral" => Some(Axis::Lateral),
            "normal" => Some(Axis::Normal),
            other => return Err(fail(format!("axis `{other}` is none of zero, lateral, normal"))),
        };
        let load_n = match (axis, cells.mass_kg, cells.load_n) {
            (None, None | Some(0.0), None | Some(0.0)) => 0.0,
            (None, ..) => return Err(fail("a zero reading carries no mass and no load".into())),
            (Some(_), Some(mass), None) => weighing.load_n(mass),
            (Some(_), None, Some(load)) => load,
            (Some(_), ..) => return Err(fail("give either mass_kg or load_n".into())),
        };
        let counts = [cells.lateral_counts, cells.normal_counts];
        if ![cells.time_s, load_n, counts[0], counts[1]].iter().all(|x| x.is_finite()) {
            return Err(fail("a number is not finite".into()));
        }
        if axis.is_some() && load_n == 0.0 {
            return Err(fail("a loaded reading has no load: write `zero` for a zero reading".into()));
        }
        readings.push(LoadReading {
            time_s: cells.time_s,
            axis,
            load_n,
            counts,
            branch: cells.branch,
            temperature_c: cells.temperature_c,
            saturated: cells.saturated.unwrap_or(0) != 0,
        });
    }
    Ok(readings)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn masses_become_newtons_with_buoyancy() {
        let text = "time_s,axis,mass_kg,lateral_counts,normal_counts\n0,zero,,1,2\n10,normal,0.1,1,9800\n";
        let rows = read(text.as_bytes(), &Weighing::default()).unwrap();
        assert_eq!(rows[0].axis, None);
        // 0.1 kg x 9.80665 m/s2 x (1 - 1.2/8000)
        assert!((rows[1].load_n - 0.980_517_9).abs() < 1e-7);
    }

    #[test]
    fn bad_rows_are_named_by_their_line() {
        let head = "time_s,axis,mass_kg,lateral_counts,normal_counts\n0,zero,,1,2\n";
        for (row, says) in [
            ("1,up,0.1,1,1", "axis `up`"),
            ("1,normal,,1,1", "either mass_kg or load_n"),
            ("1,zero,0.1,1,1", "carries no mass"),
            ("1,normal,0.1,NaN,1", "not finite"),
            ("1,normal,0.1,x,1", "lateral_counts: invalid float"),
        ] {
            let error = read(format!("{head}{row}\n").as_bytes(), &Weighing::default()).unwrap_err();
            assert_eq!(error.row, 3);
            assert!(error.reason.contains(says), "{}", error.reason);
        }
    }
}
