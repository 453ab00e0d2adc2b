//! The point table as CSV: read with the place of every fault, written with all digits.

use super::Pass;
use crate::condition::Condition;
use crate::covariate::{self, Covariate};
use crate::quantity::PeakToPeak;
use std::io::{Read, Write};

/// What is wrong with a table, and where.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the message of an error says what its fields are")]
pub enum TableError {
    /// Columns that every table must have are not there.
    #[error("line 1: missing columns: {}; a point table needs them", .0.join(", "))]
    MissingColumns(Vec<&'static str>),
    /// A column that stands twice.
    #[error("line 1: the column '{0}' stands twice; remove one")]
    DoubleColumn(String),
    /// A cell that must have a value is empty.
    #[error("line {line}: '{column}' is empty; only optional columns may be")]
    EmptyCell { line: u64, column: &'static str },
    /// A pass with vibration whose frequency is not stated.
    #[error(
        "line {line}: 'frequency_hz' is empty or has no column; only passes with amplitude_pp_m = 0 have none"
    )]
    NoFrequency { line: u64 },
    /// A cell that cannot be read as what its column holds.
    #[error("line {line}: '{column}' is '{text}'; {needed} is needed")]
    BadCell { line: u64, column: &'static str, text: String, needed: &'static str },
    /// A row with the wrong number of cells, or text that is not CSV or UTF-8.
    #[error("{0}")]
    Malformed(#[from] csv::Error),
}

impl TableError {
    /// The line from 1, and the column whose cell is at fault, where it is one.
    pub fn place(&self) -> (u64, Option<&str>) {
        match self {
            TableError::MissingColumns(_) => (1, None),
            TableError::DoubleColumn(column) => (1, Some(column)),
            TableError::EmptyCell { line, column } | TableError::BadCell { line, column, .. } => {
                (*line, Some(column))
            }
            TableError::NoFrequency { line } => (*line, Some(covariate::FREQUENCY.name)),
            TableError::Malformed(why) => (why.position().map_or(1, csv::Position::line), None),
        }
    }
}

/// A table as far as it can be read: the passes of good rows, and what is wrong with the others.
#[derive(Debug, Default)]
pub struct Readable {
    /// The passes of good rows, each with the line of its row, from 1.
    pub passes: Vec<(u64, Pass)>,
    /// What is wrong, from the first line on; at most [`FAULTS`] are listed.
    pub faults: Vec<TableError>,
    /// How many further faults there are.
    pub further: usize,
}

/// Faults of a table that are listed one by one.
pub const FAULTS: usize = 50;

impl Readable {
    fn fault(&mut self, fault: TableError) {
        if self.faults.len() < FAULTS { self.faults.push(fault) } else { self.further += 1 }
    }

    /// The value, or what is no value and one fault more.
    fn value<T: Default>(&mut self, value: Result<T, TableError>) -> T {
        value.unwrap_or_else(|fault| {
            self.fault(fault);
            T::default()
        })
    }

    fn count(&self) -> usize {
        self.faults.len() + self.further
    }
}

/// Columns of numbers that are no covariates, with the range of each and what is needed.
const NUMBERS: [(&str, [f64; 2], &str); 4] = [
    ("lateral_force_n", [-500.0, 500.0], "a number of newtons, -500 to 500"),
    ("normal_force_sd_n", [0.0, 500.0], "a number of newtons, zero to 500"),
    ("lateral_force_sd_n", [0.0, 500.0], "a number of newtons, zero to 500"),
    ("phase_shift_deg", [-3600.0, 3600.0], "an angle in degrees, at most ten turns"),
];

/// A header, and where each of its columns stands.
struct Columns(csv::StringRecord);

impl Columns {
    /// Takes a header in which every column that a table must have stands, and none twice.
    fn of(header: csv::StringRecord) -> Result<Self, TableError> {
        let columns = Columns(header);
        // One without the place has it nowhere, and a plate that stands still has no frequency.
        let may_lack = [covariate::POSITION.name, covariate::FREQUENCY.name];
        let required = covariate::REQUIRED.iter().map(|c| c.name).filter(|name| !may_lack.contains(name));
        let needed = std::iter::once("point").chain(required);
        let missing: Vec<_> = needed.filter(|name| columns.place(name).is_none()).collect();
        if !missing.is_empty() {
            return Err(TableError::MissingColumns(missing));
        }
        let optional = covariate::OPTIONAL.iter().map(|c| c.name);
        let known =
            ["point", "samples", "replicate", "run", "session"].into_iter().chain(NUMBERS.map(|n| n.0));
        let mut all = known.chain(covariate::REQUIRED.iter().map(|c| c.name)).chain(optional);
        let twice = all.find(|name| columns.0.iter().filter(|h| h.trim() == *name).count() > 1);
        twice.map_or(Ok(columns), |name| Err(TableError::DoubleColumn(name.to_string())))
    }

