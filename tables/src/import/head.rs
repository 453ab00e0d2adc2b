//! Where the header of a table is, before its data or in a comment; [`below`]: headers further down.

use super::grid::{Cell, Grid, Row, middle};
use super::guess::heads;
use instruments::units::is_unit;

mod below;

/// Why a text among the rows is left out.
pub const ONE_TEXT: &str = "one text, no row of the table";

/// What cures a table without rows.
pub const NO_ROWS_HELP: &str = "export the table with its rows of numbers";

/// What the rows were had from.
#[derive(Clone, Debug, Default)]
pub struct Source {
    /// Format in words.
    pub format: String,
    /// Whether the decimal mark is a comma.
    pub comma: bool,
    /// Comment lines as rows: names may be written in them.
    pub comments: Vec<Row>,
    /// Cells have places of their own, as in a workbook: a name can be missing.
    pub places: bool,
    /// Blanks separate the cells: none can be empty.
    pub blanks: bool,
}

/// A header: names, units where a row of their own states them, and the rows that it takes.
struct Head {
    place: u64,
    names: Vec<String>,
    units: Vec<String>,
    rows: usize,
}

/// Where the data are: their first row, and the usual numbers of cells that hold something, of all rows and
/// of those that the header heads.
struct Extent {
    first: usize,
    usual: usize,
    wide: usize,
}

impl Source {
    fn numbers(&self, row: &Row) -> usize {
        row.cells.iter().filter(|c| c.is_number(self.comma)).count()
    }

    fn is_words(&self, row: &Row) -> bool {
        row.filled() > 0 && 2 * self.numbers(row) < row.filled()
    }

    /// Whether a row is one of mostly numbers that is about as wide as is `usual`.
    fn is_data(&self, row: &Row, usual: usize) -> bool {
        let numbers = self.numbers(row);
        2 * row.filled() >= usual && 2 * numbers >= row.filled() && numbers > 0
    }

    /// The header that the last of these rows of words are, or end with.
    fn head(&self, rows: &[&Row]) -> Option<Head> {
        let last = rows.last()?;
        let above = rows.len().checked_sub(2).map(|k| rows[k]).filter(|r| 2 * r.filled() >= last.filled());
        let share = |row: &Row| {
            let known = row.cells.iter().filter(|c| matches!(c, Cell::Text(t) if is_unit(t))).count();
            (2 * known >= row.filled(), known == row.filled())
        };
        let named = |row: &Row| row.cells.iter().any(|c| matches!(c, Cell::Text(t) if heads(t)));
        let head = |names: &Row, units: Option<&Row>, rows| Head {
            place: names.place,
            names: names.texts(),
            units: units.map(Row::texts).unwrap_or_default(),
            rows,
        };
        Some(match above {
            Some(above) if share(last).0 && !share(above).1 && (named(above) || !named(last)) => {
                head(above, Some(last), 2)
            }
            Some(above) if share(above).1 && named(last) && !share(last).1 => head(last, Some(above), 2),
            _ => head(last, None, 1),
        })
    }

    /// The first row of the data. Rows of a word and values above a row of words are no data, even where they
    /// are as wide as the table.
    fn first(&self, rows: &[Row], usual: usize) -> usize {
        let first = rows.iter().position(|r| self.is_data(r, usual)).unwrap_or(rows.len());
        let labelled = |r: &Row| {
            r.width() == r.filled() && !r.cells[0].is_number(self.comma) && self.numbers(r) + 1 == r.filled()
        };
        let table = (first..rows.len()).find(|k| self.is_data(&rows[*k], usual) && !labelled(&rows[*k]));
        let headed = |k: usize| {
            let above = rows[..k].iter().rfind(|r| r.filled() > 0);
            above.is_some_and(|r| self.is_words(r) && 2 * r.filled() >= usual)
        };
        table.filter(|k| *k > first && headed(*k) && (usual == 2 || !headed(first))).unwrap_or(first)
    }

