//! Why a source is refused: columns that are missing, and tables of which most rows cannot be taken.

use super::grid::Grid;
use super::values::{Dropped, NO_NUMBER, NO_TIME, NO_WAY};
use super::{Import, map};
use instruments::units;

impl Import<'_> {
    /// Refuses a map that lacks columns, all at once.
    pub fn refuse_lacks(&self, not_taken: &[String]) -> miette::Result<()> {
        let (twice, lacks) = (self.map.twice(), self.map.lacks(self.grid, self.wanted.series.is_some()));
        let all = [&twice[..], &lacks[..]].concat().join("\n");
        if lacks.is_empty() {
            return if twice.is_empty() { Ok(()) } else { Err(miette::miette!(help = map::ONCE, "{all}")) };
        }
        let mut help = "state what is missing with --map and --set".to_string();
        if !twice.is_empty() {
            help = format!("{help}\n{}", map::ONCE);
        }
        if !not_taken.is_empty() {
            let names = not_taken.join(", ");
            help = format!("{help}\ncolumns of {} that are not taken: {names}", self.source);
        }
        // Why there are no names, for one.
        let notes = self.grid.notes.iter().map(|note| format!("\nnote: {note}"));
        let help = notes.fold(help, |help, note| help + &note);
        miette::bail!(help = help + &across(self.grid).unwrap_or_default(), "{all}");
    }

    /// The refusal of a table of which less than half can be taken: that is a wrong map, not a few bad rows.
    pub fn mostly_dropped(
        &self,
        dropped: &[Dropped],
        taken: usize,
        (all, what): (usize, &str),
        padded: usize,
    ) -> miette::Report {
        let mut reasons: Vec<(String, usize, &Dropped)> = Vec::new();
        for d in dropped {
            let what = format!("{}: {}", d.column, d.reason);
            match reasons.iter_mut().find(|(w, ..)| *w == what) {
                Some((_, n, _)) => *n += 1,
                None => reasons.push((what, 1, d)),
            }
        }
        reasons.sort_by_key(|(_, n, _)| std::cmp::Reverse(*n));
        let line = |(what, n, first): &(String, usize, &Dropped)| {
            format!("{n} rows: {what} (first in row {}: '{}')", first.row, first.text)
        };
        let mut list: Vec<String> = reasons.iter().take(4).map(line).collect();
        list.extend(map::contradicted(self.map, self.grid));
        let help = remedy(self.grid, dropped, reasons.first().map(|(.., first)| *first), padded);
        let (source, list) = (self.source, list.join("\n"));
        miette::miette!(help = help, "{source}: {taken} of {all} {what} can be taken\n{list}")
    }
}

/// Columns whose names are values with a unit, as of a table with a factor down and another across.
fn across(grid: &Grid) -> Option<String> {
    let value = |name: &&String| {
        let digits = name.bytes().take_while(|b| b.is_ascii_digit() || b".,".contains(b)).count();
        digits > 0 && (units::is_unit(&name[digits..]) || digits == name.len())
    };
    let values: Vec<&str> = grid.header.iter().filter(value).map(String::as_str).collect();
    (values.len() > 1).then(|| {
        format!(
            "\nthe names {} are values: one row a pass is needed, with that value in a column of its own (in Python: pandas.melt; in R: \
             tidyr::pivot_longer)",
            values.join(", ")
        )
    })
}

/// What cures most of the rows that are left out; `worst` is the first of the most frequent kind.
fn remedy(grid: &Grid, dropped: &[Dropped], worst: Option<&Dropped>, padded: usize) -> String {
    let negative = dropped.iter().filter(|d| d.column == "normal_force_n" && d.text.starts_with('-')).count();
    let (text, reason) = worst.map_or(("", ""), |d| (&d.text, &d.reason));
    if 2 * negative > dropped.len() {
        "compression is positive: turn the column with a minus before its unit, as in normal_force:-N"
            .to_string()
    } else if 2 * padded > dropped.len() {
        format!("the last {padded} rows are zeros in every column: --accept padding leaves them out")
    } else if reason == NO_NUMBER && text.chars().all(|c| "+-0123456789., '\u{a0}".contains(c)) {
        "export the table without thousands separators and with one decimal mark; --decimal states the mark"
            .to_string()
    } else if reason == NO_NUMBER {
        format!("'{text}' is no number: correct these cells at the source, or map another column")
    } else if reason == NO_WAY {
        let column = worst.map_or("", |d| &d.column);
        format!(
            "'{text}' is not known: state the two words, forward first, as in {column}=direction:hin/zurück"
        )
    } else if reason == NO_TIME {
        "export the times as seconds, 12:34:56.7, 2024-03-01 12:34:56 or 01.03.2024 12:34:56".to_string()
    } else if grid.format.starts_with("text") {
        "check the map and its units; --decimal and --delimiter say how text is read".to_string()
    } else {
        "check the map and its units".to_string()
    }
}
