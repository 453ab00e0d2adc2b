//! Files of named arrays (MAT, HDF5) as one table: arrays of one length are its columns.

use super::grid::{Cell, Grid, Row};
use std::collections::BTreeMap;

/// A named array with one or two dimensions.
#[derive(Clone, Debug, Default)]
pub struct Array {
    /// Its name, with those of the structures or groups around it.
    pub name: String,
    /// Rows.
    pub rows: usize,
    /// Columns.
    pub columns: usize,
    /// Its numbers, column by column.
    pub cells: Vec<Cell>,
    /// Names of its columns where the file has them.
    pub names: Vec<String>,
    /// Units of its columns where the file has them.
    pub units: Vec<String>,
}

/// What is in a file: arrays, what could not be read, by its kind, and short texts by name.
#[derive(Clone, Debug, Default)]
pub struct Contents {
    /// Arrays.
    pub arrays: Vec<Array>,
    /// Sentences.
    pub notes: Vec<String>,
    /// Texts.
    pub texts: BTreeMap<String, String>,
}

impl Contents {
    /// The unit that a text beside an array states: `Fn.data` with `Fn.unit`, `Fn` with `units.Fn`.
    fn unit(&self, name: &str) -> Option<&String> {
        let (around, own) = name.rsplit_once('.').map_or(("", name), |(around, own)| (around, own));
        let inside =
            |name: &str| if around.is_empty() { name.to_string() } else { format!("{around}.{name}") };
        let alone = ["data", "value", "values", "y"].contains(&own.to_lowercase().as_str());
        ["unit", "units", "Unit", "Units"].iter().find_map(|word| {
            let whole = || self.texts.get(&inside(word)).filter(|_| alone);
            self.texts.get(&inside(&format!("{word}.{own}"))).or_else(whole)
        })
    }
}

/// One table of arrays of one length: that of the arrays that `wanted` names, else the commonest; `of` names
/// an array, a structure or a group.
///
/// # Errors
/// No arrays, several lengths that are as common, a name that is not there.
pub fn table(format: &str, of: Option<&str>, wanted: &[String], mut found: Contents) -> miette::Result<Grid> {
    let within = |rest: &str| rest.is_empty() || rest.starts_with(['.', '/']);
    let chosen = |array: &Array| of.is_none_or(|of| array.name.strip_prefix(of).is_some_and(within));
    let listed = |a: &Array| format!("{} ({} x {})", a.name, a.rows, a.columns);
    let all: Vec<String> = found.arrays.iter().map(listed).collect();
    let (mut constants, mut by_length) = (Vec::new(), BTreeMap::<usize, Vec<Array>>::new());
    for mut array in std::mem::take(&mut found.arrays).into_iter().filter(chosen) {
        if array.cells.len() == 1 {
            constants.push(format!("{} = {}", array.name, array.cells[0].shown()));
            continue;
        }
        // A row of numbers is a column that lies.
        if array.rows == 1 {
            (array.rows, array.columns) = (array.columns, 1);
        }
        by_length.entry(array.rows).or_default().push(array);
    }
    let named = |arrays: &Vec<Array>| wanted.iter().filter(|w| arrays.iter().any(|a| a.name == **w)).count();
    let rank = |arrays: &Vec<Array>| (named(arrays), arrays.len());
    let best = by_length.values().map(rank).max();
    let mut first =
        by_length.iter().filter(|(_, arrays)| Some(rank(arrays)) == best).map(|(length, _)| *length);
    let (Some(length), None) = (first.next(), first.next()) else {
        let listed = if all.is_empty() { "none".to_string() } else { all.join(", ") };
        let why =
            if found.notes.is_empty() { String::new() } else { format!("\n{}", found.notes.join("\n")) };
        miette::bail!(
            help = format!("name an array, a structure or a group with --sheet; arrays of numbers: {listed}"),
            "the {format} file holds no table: its arrays have several lengths, or there is none of that name{why}"
        );
    };
    let columns = by_length.remove(&length).unwrap_or_default();
    let rest: Vec<String> = by_length.values().flatten().map(listed).collect();
    let rows = columns[0].rows;
    let alone = columns.len() == 1;
    let (mut header, mut units) = (Vec::new(), Vec::new());
    for array in &columns {
        let name = of.map_or(array.name.as_str(), |of| {
            array.name.strip_prefix(of).map_or("", |rest| rest.trim_start_matches(['.', '/']))
        });
        match (array.columns, alone) {
            (n, _) if array.names.len() == n => header.extend(array.names.iter().cloned()),
            (1, _) => header.push(if name.is_empty() { array.name.clone() } else { name.to_string() }),
            (n, true) => header.extend((1..=n).map(|k| format!("#{k}"))),
            (n, false) => header.extend((1..=n).map(|k| format!("{name}#{k}"))),
        }
        let one = found.unit(&array.name).cloned().unwrap_or_default();
        units.extend((0..array.columns).map(|k| array.units.get(k).cloned().unwrap_or(one.clone())));
    }
    let within = header[0].rsplit_once('/').map(|(group, _)| format!("{group}/")).unwrap_or_default();
    let inside = |name: &String| name.strip_prefix(&within).is_some_and(|rest| !rest.contains('/'));
    let mut grid = Grid::default();
    if !within.is_empty() && header.iter().all(inside) {
        header.iter_mut().for_each(|name| *name = name.split_off(within.len()));
        grid.within = within;
    }
    let cell = |array: &Array, row: usize, column: usize| array.cells[column * rows + row].clone();
    let row = |row: usize| {
        let of_array = |array: &Array| (0..array.columns).map(|c| cell(array, row, c)).collect::<Vec<_>>();
        Row::new(row as u64 + 1, columns.iter().flat_map(of_array).collect())
    };
    grid = Grid { format: format.into(), header, units, rows: (0..rows).map(row).collect(), ..grid };
    grid.notes.extend(found.notes);
    if !rest.is_empty() {
        grid.notes.push(format!("arrays of another length were passed over: {}", rest.join(", ")));
    }
    if !constants.is_empty() {
        grid.notes.push(format!(
            "single numbers that were passed over: {}; take them with --set",
            constants.join(", ")
        ));
    }
    Ok(grid)
}
