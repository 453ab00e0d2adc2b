//! Where the headers of a table are: one before the data, and others further down, each of which holds for the rows below it.

use super::grid::{Block, Cell, Grid, Row};
use super::guess::{heads, name_of, sums_up};
use super::map::stated;
use super::targets::plain;
use super::units::is_unit;

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

fn texts(row: &Row) -> Vec<String> {
    row.cells[..row.width()].iter().map(Cell::shown).collect()
}

impl Source {
    fn numbers(&self, row: &Row) -> usize {
        row.cells.iter().filter(|c| c.is_number(self.comma)).count()
    }

    fn is_words(&self, row: &Row) -> bool {
        row.filled() > 0 && 2 * self.numbers(row) < row.filled()
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
            names: texts(names),
            units: units.map(texts).unwrap_or_default(),
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

    /// The first row of the data. Rows of a word and its value above a row of words are no data, even where
    /// the table is as narrow.
    fn first(&self, rows: &[Row], is_data: &dyn Fn(&Row) -> bool) -> usize {
        let first = rows.iter().position(is_data).unwrap_or(rows.len());
        let pair = |r: &Row| {
            r.filled() == 2 && r.width() == 2 && !r.cells[0].is_number(self.comma) && self.numbers(r) == 1
        };
        let table = (first..rows.len()).find(|k| is_data(&rows[*k]) && !pair(&rows[*k]));
        let headed =
            |k: &usize| rows[..*k].iter().rfind(|r| r.filled() > 0).is_some_and(|r| self.is_words(r));
        table.filter(|k| *k > first && headed(k)).unwrap_or(first)
    }

    /// Finds headers, units and data among rows: data begin with the first row of mostly numbers that is about as wide as most.
    pub fn find(&self, rows: Vec<Row>) -> Grid {
        let mut widths: Vec<usize> = rows.iter().map(Row::filled).filter(|n| *n > 0).collect();
        widths.sort_unstable();
        let usual = widths.get(widths.len() / 2).copied().unwrap_or(0);
        let is_data = |row: &Row| {
            let numbers = self.numbers(row);
            2 * row.filled() >= usual && 2 * numbers >= row.filled() && numbers > 0
        };
        let first = self.first(&rows, &is_data);
        // The header is judged by the rows that it heads: other words further down may head wider ones.
        let words_below = rows.iter().skip(first).position(|r| self.is_words(r) && r.filled() > 1);
        let end = words_below.map_or(rows.len(), |k| first + k);
        let mut data: Vec<usize> = rows[..end]
            .iter()
            .filter(|r| is_data(r))
            .map(|r| if self.blanks { r.filled() } else { r.width() })
            .collect();
        data.sort_unstable();
        let wide = data.get(data.len() / 2).copied().unwrap_or(0);
        let mut grid = Grid { format: self.format.clone(), comma: self.comma, ..Grid::default() };
        // Words right above the data, each at least half as wide as the table.
        let above: Vec<&Row> =
            rows[..first].iter().rev().take_while(|r| self.is_words(r) && 2 * r.filled() >= usual).collect();
        let above: Vec<&Row> = above.into_iter().take(3).rev().collect();
        let begin = rows.get(first).map_or(u64::MAX, |r| r.place);
        let spoken: Vec<&Row> =
            self.comments.iter().filter(|r| r.place < begin && r.cells.len() > 1).collect();
        let spoken: Vec<&Row> =
            spoken.into_iter().filter(|r| r.width() == wide && self.is_words(r)).collect();
        let head = self.head(&above).map(|h| (h, false)).or_else(|| Some((self.head(&spoken)?, true)));
        let mut header_rows = 0;
        if let Some((head, in_comment)) = head {
            match self.fitted(&head, &rows[..end], &is_data, wide) {
                Ok(names) => {
                    (grid.header, grid.units) = (names, head.units);
                    header_rows = if in_comment { 0 } else { head.rows };
                    if in_comment {
                        grid.notes.push("the header is in a comment".into());
                    }
                }
                Err(why) => grid.notes.push(why),
            }
        }
        for row in rows[..first - header_rows].iter().filter(|row| row.filled() > 0) {
            let words = texts(row).join(" ");
            grid.notes.push(format!("row {} before the header was passed over: {}", row.place, words.trim()));
        }
        if grid.header.is_empty() {
            grid.notes.push("there is no header: columns are #1, #2, ...".into());
        }
        let named = !grid.header.is_empty();
        self.below(&mut grid, rows.into_iter().skip(first).collect(), &is_data, wide);
        leave_out_summaries(&mut grid);
        let most = grid.rows.iter().filter(|r| r.block == 0).map(|row| row.cells.len()).max().unwrap_or(0);
        let wide = if named && !self.places { grid.header.len() } else { most.max(1) };
        grid.header.truncate(wide);
        while grid.header.len() < wide {
            grid.header.push(format!("#{}", grid.header.len() + 1));
        }
        for (k, name) in grid.header.iter_mut().enumerate().filter(|(_, name)| name.is_empty()) {
            *name = format!("#{}", k + 1);
        }
        grid
    }

    /// The names as they fit the rows, or why they do not: names beside other numbers of cells would be those of other columns.
    fn fitted(
        &self,
        head: &Head,
        rows: &[Row],
        is_data: &dyn Fn(&Row) -> bool,
        wide: usize,
    ) -> Result<Vec<String>, String> {
        let names = head.names.len();
        if self.places || names == wide || names > wide && !self.blanks {
            return Ok(head.names.clone());
        }
        let first = |row: &Row| match &row.cells[0] {
            Cell::Text(text) if !row.cells[0].is_number(self.comma) => {
                Some(text.trim_matches('"').to_string())
            }
            cell => cell.digits(self.comma),
        };
        let data: Vec<&Row> = rows.iter().filter(|r| is_data(r)).collect();
        // Some programs leave out the name of a first column that numbers or names the rows.
        let counted =
            |from: usize| (from..).zip(&data).all(|(k, r)| first(r).is_some_and(|t| t.parse() == Ok(k)));
        let labelled =
            || data.iter().all(|r| matches!(&r.cells[0], Cell::Text(_)) && !r.cells[0].is_number(self.comma));
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

    /// The rows from the first of the data on, with the headers among them.
    fn below(&self, grid: &mut Grid, rows: Vec<Row>, is_data: &dyn Fn(&Row) -> bool, wide: usize) {
        let mut comments = self.comments.iter().filter(|r| self.numbers(r) == 0 && r.filled() > 1).peekable();
        let begin = rows.first().map_or(u64::MAX, |r| r.place);
        while comments.next_if(|c| c.place < begin).is_some() {}
        let (mut block, mut pending): (usize, Vec<(Row, bool)>) = (0, Vec::new());
        // Why the rows cannot be those of the table any more.
        let mut ended: Option<String> = None;
        for row in rows {
            while let Some(comment) = comments.next_if(|c| c.place < row.place) {
                pending.push((comment.clone(), true));
            }
            if row.filled() == 0 {
                continue;
            }
            if !is_data(&row) {
                pending.push((row, false));
                continue;
            }
            let taken = self.next_block(grid, &pending, &mut block, &row);
            if taken > 0 {
                ended = None;
            } else {
                ended = self.ends(grid, &pending, block).or(ended);
            }
            let rest = pending.len() - taken;
            let rest = pending.drain(..).take(rest).filter(|(_, comment)| !comment).map(|(r, _)| r);
            for row in rest.chain([row]) {
                match &ended {
                    Some(why) => grid.left_out.push((row.place, texts(&row).join(" "), why.clone())),
                    None => self.put(grid, row, block, wide),
                }
            }
        }
        pending.into_iter().filter(|(_, comment)| !comment).for_each(|(r, _)| self.put(grid, r, block, wide));
    }

    /// Why the rows below the last of these are no rows of the table: it states other units, or is a header
    /// that is not known.
    fn ends(&self, grid: &Grid, pending: &[(Row, bool)], block: usize) -> Option<String> {
        let (last, _) = pending.iter().rfind(|(_, comment)| !comment)?;
        let cells = texts(last);
        let words: Vec<&String> = cells.iter().filter(|w| !w.is_empty()).collect();
        if words.len() < 2 || self.numbers(last) > 0 {
            return None;
        }
        let (header, units) = match block.checked_sub(1) {
            None => (&grid.header, &grid.units),
            Some(k) => (&grid.blocks[k].header, &grid.blocks[k].units),
        };
        let bare = |text: &str| text.trim_matches(['[', ']', '(', ')', ' ']).to_string();
        let missing = ["n/a", "none", "x"];
        if words.iter().all(|w| is_unit(w)) {
            let now = |k: usize| {
                let own = units.get(k).filter(|u| !u.is_empty()).map(String::as_str);
                own.or_else(|| stated(header.get(k)?)).map(bare).unwrap_or_default()
            };
            let other = |(k, word): (usize, &String)| !word.is_empty() && bare(word) != now(k);
            return (cells.iter().enumerate().any(other)
                && !words.iter().all(|w| missing.contains(&w.as_str())))
            .then(|| {
                format!("below row {}, which states other units: make a file of each part", last.place)
            });
        }
        // Marks of failed readings make rows of words too: they are alike, or in a column of words.
        let distinct = words.iter().enumerate().all(|(k, w)| !words[..k].contains(w));
        let above = grid.rows.last().map(|r| &r.cells[..]).unwrap_or_default();
        let beside = (above.iter().zip(&last.cells))
            .any(|(a, b)| matches!((a, b), (Cell::Text(_), Cell::Text(_))) && !a.is_number(self.comma));
        let named = words.iter().all(|w| w.starts_with(|c: char| c.is_alphabetic()));
        (distinct && named && !beside && 2 * words.len() >= header.len()).then(|| {
            format!(
                "below the words of row {}, which name no column of the table: make a file of each part, or give them the same columns",
                last.place
            )
        })
    }

    /// Whether the pending rows end with a header, and which block it begins; how many rows that takes.
    fn next_block(&self, grid: &mut Grid, pending: &[(Row, bool)], block: &mut usize, data: &Row) -> usize {
        let spoken = pending.last().is_some_and(|(_, comment)| *comment);
        let like: Vec<&Row> = pending
            .iter()
            .rev()
            .take(3)
            .take_while(|(r, comment)| {
                *comment == spoken && self.is_words(r) && (r.filled() > 1 || data.filled() == 1)
            })
            .map(|(r, _)| r)
            .collect();
        let like: Vec<&Row> = like.into_iter().rev().collect();
        let Some(head) = self.head(&like) else { return 0 };
        let bare = |names: &[String]| names.iter().map(|n| name_of(n)).collect::<Vec<_>>();
        let (main, own) = (bare(&grid.header), bare(&head.names));
        let known =
            own.iter().any(|n| !n.is_empty() && main.contains(n)) || head.names.iter().any(|n| heads(n));
        let fits = head.names.len() == data.width() || !self.blanks && !spoken;
        if !(known || head.rows == 2) || !fits {
            return 0;
        }
        let units = |units: &[String]| units.iter().filter(|u| !u.is_empty()).count();
        let same = |header: &[String], of: &[String]| {
            header == head.names && (of == head.units || units(of) == 0 && units(&head.units) == 0)
        };
        let already = grid.blocks.iter().position(|b| same(&b.header, &b.units)).map(|k| k + 1);
        let already = if same(&grid.header, &grid.units) { Some(0) } else { already };
        *block = already.unwrap_or_else(|| {
            let column = |k: usize| {
                let exact = head.names.iter().position(|n| *n == grid.header[k]);
                let one = |all: &[String]| all.iter().filter(|n| **n == main[k]).count() == 1;
                let alike = || own.iter().position(|n| *n == main[k]).filter(|_| one(&main) && one(&own));
                exact.filter(|_| !grid.header[k].is_empty()).or_else(alike)
            };
            let columns = (0..grid.header.len()).map(column).collect();
            grid.blocks.push(Block {
                place: head.place,
                header: head.names.clone(),
                units: head.units.clone(),
                columns,
            });
            grid.blocks.len()
        });
        // With the word above it, which usually names the step.
        let begins = pending.len() - like.len() - usize::from(pending.len() > like.len());
        let (from, to) = (pending[begins].0.place, pending[pending.len() - 1].0.place);
        let rows = if from == to { format!("row {from} is") } else { format!("rows {from} to {to} are") };
        let other = if *block == 0 { "" } else { ", of other columns or units" };
        grid.notes.push(format!("{rows} a header again{other}"));
        head.rows
    }

    /// Takes a row into the table, or leaves it out where its cells cannot be those of the columns.
    fn put(&self, grid: &mut Grid, mut row: Row, block: usize, wide: usize) {
        let names = match block.checked_sub(1) {
            None if grid.header.is_empty() => wide,
            None => grid.header.len(),
            Some(k) => grid.blocks[k].header.len(),
        };
        let cells = row.width();
        let why = if cells == 1 && names > 1 && self.numbers(&row) == 0 {
            Some(ONE_TEXT.to_string())
        } else if !self.places && (cells > names || self.blanks && cells < names) {
            Some(format!("{cells} cells in place of {names}"))
        } else {
            None
        };
        if let Some(why) = why {
            grid.left_out.push((row.place, texts(&row).join(" "), why));
            return;
        }
        row.block = block;
        grid.rows.push(row);
    }
}

/// Takes out rows that sum others up, by a word of theirs. An operator may be called Max: a word that two rows
/// have in succession, or that half of the rows have, is a value of its column.
fn leave_out_summaries(grid: &mut Grid) {
    let rows = std::mem::take(&mut grid.rows);
    let mut sums = vec![None; rows.len()];
    for column in 0..rows.iter().map(|r| r.cells.len()).max().unwrap_or(0) {
        let word = |row: &Row| match row.cells.get(column) {
            Some(Cell::Text(t)) if t.starts_with(char::is_alphabetic) => {
                Some(plain(t)).filter(|w| sums_up(w))
            }
            _ => None,
        };
        let words: Vec<Option<String>> = rows.iter().map(word).collect();
        let values: Vec<&String> =
            words.windows(2).filter(|pair| pair[0] == pair[1]).filter_map(|pair| pair[0].as_ref()).collect();
        let named = |k: &usize| words[*k].as_ref().is_some_and(|word| !values.contains(&word));
        let found: Vec<usize> = (0..rows.len()).filter(named).collect();
        if 2 * found.len() < rows.len() {
            found.into_iter().for_each(|k| sums[k] = Some(rows[k].cells[column].shown()));
        }
    }
    for (row, sum) in rows.into_iter().zip(sums) {
        match sum {
            None => grid.rows.push(row),
            Some(word) => {
                let why = format!("'{word}' sums up other rows: no pass");
                grid.left_out.push((row.place, texts(&row).join(" "), why));
            }
        }
    }
}

#[cfg(test)]
mod tests;
