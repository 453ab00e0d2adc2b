//! CSV, numbers with as many digits as it takes to read them back unchanged.

use super::columns::{Column, Table, rows};
use miette::IntoDiagnostic;

pub fn bytes(table: &Table) -> miette::Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(table.iter().map(|(name, _)| *name)).into_diagnostic()?;
    for row in 0..rows(table) {
        let cell = |column: &Column| match column {
            Column::Numbers(v) => v[row].map(|v| v.to_string()).unwrap_or_default(),
            Column::Counts(v) => v[row].map(|v| v.to_string()).unwrap_or_default(),
            Column::Texts(v) => v[row].clone().unwrap_or_default(),
        };
        writer.write_record(table.iter().map(|(_, column)| cell(column))).into_diagnostic()?;
    }
    writer.into_inner().into_diagnostic()
}
