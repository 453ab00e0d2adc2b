//! Rows below a header: further headers, each of which holds for the rows below it, and rows that are none of the table.

use super::{Extent, ONE_TEXT, Source};
use crate::import::grid::{Block, Cell, Grid, Row};
use crate::import::guess::{heads, name_of, sums_up};
use crate::import::map::{stated, unit_row};
use instruments::units::is_unit;

impl Source {
    /// The rows from the first of the data on, with the headers among them.
    pub(super) fn below(&self, grid: &mut Grid, rows: Vec<Row>, extent: &Extent) {
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
            if !self.is_data(&row, extent.usual) {
                pending.push((row, false));
                continue;
            }
            let taken = self.next_block(grid, &pending, &mut block, &row);
            ended = if taken > 0 { None } else { self.ends(grid, &pending, block).or(ended) };
            let rest = pending.len() - taken;
            let rest = pending.drain(..).take(rest).filter(|(_, comment)| !comment).map(|(r, _)| r);
            for row in rest.chain([row]) {
                match &ended {
                    Some(why) => grid.leave_out(&row, why.clone()),
                    None => self.put(grid, row, block, extent.wide),
                }
            }
        }
        let rest = pending.into_iter().filter(|(_, comment)| !comment);
        rest.for_each(|(row, _)| self.put(grid, row, block, extent.wide));
    }

    /// Why the rows below the last of these are no rows of the table: it states other units, or is a header
    /// that is not known.
    fn ends(&self, grid: &Grid, pending: &[(Row, bool)], block: usize) -> Option<String> {
        let (last, _) = pending.iter().rfind(|(_, comment)| !comment)?;
        let cells = last.texts();
        let words: Vec<&String> = cells.iter().filter(|w| !w.is_empty()).collect();
        if words.len() < 2 || self.numbers(last) > 0 {
            return None;
        }
        let (header, units) = grid.header_of(block);
        let bare = |text: &str| text.trim_matches(['[', ']', '(', ')', ' ']).to_string();
        let missing = ["n/a", "none", "x"];
        if words.iter().all(|w| is_unit(w)) {
            let now = |k: usize| {
                unit_row(units, k).or_else(|| stated(header.get(k)?)).map(bare).unwrap_or_default()
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
        let words = |(r, comment): &&(Row, bool)| {
            *comment == spoken && self.is_words(r) && (r.filled() > 1 || data.filled() == 1)
        };
        let like = pending.len() - pending.iter().rev().take(3).take_while(words).count();
        let rows: Vec<&Row> = pending[like..].iter().map(|(r, _)| r).collect();
        let Some(head) = self.head(&rows) else { return 0 };
        let bare = |names: &[String]| names.iter().map(|n| name_of(n)).collect::<Vec<_>>();
        let (main, own) = (bare(&grid.header), bare(&head.names));
        let known =
            own.iter().any(|n| !n.is_empty() && main.contains(n)) || head.names.iter().any(|n| heads(n));
        let fits = head.names.len() == data.width() || !self.blanks && !spoken;
        if !(known || head.rows == 2) || !fits {
            return 0;
        }
        let units = |units: &[String]| units.iter().filter(|u| !u.is_empty()).count();
        let same = |(header, of): (&[String], &[String])| {
            header == head.names && (of == head.units || [of, &head.units].iter().all(|all| units(all) == 0))
        };
        let already = (0..=grid.blocks.len()).find(|k| same(grid.header_of(*k)));
        *block = already.unwrap_or_else(|| {
            let column = |k: usize| {
                let exact = head.names.iter().position(|n| *n == grid.header[k]);
                let one = |all: &[String]| all.iter().filter(|n| **n == main[k]).count() == 1;
                let alike = || own.iter().position(|n| *n == main[k]).filter(|_| one(&main) && one(&own));
                exact.filter(|_| !grid.header[k].is_empty()).or_else(alike)
            };
            let columns = (0..grid.header.len()).map(column).collect();
            let (header, units) = (head.names.clone(), head.units.clone());
            grid.blocks.push(Block { place: head.place, header, units, columns });
            grid.blocks.len()
        });
        // With the word above it, which usually names the step.
        let (from, to) = (pending[like.saturating_sub(1)].0.place, pending[pending.len() - 1].0.place);
        let rows = if from == to { format!("row {from} is") } else { format!("rows {from} to {to} are") };
        let other = if *block == 0 { "" } else { ", of other columns or units" };
        grid.notes.push(format!("{rows} a header again{other}"));
        head.rows
    }

    /// Takes a row into the table, or leaves it out where its cells cannot be those of the columns.
    fn put(&self, grid: &mut Grid, mut row: Row, block: usize, wide: usize) {
        let names = match grid.header_of(block).0.len() {
            0 => wide,
            names => names,
        };
        let cells = row.width();
        if cells == 1 && names > 1 && self.numbers(&row) == 0 {
            grid.leave_out(&row, ONE_TEXT.into());
        } else if !self.places && (cells > names || self.blanks && cells < names) {
            grid.leave_out(&row, format!("{cells} cells in place of {names}"));
        } else {
            row.block = block;
            grid.rows.push(row);
        }
    }
}

/// Takes out rows that sum others up, by a word of theirs. An operator may be called Max: a word that two rows
/// have in succession, or that half of the rows have, is a value of its column.
pub fn leave_out_summaries(grid: &mut Grid) {
    let rows = std::mem::take(&mut grid.rows);
    let mut sums: Vec<Option<String>> = vec![None; rows.len()];
    for column in 0..rows.iter().map(|r| r.cells.len()).max().unwrap_or(0) {
        let mut below = false;
        let word = |row: &Row| {
            let Some(Cell::Text(text)) = row.cells.get(column) else { return None };
            below = text.contains(char::is_alphabetic) && sums_up(text, below);
            below.then(|| text.clone())
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
            Some(word) => grid.leave_out(&row, format!("'{word}' sums up other rows: no pass")),
        }
    }
}
