//! An Arrow IPC file with one record batch.

use super::columns::{Column, Table};
use arrow_array::{ArrayRef, Float64Array, RecordBatch, StringArray, UInt64Array};
use arrow_schema::{DataType, Field, Schema};
use miette::IntoDiagnostic;
use std::sync::Arc;

pub fn bytes(table: &Table) -> miette::Result<Vec<u8>> {
    let field = |(name, column): &(&'static str, Column)| {
        let kind = match column {
            Column::Numbers(_) => DataType::Float64,
            Column::Counts(_) => DataType::UInt64,
            Column::Texts(_) => DataType::Utf8,
        };
        Field::new(*name, kind, true)
    };
    let array = |(_, column): &(&'static str, Column)| -> ArrayRef {
        match column {
            Column::Numbers(v) => Arc::new(Float64Array::from(v.clone())),
            Column::Counts(v) => Arc::new(UInt64Array::from(v.clone())),
            Column::Texts(v) => Arc::new(StringArray::from(v.clone())),
        }
    };
    let schema = Arc::new(Schema::new(table.iter().map(field).collect::<Vec<_>>()));
    let batch =
        RecordBatch::try_new(Arc::clone(&schema), table.iter().map(array).collect()).into_diagnostic()?;
    let mut bytes = Vec::new();
    let mut writer = arrow_ipc::writer::FileWriter::try_new(&mut bytes, &schema).into_diagnostic()?;
    writer.write(&batch).into_diagnostic()?;
    writer.finish().into_diagnostic()?;
    drop(writer);
    Ok(bytes)
}
