//! A table of any format as cells. `head` finds where its headers are.

use super::values::Dropped;
use instruments::Unit;
use miette::IntoDiagnostic;

/// A cell.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// Nothing.
    Empty,
    /// A number of a binary format.
    Number(f64),
    /// A clock's reading in s from some day.
    Clock(f64),
    /// A ratio that a workbook shows in per cent.
    Percent(f64),
    /// Text, numbers of text formats with it.
    Text(String),
}

impl Cell {
    /// A number as a cell; what is none is empty.
    pub const fn number(value: f64) -> Self {
        if value.is_nan() { Cell::Empty } else { Cell::Number(value) }
    }

    /// A single as a cell: the fewest digits stand for what was meant.
    pub fn single(value: f32) -> Self {
        Cell::of(&format!("{value:e}"))
    }

    /// Text as a cell: blanks are taken off, marks of missing values are empty.
    pub fn of(text: &str) -> Self {
        let text = text.trim();
        match text {
            "" | "NA" | "N/A" | "NaN" | "nan" | "NAN" | "null" | "NULL" | "-" | "--" => Cell::Empty,
            _ => Cell::Text(text.to_string()),
        }
    }

    /// What stands there, for people.
    pub fn shown(&self) -> String {
        match self {
            Cell::Empty => String::new(),
            Cell::Number(v) | Cell::Clock(v) => v.to_string(),
            Cell::Percent(v) => format!("{} %", v * 100.0),
            Cell::Text(text) => text.clone(),
        }
    }

    /// The number as it is written, with a point: a binary number has the fewest digits that stand for it.
    pub fn digits(&self, comma: bool) -> Option<String> {
        match self {
            Cell::Number(v) if v.is_finite() => Some(format!("{v:e}")),
            Cell::Text(text) if comma && !text.contains('.') => Some(exponent(&text.replacen(',', ".", 1))),
            Cell::Text(text) if !comma => Some(exponent(text)),
            _ => None,
        }
    }

    /// The ratio of a cell in per cent, as it is written with a point.
    pub fn ratio(&self, comma: bool) -> Option<f64> {
        match self {
            Cell::Percent(v) => Some(*v),
            Cell::Text(text) => {
                let number = Cell::Text(text.strip_suffix('%')?.trim_end().into());
                Unit::PER_CENT.apply(&number.digits(comma)?)
            }
            _ => None,
        }
    }

    /// Whether it is a number, a time or a percentage.
    pub fn is_number(&self, comma: bool) -> bool {
        let written = || self.digits(comma).is_some_and(|d| Unit::SI.apply(&d).is_some());
        written() || self.ratio(comma).is_some() || super::clock::is_time(self)
    }
}

/// A number with its exponent as Fortran prints it, `3.0D+00`, with the common `e`.
pub fn exponent(text: &str) -> String {
    let signed = |at: &usize| {
        text[at + 1..].starts_with(['+', '-'])
            && text[..*at].ends_with(|c: char| c.is_ascii_digit() || c == '.')
    };
    match text.find(['D', 'd']).filter(signed) {
        Some(at) => format!("{}e{}", &text[..at], &text[at + 1..]),
        None => text.to_string(),
    }
}

/// A row, and where it stands in the source.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Line or row, from 1.
    pub place: u64,
    /// Its cells.
    pub cells: Vec<Cell>,
    /// Which header holds for it: 0 is the table's, others stand in [`Grid::blocks`] from 1.
    pub block: usize,
}

impl Row {
    /// A row under the table's own header.
    pub fn new(place: u64, cells: Vec<Cell>) -> Self {
        Row { place, cells, block: 0 }
    }

    /// Cells that hold something.
    pub fn filled(&self) -> usize {
        self.cells.iter().filter(|c| **c != Cell::Empty).count()
    }

    /// Its cells up to the last that holds something.
    pub fn texts(&self) -> Vec<String> {
        self.cells[..self.width()].iter().map(Cell::shown).collect()
    }