    fn place(&self, name: &str) -> Option<usize> {
        self.0.iter().position(|h| h.trim() == name)
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

    fn cell(&self, column: &str) -> Option<&str> {
        let cell = self.cells.get(self.columns.place(column)?)?;
        Some(cell.trim()).filter(|text| !text.is_empty())
    }

    fn parsed(
        &self,
        text: &str,
        column: &'static str,
        ok: impl Fn(f64) -> bool,
        needed: &'static str,
    ) -> Result<f64, TableError> {
        let value = text.parse::<f64>().ok().filter(|v| v.is_finite() && ok(*v));
        value.ok_or_else(|| self.bad(column, text, needed))
    }

    fn covariate(&self, c: &'static Covariate, text: &str) -> Result<f64, TableError> {
        let unit = |v: f64| c.name != covariate::DIRECTION.name || v.abs() == 1.0;
        self.parsed(text, c.name, |v| c.admits(v) && unit(v), c.needed)
    }

    /// Whether a table can go without this value here. The condition holds the row's amplitude already, which
    /// stands before the frequency among the covariates.
    fn may_be_empty(&self, c: &'static Covariate, condition: &Condition) -> Result<(), TableError> {
        let nowhere = c.name == covariate::POSITION.name && self.columns.place(c.name).is_none();
        let still = c.name == covariate::FREQUENCY.name && condition.amplitude == PeakToPeak::ZERO;
        if nowhere || still {
            Ok(())
        } else if c.name == covariate::FREQUENCY.name {
            Err(TableError::NoFrequency { line: self.line })
        } else {
            Err(TableError::EmptyCell { line: self.line, column: c.name })
        }
    }

    fn number(&self, column: &str) -> Result<Option<f64>, TableError> {
        let (name, [low, high], needed) =
            *NUMBERS.iter().find(|n| n.0 == column).expect("a column of numbers");
        let within = |v: f64| v >= low && v <= high;
        self.cell(name).map(|text| self.parsed(text, name, within, needed)).transpose()
    }

    fn count(&self, column: &'static str) -> Result<Option<u64>, TableError> {
        let parse = |text: &str| text.parse().map_err(|_| self.bad(column, text, "a whole number"));
        self.cell(column).map(parse).transpose()
    }

    /// The pass of the row, or every cell of it that is at fault.
    fn pass(&self, found: &mut Readable) -> Option<Pass> {
        let faults = found.count();
        let whole = |text: &str| text.parse().map_err(|_| self.bad("point", text, "a whole number"));
        let empty = TableError::EmptyCell { line: self.line, column: "point" };
        let point = found.value(self.cell("point").ok_or(empty).and_then(whole));
        let mut condition = Condition::paper();
        for c in covariate::REQUIRED {
            match self.cell(c.name) {
                // What cannot be read is zero here: a bad amplitude needs no frequency, and is one fault.
                Some(text) => c.put(&mut condition, found.value(self.covariate(c, text))),
                None => found.value(self.may_be_empty(c, &condition)),
            }
        }
        for c in covariate::OPTIONAL {
            if let Some(text) = self.cell(c.name) {
                c.put(&mut condition, found.value(self.covariate(c, text)));
            }
        }
        let pass = Pass {
            normal_force_sd_n: found.value(self.number("normal_force_sd_n")),
            lateral_force_sd_n: found.value(self.number("lateral_force_sd_n")),
            samples: found.value(self.count("samples")),
            phase_shift_deg: found.value(self.number("phase_shift_deg")),
            replicate: found.value(self.count("replicate")),
            run: self.cell("run").map(str::to_string),
            session: found.value(self.count("session")),
            ..Pass::at(point, &condition, found.value(self.number("lateral_force_n")))
        };
        (found.count() == faults).then_some(pass)
    }
}

/// Reads a point table (contract: one row per steady pass). Unknown columns are passed over, empty optional
/// cells are missing values, the order of rows carries no meaning.
///
/// A table without the column `position_m` lies at one place, 0. A pass with the plate still may lack its frequency: it
/// has none, and takes the first one that the table states (else the paper's), so that it is no level of its own.
///
/// # Errors
/// The first fault with its line: a missing column, an empty or unreadable cell, a malformed row.
pub fn read_passes(from: impl Read) -> Result<Vec<Pass>, TableError> {
    let mut found = read_readable(from);
    if found.faults.is_empty() {
        Ok(found.passes.into_iter().map(|(_, pass)| pass).collect())
    } else {
        Err(found.faults.swap_remove(0))
    }
}

/// The same of a table that may have faults: all of them are in what it returns.
pub fn read_readable(from: impl Read) -> Readable {
    let mut found = Readable::default();
    read_into(from, &mut found).unwrap_or_else(|fault| found.fault(fault));
    found
}

fn read_into(from: impl Read, found: &mut Readable) -> Result<(), TableError> {
    let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).trim(csv::Trim::All).from_reader(from);
    let mut header = reader.headers()?.clone();
    // Spreadsheets put a byte-order mark before the first name.
    if let Some(first) = header.get(0).and_then(|h| h.strip_prefix('\u{feff}')) {
        let mut names: Vec<String> = header.iter().map(str::to_string).collect();
        names[0] = first.to_string();
        header = csv::StringRecord::from(names);
    }
    let columns = Columns::of(header)?;
    let (mut stated, mut lacking) = (None, Vec::new());
    for record in reader.records() {
        let cells = match record {
            // The reader goes on behind a row that is malformed, not behind a file that cannot be read.
            Err(why) if !why.is_io_error() => {
                found.fault(why.into());
                continue;
            }
            record => record?,
        };
        let line = cells.position().map_or(0, csv::Position::line);
        let row = Row { cells: &cells, columns: &columns, line };
        let Some(pass) = row.pass(found) else { continue };
        match row.cell(covariate::FREQUENCY.name) {
            Some(_) => stated = stated.or(Some(pass.frequency_hz)),
            None => lacking.push(found.passes.len()),
        }
        found.passes.push((line, pass));
    }
    if let Some(frequency_hz) = stated {
        lacking.into_iter().for_each(|at| found.passes[at].1.frequency_hz = frequency_hz);
    }
    Ok(())
}

/// Writes a point table with every column of docs/contract.md; missing values are empty cells. Numbers have
/// as many digits as it takes to read them back unchanged.
///
/// # Errors
/// Whatever the writer says.
pub fn write_passes(passes: &[Pass], to: impl Write) -> Result<(), TableError> {
    let mut writer = csv::Writer::from_writer(to);
    let before = ["lateral_force_n", "normal_force_sd_n", "lateral_force_sd_n", "samples"];
    let after = ["phase_shift_deg", "replicate", "run", "session"];
    let required = std::iter::once("point").chain(covariate::REQUIRED.iter().map(|c| c.name));
    let optional = covariate::OPTIONAL.iter().map(|c| c.name);
    writer.write_record(required.chain(before).chain(optional).chain(after))?;
    passes.iter().try_for_each(|pass| writer.write_record(cells(pass)))?;
    writer.flush().map_err(csv::Error::from)?;
    Ok(())
}

/// The cells of a row, in the order of the header.
fn cells(p: &Pass) -> Vec<String> {
    fn text<T: ToString>(value: Option<T>) -> String {
        value.map(|v| v.to_string()).unwrap_or_default()
    }
    let condition = p.condition(1.0);
    let covariate = |c: &&Covariate| match c.of(&condition) {
        // Micrometres in metres are mostly zeros.
        Some(v) if c.name == covariate::AMPLITUDE.name => format!("{v:e}"),
        value => text(value),
    };
    let mut cells = vec![p.point.to_string()];
    cells.extend(covariate::REQUIRED.iter().map(covariate));
    cells.extend([p.lateral_force_n, p.normal_force_sd_n, p.lateral_force_sd_n].map(text));
    cells.push(text(p.samples));
    cells.extend(covariate::OPTIONAL.iter().map(covariate));
    cells.extend([text(p.phase_shift_deg), text(p.replicate), text(p.run.as_ref()), text(p.session)]);
    cells
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quantity::Direction;

    const HEAD: &str = "point,time_s,amplitude_pp_m,frequency_hz,speed_m_s,direction,position_m,normal_force_n,lateral_force_n";

    #[test]
    fn a_table_survives_writing_and_reading() {
        let mut pass = Pass::at(7, &crate::condition::Condition::paper(), Some(-0.123_456_789_012_345_6));
        pass.replicate = Some(3);
        pass.run = Some("a, \"b\"".into());
        pass.session = Some(2);
        let mut bytes = Vec::new();
        write_passes(std::slice::from_ref(&pass), &mut bytes).unwrap();
        assert_eq!(read_passes(&bytes[..]).unwrap(), [pass]);
    }

    #[test]
    fn faults_name_their_line_and_column() {
        let error = |text: &str| read_passes(text.as_bytes()).unwrap_err().to_string();
        assert!(
            error("point,time_s\n1,2\n").contains("missing columns: amplitude_pp_m, speed_m_s, direction,")
        );
        let remarked =
            format!("# a bench\n{HEAD}\n1,0,2e-6,27500,0.02,1,0,0.25,0.1\n2,0,x,27500,0.02,1,0,0.25,0.1");
        assert!(error(&remarked).starts_with("line 4: 'amplitude_pp_m' is 'x'"), "{}", error(&remarked));
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
    fn every_fault_of_a_table_is_found_with_its_place() {
        let rows =
            "x,0,two,,0.02,1,0,0.25,0.1\n2,1,2e-6\n3,2,2e-6,,0.02,3,0,0.25,0.1\n4,3,0,,0.02,1,0,0.25,0.1\n";
        let found = read_readable(format!("{HEAD}\n{rows}").as_bytes());
        let places: Vec<_> = found.faults.iter().map(TableError::place).collect();
        let expected = [
            (2, Some("point")),
            (2, Some("amplitude_pp_m")),
            (3, None),
            (4, Some("frequency_hz")),
            (4, Some("direction")),
        ];
        assert_eq!(places, expected, "{:?}", found.faults);
        assert_eq!((found.passes.len(), found.passes[0].0, found.further), (1, 5, 0));
        let many = read_readable(format!("{HEAD}\n{}", "1,0,x,,0.02,1,0,0.25,0.1\n".repeat(70)).as_bytes());
        assert_eq!((many.faults.len(), many.further), (FAULTS, 20));
    }

    /// Plain tribometers state neither a frequency nor a place.
    #[test]
    fn a_still_plate_has_no_frequency_and_a_table_without_places_has_one() {
        let head = "point,time_s,amplitude_pp_m,speed_m_s,direction,normal_force_n,lateral_force_n";
        let passes = read_passes(format!("{head}\n1,0,0,0.02,1,0.25,0.1\n").as_bytes()).unwrap();
        assert_eq!((passes[0].position_m, passes[0].frequency_hz), (0.0, Condition::paper().frequency_hz));
        let vibrating = read_passes(format!("{head}\n1,0,2e-6,0.02,1,0.25,0.1\n").as_bytes()).unwrap_err();
        assert!(vibrating.to_string().starts_with("line 2: 'frequency_hz'"), "{vibrating}");
        // A still pass is no level of frequency of its own.
        let rows = "1,0,0,,0.02,1,0,0.25,0.1\n2,1,2e-6,30000,0.02,1,0,0.25,0.1\n";
        let passes = read_passes(format!("{HEAD}\n{rows}").as_bytes()).unwrap();
        assert_eq!(passes[0].frequency_hz, 30_000.0);
        // A place that some rows lack is missing there.
        let rows = "1,0,0,,0.02,1,,0.25,0.1\n";
        let error = read_passes(format!("{HEAD}\n{rows}").as_bytes()).unwrap_err().to_string();
        assert_eq!(error, "line 2: 'position_m' is empty; only optional columns may be");
    }

    #[test]
    fn an_empty_cell_is_missing_and_unknown_columns_are_ignored() {
        let text = format!("{HEAD},colour\n1,0,0,27500,0.02,-1,0,0.25,,red\n");
        let passes = read_passes(text.as_bytes()).unwrap();
        assert_eq!(passes[0].lateral_force_n, None);
        assert_eq!(passes[0].direction, Direction::Backward);
    }
}
