//! CSV, numbers with as many digits as it takes to read them back unchanged.

use super::columns::{Cells, Table, rows};
use miette::IntoDiagnostic;

pub fn bytes(table: &Table) -> miette::Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(table.iter().map(|column| column.name)).into_diagnostic()?;
    for row in 0..rows(table) {
        let cell = |cells: &Cells| match cells {
            Cells::Numbers(v) => v[row].map(|v| v.to_string()).unwrap_or_default(),
            Cells::Counts(v) => v[row].map(|v| v.to_string()).unwrap_or_default(),
            Cells::Texts(v) => v[row].clone().unwrap_or_default(),
        };
        writer.write_record(table.iter().map(|column| cell(&column.cells))).into_diagnostic()?;
    }
    writer.into_inner().into_diagnostic()
}
