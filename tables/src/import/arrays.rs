//! Files of named arrays (MAT, HDF5) as one table: arrays of one length are its columns.

use super::grid::{Cell, Grid, Row};
use std::collections::BTreeMap;

/// A named array of numbers with one or two dimensions.
#[derive(Clone, Debug)]
pub struct Array {
    /// Its name, with those of the structures or groups around it.
    pub name: String,
    /// Rows.
    pub rows: usize,
    /// Columns.
    pub columns: usize,
    /// Its numbers, column by column.
    pub cells: Vec<Cell>,
}

/// A number as a cell; what is none is empty.
pub fn number(value: f64) -> Cell {
    if value.is_nan() { Cell::Empty } else { Cell::Number(value) }
}

/// A single as a cell: the fewest digits stand for what was meant.
pub fn single(value: f32) -> Cell {
    Cell::of(&format!("{value:e}"))
}

/// One table of arrays of one length; `of` names an array, a structure or a group where there are several lengths.
///
/// # Errors
/// No arrays, several lengths and none chosen, a name that is not there.
pub fn table(format: &str, arrays: Vec<Array>, of: Option<&str>, notes: Vec<String>) -> miette::Result<Grid> {
    let chosen = |array: &Array| match of {
        None => true,
        Some(name) => {
            let rest = array.name.strip_prefix(name);
            rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '/']))
        }
    };
    let all: Vec<String> =
        arrays.iter().map(|a| format!("{} ({} x {})", a.name, a.rows, a.columns)).collect();
    let (mut constants, mut by_length) = (Vec::new(), BTreeMap::<usize, Vec<Array>>::new());
    for mut array in arrays.into_iter().filter(chosen) {
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
    let listed = if all.is_empty() { "none".to_string() } else { all.join(", ") };
    let mut lengths = by_length.into_values();
    let (Some(columns), None) = (lengths.next(), lengths.next()) else {
        miette::bail!(
            help = format!("name an array, a structure or a group with --sheet; there are: {listed}"),
            "the {format} file holds no table: its arrays have several lengths, or there is none of that name"
        );
    };
    let rows = columns[0].rows;
    let alone = columns.len() == 1;
    let mut header = Vec::new();
    for array in &columns {
        let name = of.map_or(array.name.as_str(), |of| {
            array.name.strip_prefix(of).map_or("", |rest| rest.trim_start_matches(['.', '/']))
        });
        match (array.columns, alone) {
            (1, _) => header.push(if name.is_empty() { array.name.clone() } else { name.to_string() }),
            (n, true) => header.extend((1..=n).map(|k| format!("#{k}"))),
            (n, false) => header.extend((1..=n).map(|k| format!("{name}#{k}"))),
        }
    }
    let cell = |array: &Array, row: usize, column: usize| array.cells[column * rows + row].clone();
    let row = |row: usize| {
        let of_array = |array: &Array| (0..array.columns).map(|c| cell(array, row, c)).collect::<Vec<_>>();
        Row { place: row as u64 + 1, cells: columns.iter().flat_map(of_array).collect() }
    };
    let mut grid = Grid::named(format.into(), header, (0..rows).map(row).collect());
    grid.notes.extend(notes);
    if !constants.is_empty() {
        grid.notes.push(format!(
            "single numbers that were passed over: {}; take them with --set",
            constants.join(", ")
        ));
    }
    Ok(grid)
}
