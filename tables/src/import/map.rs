//! Which column of the source is what: stated by `--map` and `--set`, or guessed from the headers.

use super::grid::Grid;
use super::targets::{ColumnTarget, Id, TARGETS, plain};
use instruments::Unit;

mod doubts;
mod entries;
mod lacks;
mod under;

pub use doubts::contradicted;
pub use entries::{MapError, way};
pub use under::under;

/// A column of the source that is taken.
#[derive(Clone, Debug)]
pub struct Taken {
    /// Place in the source.
    pub index: usize,
    /// Its header.
    pub header: String,
    /// What it stands for.
    pub target: &'static ColumnTarget,
    /// Its unit as stated; empty for what has none.
    pub unit_text: String,
    /// Its unit.
    pub unit: Unit,
    /// The SI unit was assumed: the header states none.
    pub assumed: bool,
}

/// A value that holds for every row.
#[derive(Clone, Debug)]
pub struct Constant {
    /// What it stands for.
    pub target: &'static ColumnTarget,
    /// As it was written.
    pub text: String,
    /// SI; NaN for text.
    pub value: f64,
}

/// What is taken from where.
#[derive(Clone, Debug, Default)]
pub struct Map {
    /// Columns.
    pub columns: Vec<Taken>,
    /// Constants.
    pub constants: Vec<Constant>,
    /// Time is the number of the row, in s.
    pub time_by_rows: bool,
}

/// What cures a column that is given more than once.
pub const ONCE: &str = "keep one of them: name it in --map, and leave the other out of --map and --set";

impl Map {
    /// All targets that are mapped or set.
    fn targets(&self) -> impl Iterator<Item = &'static ColumnTarget> {
        self.columns.iter().map(|c| c.target).chain(self.constants.iter().map(|c| c.target))
    }

    /// Whether a target is mapped or set.
    pub fn has(&self, id: Id) -> bool {
        self.targets().any(|t| t.id == id)
    }

    /// Whether a column of the point table is mapped or set.
    pub fn gives(&self, column: &str) -> bool {
        self.targets().any(|t| t.column == column)
    }

    /// The places of the columns of the source that are not taken.
    pub fn free(&self, grid: &Grid) -> impl Iterator<Item = usize> {
        (0..grid.header.len()).filter(|k| !self.columns.iter().any(|c| c.index == *k))
    }

    /// The map as `--map` takes it.
    pub fn written(&self) -> String {
        let entry = |c: &Taken| {
            let special = c.header.contains([',', '=', '"', ' ', '\'']);
            let header = if special { format!("\"{}\"", c.header) } else { c.header.clone() };
            let unit = if c.unit_text.is_empty() { String::new() } else { format!(":{}", c.unit_text) };
            format!("{header}={}{unit}", c.target.name)
        };
        self.columns.iter().map(entry).collect::<Vec<_>>().join(", ")
    }

    /// Columns of the point table that are given more than once, in sentences; [`ONCE`] is the remedy.
    pub fn twice(&self) -> Vec<String> {
        let mut columns: Vec<&str> = TARGETS.iter().map(|t| t.column).collect();
        columns.dedup();
        columns.retain(|column| self.targets().filter(|t| t.column == *column).count() > 1);
        let mut wrong: Vec<String> =
            columns.iter().map(|column| format!("{column} is given more than once")).collect();
        if self.has(Id::Velocity) && self.has(Id::Direction) {
            wrong.push("the sign of `velocity` is the direction: map one of velocity and direction".into());
        }
        if self.time_by_rows && self.has(Id::Time) {
            wrong.push("time_s is mapped and set".into());
        }
        wrong
    }
}

/// The columns that the headers suggest, a line each, with what was assumed of them.
pub fn guessed_lines(guessed: &[Taken]) -> Vec<String> {
    let line = |c: &Taken| {
        let assumed = if c.assumed { " (no unit stated: SI assumed)" } else { "" };
        let peak = match c.target.id {
            Id::AmplitudePp if !plain(&c.header).contains("pp") => {
                " (taken as peak to peak: amplitude_peak is half of it)"
            }
            _ => "",
        };
        let unit = c.target.dimension().map_or(String::new(), |_| format!(" in {}", c.unit_text));
        format!("  {} -> {}{unit}: {}{assumed}{peak}", c.header, c.target.name, c.target.words)
    };
    guessed.iter().map(line).collect()
}

/// The unit of a column in a row of units.
pub fn unit_row(units: &[String], at: usize) -> Option<&str> {
    units.get(at).map(String::as_str).filter(|u| !u.is_empty())
}

/// The unit that a header states in brackets, or after a slash, a comma or 'in'.
pub fn stated(header: &str) -> Option<&str> {
    parts(header).next().map(|(_, unit)| unit)
}

/// Every name with a unit that a header may be: one in brackets, or after a slash, a comma or 'in'.
pub fn parts(header: &str) -> impl Iterator<Item = (&str, &str)> {
    let bracketed = |(open, close): (char, char)| {
        let (name, rest) = header.split_once(open)?;
        let (unit, behind) = rest.split_once(close).unwrap_or((rest, ""));
        // A factor behind the bracket belongs to the unit, so that it is none that a header can state.
        let factor = behind.contains(|c: char| c.is_ascii_digit() || "*×/".contains(c));
        Some((name, if factor { &header[name.len()..] } else { unit }))
    };
    let brackets = [('[', ']'), ('(', ')')].into_iter().filter_map(bracketed);
    brackets.chain([" / ", ", ", " in ", "/"].into_iter().filter_map(|mark| header.split_once(mark)))
}

#[cfg(test)]
mod tests;
