//! The table as one Arrow record batch, with the unit and the meaning of every column in its field's metadata
//! and the facts of the run in the schema's; and that batch as an IPC file.

use super::columns::{Cells, Column, Table};
use super::facts::Facts;
use arrow_array::{ArrayRef, Float64Array, RecordBatch, StringArray, UInt64Array};
use arrow_schema::{DataType, Field, Schema};
use miette::IntoDiagnostic;
use std::collections::HashMap;
use std::sync::Arc;

/// The batch.
pub fn batch(table: &Table, facts: &Facts) -> miette::Result<RecordBatch> {
    let field = |column: &Column| {
        let kind = match column.cells {
            Cells::Numbers(_) => DataType::Float64,
            Cells::Counts(_) => DataType::UInt64,
            Cells::Texts(_) => DataType::Utf8,
        };
        let mut about = HashMap::from([("description".to_string(), column.words.to_string())]);
        about.extend(column.unit().map(|unit| ("unit".to_string(), unit.to_string())));
        Field::new(column.name, kind, true).with_metadata(about)
    };
    let array = |column: &Column| -> ArrayRef {
        match &column.cells {
            Cells::Numbers(v) => Arc::new(Float64Array::from(v.clone())),
            Cells::Counts(v) => Arc::new(UInt64Array::from(v.clone())),
            Cells::Texts(v) => Arc::new(StringArray::from(v.clone())),
        }
    };
    let metadata = facts.iter().map(|(name, fact)| (format!("muprime.{name}"), fact.clone()));
    let schema = Schema::new(table.iter().map(field).collect::<Vec<_>>())
        .with_metadata(metadata.collect::<HashMap<_, _>>());
    RecordBatch::try_new(Arc::new(schema), table.iter().map(array).collect()).into_diagnostic()
}

pub fn bytes(table: &Table, facts: &Facts) -> miette::Result<Vec<u8>> {
    let batch = batch(table, facts)?;
    let mut bytes = Vec::new();
    let mut writer = arrow_ipc::writer::FileWriter::try_new(&mut bytes, &batch.schema()).into_diagnostic()?;
    writer.write(&batch).into_diagnostic()?;
    writer.finish().into_diagnostic()?;
    drop(writer);
    Ok(bytes)
}