    /// Finds headers, units and data among rows: data begin with the first row of mostly numbers that is about as wide as most.
    pub fn find(&self, rows: Vec<Row>) -> Grid {
        let usual = middle(rows.iter().map(Row::filled).filter(|n| *n > 0));
        let first = self.first(&rows, usual);
        // The header is judged by the rows that it heads: other words further down may head wider ones.
        let words_below = rows[first..].iter().position(|r| self.is_words(r) && r.filled() > 1);
        let end = words_below.map_or(rows.len(), |k| first + k);
        let data: Vec<&Row> = rows[..end].iter().filter(|r| self.is_data(r, usual)).collect();
        let wide = middle(data.iter().map(|r| if self.blanks { r.filled() } else { r.width() }));
        let mut grid = Grid { format: self.format.clone(), comma: self.comma, ..Grid::default() };
        let extent = Extent { first, usual, wide };
        let taken = self.name_columns(&mut grid, &rows, &data, &extent);
        let above: Vec<&Row> = rows[..first - taken].iter().filter(|row| row.filled() > 0).collect();
        for row in above.iter().take(3) {
            let words = row.texts().join(" ");
            grid.notes.push(format!("row {} before the header was passed over: {}", row.place, words.trim()));
        }
        if above.len() > 3 {
            grid.notes.push(format!("{} more rows before the header were passed over", above.len() - 3));
        }
        if grid.header.is_empty() {
            grid.notes.push("there is no header: columns are #1, #2, ...".into());
        }
        let named = !grid.header.is_empty();
        self.below(&mut grid, rows.into_iter().skip(first).collect(), &extent);
        below::leave_out_summaries(&mut grid);
        let most = grid.rows.iter().filter(|r| r.block == 0).map(|row| row.cells.len()).max().unwrap_or(0);
        let wide = if named && !self.places { grid.header.len() } else { most.max(1) };
        grid.header.resize(wide, String::new());
        for (k, name) in grid.header.iter_mut().enumerate().filter(|(_, name)| name.is_empty()) {
            *name = format!("#{}", k + 1);
        }
        grid
    }

    /// Takes names and units from the words right above the data, each at least half as wide as the table, or
    /// from a comment. Returns how many rows that takes.
    fn name_columns(&self, grid: &mut Grid, rows: &[Row], data: &[&Row], extent: &Extent) -> usize {
        let Extent { first, usual, wide } = *extent;
        let words = |r: &&Row| self.is_words(r) && 2 * r.filled() >= usual;
        let count = rows[..first].iter().rev().take(3).take_while(words).count();
        let above: Vec<&Row> = rows[first - count..first].iter().collect();
        let begin = rows.get(first).map_or(u64::MAX, |r| r.place);
        let spoken = |r: &&Row| r.place < begin && r.cells.len() > 1 && r.width() == wide && self.is_words(r);
        let spoken: Vec<&Row> = self.comments.iter().filter(spoken).collect();
        let head = self.head(&above).map(|h| (h, false)).or_else(|| Some((self.head(&spoken)?, true)));
        let Some((head, in_comment)) = head else { return 0 };
        match self.fitted(&head, data, wide) {
            Err(why) => grid.notes.push(why),
            Ok(names) => {
                (grid.header, grid.units) = (names, head.units);
                if !in_comment {
                    return head.rows;
                }
                grid.notes.push("the header is in a comment".into());
            }
        }
        0
    }

    /// The names as they fit the rows, or why they do not: names beside other numbers of cells would be those of other columns.
    fn fitted(&self, head: &Head, data: &[&Row], wide: usize) -> Result<Vec<String>, String> {
        let names = head.names.len();
        if self.places || names == wide || names > wide && !self.blanks {
            return Ok(head.names.clone());
        }
        let is_text = |cell: &Cell| matches!(cell, Cell::Text(_)) && !cell.is_number(self.comma);
        let first = |row: &Row| match &row.cells[0] {
            cell if is_text(cell) => Some(cell.shown().trim_matches('"').to_string()),
            cell => cell.digits(self.comma),
        };
        // Some programs leave out the name of a first column that numbers or names the rows.
        let counted =
            |from: usize| (from..).zip(data).all(|(k, r)| first(r).is_some_and(|t| t.parse() == Ok(k)));
        let labelled = || data.iter().all(|r| is_text(&r.cells[0]));
        if names + 1 == wide && (counted(0) || counted(1) || labelled()) {
            return Ok(std::iter::once("#1".to_string()).chain(head.names.iter().cloned()).collect());
        }
        // Remarks behind the columns need no name.
        let remark =
            |r: &&Row| r.cells.iter().skip(names).all(|c| *c == Cell::Empty || !c.is_number(self.comma));
        if !self.blanks && names + 1 == wide && data.iter().all(remark) {
            return Ok(head.names.iter().cloned().chain([format!("#{wide}")]).collect());
        }
        Err(format!(
            "row {} has {names} names over rows of {wide} cells, so they name no columns; columns are #1, #2, ... (is the delimiter \
             right? --delimiter tab)",
            head.place
        ))
    }
}

#[cfg(test)]
mod tests;
