//! A table of any format as cells, and where its header stands.

use super::units::Unit;

/// A cell.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// Nothing.
    Empty,
    /// A number of a binary format.
    Number(f64),
    /// A clock's reading in s from some day.
    Clock(f64),
    /// Text, numbers of text formats with it.
    Text(String),
}

impl Cell {
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
            Cell::Text(text) => text.clone(),
        }
    }

    /// The number as it is written, with a point: a binary number has the fewest digits that stand for it.
    pub fn digits(&self, comma: bool) -> Option<String> {
        match self {
            Cell::Number(v) if v.is_finite() => Some(format!("{v:e}")),
            Cell::Text(text) if comma && !text.contains('.') => Some(text.replacen(',', ".", 1)),
            Cell::Text(text) if !comma => Some(text.clone()),
            _ => None,
        }
    }

    fn is_number(&self, comma: bool) -> bool {
        let written = || self.digits(comma).is_some_and(|d| Unit::SI.apply(&d).is_some());
        matches!(self, Cell::Clock(_)) || written()
    }
}

/// A row, and where it stands in the source.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Line or row, from 1.
    pub place: u64,
    /// Its cells.
    pub cells: Vec<Cell>,
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
    /// What was passed over or assumed while it was read.
    pub notes: Vec<String>,
}

impl Grid {
    /// A table whose columns have names already.
    pub fn named(format: String, header: Vec<String>, rows: Vec<Row>) -> Self {
        Grid { format, header, rows, ..Grid::default() }
    }

    /// Finds header, units and data among rows: data begin with the first row of mostly numbers that is about as wide as most,
    /// the header is the row of words before it, or before a row of units.
    pub fn find(format: String, rows: Vec<Row>, comma: bool, spoken: Option<Vec<String>>) -> Self {
        let filled = |row: &Row| row.cells.iter().filter(|c| **c != Cell::Empty).count();
        let numbers = |row: &Row| row.cells.iter().filter(|c| c.is_number(comma)).count();
        let mut widths: Vec<usize> = rows.iter().map(filled).filter(|n| *n > 0).collect();
        widths.sort_unstable();
        let usual = widths.get(widths.len() / 2).copied().unwrap_or(0);
        let is_data =
            |row: &Row| 2 * filled(row) >= usual && 2 * numbers(row) >= filled(row) && numbers(row) > 0;
        let first = rows.iter().position(is_data).unwrap_or(rows.len());
        let words = |row: &&Row| 2 * numbers(row) < filled(row) && 2 * filled(row) >= usual;
        let text = |row: &Row| row.cells.iter().map(Cell::shown).collect::<Vec<_>>();
        let before = |at: usize| at.checked_sub(1).and_then(|k| rows.get(k)).filter(words);
        let mut grid = Grid { format, comma, ..Grid::default() };
        let mut head = first;
        match (before(first), before(first.saturating_sub(1))) {
            (Some(units), Some(header)) if units.cells.iter().all(is_unit) => {
                (grid.units, grid.header) = (text(units), text(header));
                head = first - 2;
            }
            (Some(header), _) => {
                grid.header = text(header);
                head = first - 1;
            }
            (None, _) => {}
        }
        for row in rows[..head].iter().filter(|row| filled(row) > 0) {
            grid.notes.push(format!(
                "row {} before the header was passed over: {}",
                row.place,
                text(row).join(" ").trim()
            ));
        }
        grid.rows = rows.into_iter().skip(first).filter(|row| filled(row) > 0).collect();
        let wide = grid.rows.iter().map(|row| row.cells.len()).max().unwrap_or(0);
        if grid.header.is_empty() {
            if let Some(spoken) = spoken.filter(|names| names.len() == wide) {
                grid.notes.push("the header stands in a comment".into());
                grid.header = spoken;
            } else {
                grid.notes.push("there is no header: columns are #1, #2, ...".into());
            }
        }
        grid.header.truncate(wide.max(1));
        while grid.header.len() < wide {
            grid.header.push(format!("#{}", grid.header.len() + 1));
        }
        for (k, name) in grid.header.iter_mut().enumerate().filter(|(_, name)| name.is_empty()) {
            *name = format!("#{}", k + 1);
        }
        grid
    }
}

/// Whether a cell can stand in a row of units: short words, or nothing.
fn is_unit(cell: &Cell) -> bool {
    use super::units::Dimension as D;
    let all = [
        D::Length,
        D::Time,
        D::Frequency,
        D::Speed,
        D::Force,
        D::Pressure,
        D::Temperature,
        D::Angle,
        D::Percentage,
        D::Ratio,
    ];
    match cell {
        Cell::Empty => true,
        Cell::Text(text) => all.iter().any(|d| Unit::guess(*d, text).is_some()),
        Cell::Number(_) | Cell::Clock(_) => false,
    }
}
