//! What is doubtful in a map: columns that were left open; signs, units and amplitudes that it takes
//! otherwise than the source says. Nothing is repaired.

use super::{Map, Taken, unit_row};
use crate::import::clock::is_time;
use crate::import::grid::{Cell, Grid, Row};
use crate::import::guess::{open_unit, stroke, taken, unit_of};
use crate::import::targets::Id;
use instruments::Unit;

/// Why columns with a name of that column of the point table were not guessed.
pub(super) fn open(map: &Map, grid: &Grid, column: &str) -> String {
    let choice = map.free(grid).filter_map(|k| taken(grid, k)).filter(|t| t.target.column == column);
    let choice: Vec<String> = choice.map(|t| format!("'{}'", t.header)).collect();
    if choice.len() > 1 {
        return format!("; {}: map one of them", choice.join(" or "));
    }
    let why = |k: usize| {
        let (target, unit) = open_unit(grid, k).filter(|(target, _)| target.column == column)?;
        let (name, header) = (target.name, &grid.header[k]);
        Some(format!("; '{header}' was left open: '{unit}' is not a unit of {name} that a header can state"))
    };
    map.free(grid).filter_map(why).collect()
}

/// The refusal of a magnitude that has both signs in many rows: it would turn with the direction twice.
pub(super) fn signed(column: &Taken, grid: &Grid) -> Option<String> {
    let remedy = match column.target.id {
        Id::FrictionForce => "map it as lateral_force",
        Id::FrictionCoefficient => {
            "map its product with the normal force as lateral_force (under a constant load of 5 N: HEADER=lateral_force:5N)"
        }
        _ => return None,
    };
    let value = |r: &Row| match grid.cell(r, column.index)? {
        Cell::Percent(ratio) => Some(*ratio),
        cell => Unit::SI.apply(cell.digits(grid.comma)?.trim_end_matches(['%', ' '])),
    };
    let values: Vec<f64> = grid.rows.iter().filter_map(value).filter(|v| *v != 0.0).collect();
    let below = values.iter().filter(|v| **v < 0.0).count();
    let (few, name) = (below.min(values.len() - below), column.target.name);
    (few > 0 && 5 * few >= values.len()).then(|| {
        format!(
            "{}: {below} of {} values are negative, and {name} is a magnitude without a sign: if the sign is that of the sensor, {remedy}",
            column.header,
            values.len()
        )
    })
}

/// What the map says otherwise than the source, and what it assumes, in sentences. A sign is no other unit.
pub fn contradicted(map: &Map, grid: &Grid) -> Vec<String> {
    let size = |unit: &Unit| (unit.factor().abs(), unit.offset().abs());
    let words = "the map was taken: correct it if the header is right";
    let unit = |c: &Taken| {
        let (text, unit) = unit_of(grid, c.index, c.target)?;
        let both = format!("{}: the header says {text}, the map says {}; {words}", c.header, c.unit_text);
        (size(&unit) != size(&c.unit)).then_some(both)
    };
    let counted = |c: &Taken| {
        let row = || unit_row(&grid.units, c.index).and_then(stroke);
        let says = stroke(&grid.header[c.index]).or_else(row)?.target();
        let other = says.id != c.target.id && says.column == c.target.column;
        let (says, taken) = (says.name, c.target.name);
        other.then(|| format!("{}: the header says {says}, the map says {taken}; {words}", c.header))
    };
    let assumed = |c: &Taken| {
        // A clock's times have their unit.
        let clock = grid.rows.iter().any(|r| grid.cell(r, c.index).is_some_and(is_time));
        let numbers =
            grid.rows.iter().filter_map(|r| Unit::SI.apply(&grid.cell(r, c.index)?.digits(grid.comma)?));
        // Days of a spreadsheet or of MATLAB, and hours, minutes and seconds in one number, are of this size.
        let serial = c.target.id == Id::Time && (1e4..1e6).contains(&numbers.fold(f64::INFINITY, f64::min));
        let days = ": they may be days of a spreadsheet (HEADER=time:d), or a clock without colons (115950 is 11:59:50)";
        (c.assumed && c.target.dimension().is_some() && !clock).then(|| {
            format!("{}: no unit stated, {} assumed{}", c.header, c.unit_text, if serial { days } else { "" })
        })
    };
    let of_column = |c: &Taken| [unit(c), counted(c), assumed(c), nameless(c, grid)].into_iter().flatten();
    map.columns.iter().flat_map(of_column).collect()
}

/// Rows without the name of a run, where others have one.
fn nameless(column: &Taken, grid: &Grid) -> Option<String> {
    let rows: Vec<&Row> = grid.rows.iter().filter(|r| r.block == 0).collect();
    let bare = |r: &&&Row| grid.cell(r, column.index).is_none_or(|cell| *cell == Cell::Empty);
    let first = rows.iter().find(bare).filter(|_| column.target.id == Id::Run)?;
    let count = rows.iter().filter(bare).count();
    (count < rows.len()).then(|| {
        format!(
            "{}: {count} of {} rows name no run (first row {}); if the name above holds for them, repeat it in every row of the source",
            column.header,
            rows.len(),
            first.place
        )
    })
}
