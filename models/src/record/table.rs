//! The point table as CSV: read with the place of every fault, written with all digits.

use super::Pass;
use crate::quantity::{Direction, PeakToPeak};
use std::io::{Read, Write};

/// What is wrong with a table, and where.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// A column that every table must have is not there.
    #[error("line 1: the column '{0}' is missing; a point table needs it")]
    MissingColumn(&'static str),
    /// A column that stands twice.
    #[error("line 1: the column '{0}' stands twice; remove one")]
    DoubleColumn(String),
    /// A cell that must have a value is empty.
    #[error("line {line}: '{column}' is empty; only optional columns may be")]
    EmptyCell {
        /// Line in the file, the header being line 1.
        line: u64,
        /// Name of the column.
        column: &'static str,
    },
    /// A cell that cannot be read as what its column holds.
    #[error("line {line}: '{column}' is '{text}'; {needed} is needed")]
    BadCell {
        /// Line in the file.
        line: u64,
        /// Name of the column.
        column: &'static str,
        /// What stands there.
        text: String,
        /// What would be accepted.
        needed: &'static str,
    },
    /// A row with the wrong number of cells, or text that is no CSV or UTF-8.
    #[error("{0}")]
    Malformed(#[from] csv::Error),
}

const REQUIRED: [&str; 8] = [
    "point",
    "time_s",
    "amplitude_pp_m",
    "frequency_hz",
    "speed_m_s",
    "direction",
    "position_m",
    "normal_force_n",
];
const OPTIONAL: [&str; 10] = [
    "lateral_force_n",
    "normal_force_sd_n",
    "lateral_force_sd_n",
    "samples",
    "ambient_pressure_pa",
    "temperature_c",
    "relative_humidity_pct",
    "phase_shift_deg",
    "replicate",
    "run",
];

/// Where each known column stands in a file.
struct Columns {
    required: [usize; REQUIRED.len()],
    optional: [Option<usize>; OPTIONAL.len()],
}

impl Columns {
    fn of(header: &csv::StringRecord) -> Result<Self, TableError> {
        let find = |name: &str| -> Result<Option<usize>, TableError> {
            let mut at = header.iter().enumerate().filter(|(_, h)| h.trim() == name).map(|(i, _)| i);
            match (at.next(), at.next()) {
                (Some(_), Some(_)) => Err(TableError::DoubleColumn(name.to_string())),
                (first, _) => Ok(first),
            }
        };
        let mut required = [0; REQUIRED.len()];
        for (slot, name) in required.iter_mut().zip(REQUIRED) {
            *slot = find(name)?.ok_or(TableError::MissingColumn(name))?;
        }
        let mut optional = [None; OPTIONAL.len()];
        for (slot, name) in optional.iter_mut().zip(OPTIONAL) {
            *slot = find(name)?;
        }
        Ok(Columns { required, optional })
    }
}

/// One row with its place.
struct Row<'a> {
    cells: &'a csv::StringRecord,
    columns: &'a Columns,
    line: u64,
}