    /// Cells up to the last that holds something.
    pub fn width(&self) -> usize {
        self.cells.iter().rposition(|c| *c != Cell::Empty).map_or(0, |k| k + 1)
    }
}

/// A later part of the source under a header of its own.
#[derive(Clone, Debug, PartialEq)]
pub struct Block {
    /// Line or row of that header.
    pub place: u64,
    /// Its names.
    pub header: Vec<String>,
    /// Its units, where a row of their own states them.
    pub units: Vec<String>,
    /// For each column of the table, its place under this header.
    pub columns: Vec<Option<usize>>,
}

/// A table that was read.
#[derive(Clone, Debug, Default)]
pub struct Grid {
    /// Format in words, with the sheet, the delimiter, the encoding.
    pub format: String,
    /// Whether the decimal mark is a comma.
    pub comma: bool,
    /// Names of the columns; their numbers from 1 where the source has none.
    pub header: Vec<String>,
    /// Units that a row of their own states.
    pub units: Vec<String>,
    /// The rows of data.
    pub rows: Vec<Row>,
    /// The group that all columns are in, with what separates it from their names; empty where they are in several.
    pub within: String,
    /// Later headers, and what they say.
    pub blocks: Vec<Block>,
    /// Rows that are no rows of the table.
    pub left_out: Vec<Dropped>,
    /// What was passed over or assumed while it was read.
    pub notes: Vec<String>,
}

impl Grid {
    /// A table whose columns have names already.
    pub fn named(format: String, header: Vec<String>, rows: Vec<Row>) -> Self {
        Grid { format, header, rows, ..Grid::default() }
    }

    /// The name of a column as a map takes it: its header, its number where another column has the same one.
    pub fn name(&self, column: usize) -> String {
        let header = &self.header[column];
        let same = self.header.iter().filter(|h| h.eq_ignore_ascii_case(header)).count();
        if same > 1 { format!("#{}", column + 1) } else { header.clone() }
    }

    /// The cell of a row under a column of the table, wherever that column is under the row's own header.
    pub fn cell<'a>(&self, row: &'a Row, column: usize) -> Option<&'a Cell> {
        let at = match row.block.checked_sub(1) {
            None => column,
            Some(block) => self.blocks.get(block)?.columns.get(column).copied().flatten()?,
        };
        row.cells.get(at)
    }

    /// Takes a row for none of the table.
    pub fn leave_out(&mut self, row: &Row, reason: String) {
        let text = row.texts().join(" ");
        self.left_out.push(Dropped { row: row.place, column: String::new(), text, reason });
    }

    /// Names and units of the header that holds for the rows of a block; 0 is the table's own.
    pub fn header_of(&self, block: usize) -> (&[String], &[String]) {
        match block.checked_sub(1) {
            None => (&self.header, &self.units),
            Some(k) => (&self.blocks[k].header, &self.blocks[k].units),
        }
    }

    /// The table as CSV, numbers with the fewest digits that stand for them.
    pub fn csv(&self) -> miette::Result<String> {
        let shown = |cell: &Cell| match cell {
            Cell::Number(v) => format!("{v:e}"),
            cell => cell.shown(),
        };
        csv_of(&self.header, self.rows.iter().map(|row| row.cells.iter().map(shown)))
    }
}

/// Rows of cells as CSV.
pub fn csv_of<I: IntoIterator<Item: AsRef<[u8]>>>(
    header: &[impl AsRef<[u8]>],
    rows: impl Iterator<Item = I>,
) -> miette::Result<String> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(header).into_diagnostic()?;
    for row in rows {
        writer.write_record(row).into_diagnostic()?;
    }
    String::from_utf8(writer.into_inner().into_diagnostic()?).into_diagnostic()
}

/// The one in the middle; 0 of none.
pub fn middle(widths: impl Iterator<Item = usize>) -> usize {
    let mut all: Vec<usize> = widths.collect();
    all.sort_unstable();
    all.get(all.len() / 2).copied().unwrap_or(0)
}
