//! CSV, numbers with as many digits as it takes to read them back unchanged.

use super::columns::Table;
use crate::import::csv_of;

pub fn bytes(table: &Table) -> miette::Result<Vec<u8>> {
    let header: Vec<&str> = table.iter().map(|column| column.name).collect();
    let rows = 0..table.first().map_or(0, |column| column.rows());
    let cells = rows.map(|row| table.iter().map(move |column| column.shown(row).unwrap_or_default()));
    csv_of(&header, cells).map(String::into_bytes)
}