impl Row<'_> {
    fn bad(&self, column: &'static str, text: &str, needed: &'static str) -> TableError {
        TableError::BadCell { line: self.line, column, text: text.to_string(), needed }
    }

    fn required(&self, i: usize) -> Result<&str, TableError> {
        match self.cells.get(self.columns.required[i]).map(str::trim) {
            Some(text) if !text.is_empty() => Ok(text),
            _ => Err(TableError::EmptyCell { line: self.line, column: REQUIRED[i] }),
        }
    }

    fn optional(&self, i: usize) -> Option<&str> {
        let cell = self.columns.optional[i].and_then(|at| self.cells.get(at))?;
        Some(cell.trim()).filter(|text| !text.is_empty())
    }

    fn number(&self, i: usize, ok: fn(f64) -> bool, needed: &'static str) -> Result<f64, TableError> {
        let text = self.required(i)?;
        match text.parse::<f64>() {
            Ok(v) if v.is_finite() && ok(v) => Ok(v),
            _ => Err(self.bad(REQUIRED[i], text, needed)),
        }
    }

    fn maybe_number(
        &self,
        i: usize,
        ok: fn(f64) -> bool,
        needed: &'static str,
    ) -> Result<Option<f64>, TableError> {
        self.optional(i)
            .map(|text| match text.parse::<f64>() {
                Ok(v) if v.is_finite() && ok(v) => Ok(v),
                _ => Err(self.bad(OPTIONAL[i], text, needed)),
            })
            .transpose()
    }

    fn maybe_count(&self, i: usize) -> Result<Option<u64>, TableError> {
        let parse = |text: &str| text.parse().map_err(|_| self.bad(OPTIONAL[i], text, "a whole number"));
        self.optional(i).map(parse).transpose()
    }

    fn direction(&self) -> Result<Direction, TableError> {
        let text = self.required(5)?;
        let number = text.parse::<f64>().ok();
        match number {
            Some(1.0) => Ok(Direction::Forward),
            Some(-1.0) => Ok(Direction::Backward),
            _ => Err(self.bad("direction", text, "1 or -1")),
        }
    }

    fn pass(&self) -> Result<Pass, TableError> {
        const ANY: fn(f64) -> bool = |_| true;
        const NOT_NEGATIVE: fn(f64) -> bool = |v| v >= 0.0;
        const POSITIVE: fn(f64) -> bool = |v| v > 0.0;
        let point = self.required(0)?;
        Ok(Pass {
            point: point.parse().map_err(|_| self.bad("point", point, "a whole number"))?,
            time_s: self.number(1, ANY, "a number")?,
            amplitude: PeakToPeak::from_metres(self.number(
                2,
                NOT_NEGATIVE,
                "a number of metres, zero or more",
            )?),
            frequency_hz: self.number(3, POSITIVE, "a number of hertz above zero")?,
            speed_m_s: self.number(
                4,
                NOT_NEGATIVE,
                "a speed in m/s, zero or more (the sign is 'direction')",
            )?,
            direction: self.direction()?,
            position_m: self.number(6, ANY, "a number of metres")?,
            normal_force_n: self.number(7, ANY, "a number of newtons")?,
            lateral_force_n: self.maybe_number(0, ANY, "a number of newtons")?,
            normal_force_sd_n: self.maybe_number(1, NOT_NEGATIVE, "a number of newtons, zero or more")?,
            lateral_force_sd_n: self.maybe_number(2, NOT_NEGATIVE, "a number of newtons, zero or more")?,
            samples: self.maybe_count(3)?,
            ambient_pressure_pa: self.maybe_number(4, NOT_NEGATIVE, "a pressure in Pa, zero or more")?,
            temperature_c: self.maybe_number(5, ANY, "a temperature in degrees Celsius")?,
            relative_humidity_pct: self.maybe_number(6, NOT_NEGATIVE, "a percentage")?,
            phase_shift_deg: self.maybe_number(7, ANY, "an angle in degrees")?,
            replicate: self.maybe_count(8)?,
            run: self.optional(9).map(str::to_string),
        })
    }
}

/// Reads a point table (contract: one row per steady pass). Unknown columns are passed over, empty optional
/// cells are missing values, the order of rows carries no meaning.
///
/// # Errors
/// The first fault with its line: a missing column, an empty or unreadable cell, a malformed row.
pub fn read_passes(from: impl Read) -> Result<Vec<Pass>, TableError> {
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(from);
    let mut header = reader.headers()?.clone();
    // Spreadsheets put a byte-order mark before the first name.
    if let Some(first) = header.get(0).and_then(|h| h.strip_prefix('\u{feff}')) {
        let mut names: Vec<String> = header.iter().map(str::to_string).collect();
        names[0] = first.to_string();
        header = csv::StringRecord::from(names);
    }
    let columns = Columns::of(&header)?;
    let mut passes = Vec::new();
    for record in reader.records() {
        let cells = record?;
        let line = cells.position().map_or(0, csv::Position::line);
        passes.push(Row { cells: &cells, columns: &columns, line }.pass()?);
    }
    Ok(passes)
}

