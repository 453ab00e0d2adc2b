//! The phase table of docs/contract.md (`PHASES.csv`): what `calibrate phase` writes and `calibrate finger` reads.

use crate::rows;
use models::PeakToPeak;
use serde::{Deserialize, Serialize};
use std::io::{Read, Write};

/// One row: the phase shift at one amplitude.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PhasePoint {
    /// Peak-to-peak amplitude.
    #[serde(rename = "amplitude_pp_m")]
    pub amplitude: PeakToPeak,
    /// Phase shift of Eq. 1 in degrees, [0, 360).
    pub phase_shift_deg: f64,
    /// Standard deviation of one repeat in degrees.
    pub phase_shift_sd_deg: Option<f64>,
    /// Number of repeats behind the mean.
    pub repeats: Option<u32>,
    /// Moist, dry or free text.
    pub condition: Option<String>,
    /// Frequency in Hz.
    pub frequency_hz: Option<f64>,
    /// Normal force in N.
    pub normal_force_n: Option<f64>,
}

/// Why a table cannot be read or written.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("line {line}: {reason}")]
pub struct TableError {
    /// Line in the file, the header being line 1.
    pub line: u64,
    /// What is wrong.
    pub reason: String,
}

/// Reads a phase table; unknown columns are ignored.
///
/// # Errors
/// The first row that cannot be read or cannot be true, with its line.
pub fn read_phases(input: impl Read) -> Result<Vec<PhasePoint>, TableError> {
    let mut points = Vec::new();
    let rows = rows::read::<PhasePoint>(input).map_err(|(line, reason)| TableError { line, reason })?;
    for (line, row) in rows {
        let fail = |reason: String| TableError { line, reason };
        let w = row.amplitude.metres();
        if !(w.is_finite() && w >= 0.0) {
            return Err(fail(format!("amplitude_pp_m = {w} is not an amplitude")));
        }
        if !(0.0..360.0).contains(&row.phase_shift_deg) {
            return Err(fail(format!("phase_shift_deg = {} is not in [0, 360)", row.phase_shift_deg)));
        }
        if row.phase_shift_sd_deg.is_some_and(|sd| !(sd.is_finite() && sd >= 0.0)) {
            return Err(fail("phase_shift_sd_deg is negative or not a number".into()));
        }
        points.push(row);
    }
    Ok(points)
}

/// Writes a phase table.
///
/// # Errors
/// The writer's own.
pub fn write_phases(output: impl Write, points: &[PhasePoint]) -> Result<(), TableError> {
    let mut writer = csv::Writer::from_writer(output);
    for (i, p) in points.iter().enumerate() {
        writer.serialize(p).map_err(|e| TableError { line: i as u64 + 2, reason: e.to_string() })?;
    }
    writer.flush().map_err(|e| TableError { line: 0, reason: e.to_string() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_goes_round() {
        let text = "amplitude_pp_m,phase_shift_deg,condition,other\n4.2e-7,3,moist,x\n1.35e-6,90,,y\n";
        let points = read_phases(text.as_bytes()).unwrap();
        assert_eq!(points[0].condition.as_deref(), Some("moist"));
        assert_eq!(points[1].condition, None);
        let mut out = Vec::new();
        write_phases(&mut out, &points).unwrap();
        assert_eq!(read_phases(out.as_slice()).unwrap(), points);
        let bad = read_phases("amplitude_pp_m,phase_shift_deg\n1e-6,400\n".as_bytes()).unwrap_err();
        assert_eq!((bad.line, bad.reason.contains("[0, 360)")), (2, true));
    }
}
