//! The map of a part of the source that has a header of its own.

use super::{Map, MapError, Taken, stated, unit_row};
use crate::import::grid::{Block, Grid};
use instruments::Unit;

/// The map under another header of the source: the same columns, wherever they are there and whatever their
/// units. `None` where that header has none of them.
///
/// # Errors
/// A column that is missing there, units that are not stated in both places.
pub fn under(map: &Map, grid: &Grid, block: &Block) -> Result<Option<Map>, MapError> {
    let there = |c: &Taken| block.columns.get(c.index).copied().flatten();
    if map.columns.iter().all(|c| there(c).is_none()) {
        return Ok(None);
    }
    let (row, mut own) = (block.place, map.clone());
    for column in &mut own.columns {
        let header = column.header.clone();
        let Some(index) = there(column) else { return Err(MapError::NotUnder { row, header }) };
        let was = (&grid.header[column.index], unit_row(&grid.units, column.index));
        let is = (&block.header[index], unit_row(&block.units, index));
        column.index = index;
        let Some(dimension) = column.target.dimension().filter(|_| was != is) else { continue };
        let unit = |(header, row): (&String, Option<&str>)| match (stated(header), row) {
            (Some(unit), None) | (None, Some(unit)) => Unit::guess(dimension, unit).map(|(_, unit)| unit),
            _ => None,
        };
        match (unit(was), unit(is)) {
            (Some(first), Some(second)) if first == column.unit => column.unit = second,
            (Some(first), Some(second)) if first == second => {}
            _ => return Err(MapError::OtherUnit { row, header, other: is.0.clone() }),
        }
    }
    Ok(Some(own))
}