/// Writes a point table with every column of docs/contract.md; missing values are empty cells. Numbers have as many
/// digits as it takes to read them back unchanged.
///
/// # Errors
/// Whatever the writer says.
pub fn write_passes(passes: &[Pass], to: impl Write) -> Result<(), TableError> {
    let mut writer = csv::Writer::from_writer(to);
    writer.write_record(REQUIRED.iter().chain(&OPTIONAL))?;
    for pass in passes {
        writer.write_record(cells(pass))?;
    }
    writer.flush().map_err(csv::Error::from)?;
    Ok(())
}

/// The cells of a row, in the order of [`header`].
fn cells(p: &Pass) -> [String; REQUIRED.len() + OPTIONAL.len()] {
    fn number(v: Option<f64>) -> String {
        v.map(|v| v.to_string()).unwrap_or_default()
    }
    fn count(v: Option<u64>) -> String {
        v.map(|v| v.to_string()).unwrap_or_default()
    }
    [
        p.point.to_string(),
        p.time_s.to_string(),
        format!("{:e}", p.amplitude.metres()),
        p.frequency_hz.to_string(),
        p.speed_m_s.to_string(),
        i8::from(p.direction).to_string(),
        p.position_m.to_string(),
        p.normal_force_n.to_string(),
        number(p.lateral_force_n),
        number(p.normal_force_sd_n),
        number(p.lateral_force_sd_n),
        count(p.samples),
        number(p.ambient_pressure_pa),
        number(p.temperature_c),
        number(p.relative_humidity_pct),
        number(p.phase_shift_deg),
        count(p.replicate),
        p.run.clone().unwrap_or_default(),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "point,time_s,amplitude_pp_m,frequency_hz,speed_m_s,direction,position_m,normal_force_n,lateral_force_n";

    #[test]
    fn a_table_survives_writing_and_reading() {
        let mut pass = Pass::at(7, &crate::condition::Condition::paper(), Some(-0.123_456_789_012_345_6));
        pass.replicate = Some(3);
        pass.run = Some("a, \"b\"".into());
        let mut bytes = Vec::new();
        write_passes(std::slice::from_ref(&pass), &mut bytes).unwrap();
        assert_eq!(read_passes(&bytes[..]).unwrap(), [pass]);
    }

    #[test]
    fn faults_name_their_line_and_column() {
        let error = |text: &str| read_passes(text.as_bytes()).unwrap_err().to_string();
        assert!(error("point,time_s\n1,2\n").contains("'amplitude_pp_m' is missing"));
        let rows = |row: &str| format!("{HEAD}\n1,0,2e-6,27500,0.02,1,0,0.25,0.1\n{row}\n");
        assert!(
            error(&rows("2,0,-2e-6,27500,0.02,1,0,0.25,0.1"))
                .starts_with("line 3: 'amplitude_pp_m' is '-2e-6'")
        );
        assert!(error(&rows("2,0,2e-6,27500,0.02,0.5,0,0.25,0.1")).contains("1 or -1"));
        assert!(error(&rows("2,0,NaN,27500,0.02,1,0,0.25,0.1")).contains("'NaN'"));
        assert!(error(&rows("2,,2e-6,27500,0.02,1,0,0.25,0.1")).contains("'time_s' is empty"));
        assert!(error(&rows("2,0,2e-6")).contains("line: 3"));
    }

    #[test]
    fn an_empty_cell_is_missing_and_unknown_columns_are_ignored() {
        let text = format!("{HEAD},colour\n1,0,0,27500,0.02,-1,0,0.25,,red\n");
        let passes = read_passes(text.as_bytes()).unwrap();
        assert_eq!(passes[0].lateral_force_n, None);
        assert_eq!(passes[0].direction, Direction::Backward);
    }
}
