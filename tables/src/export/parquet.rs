//! Parquet: written as one row group.

use super::columns::{Column, Table};
use super::facts::Facts;
use miette::IntoDiagnostic;
use parquet::arrow::ArrowWriter;
use parquet::basic::Compression;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;

/// The table of [`super::arrow`], whose schema goes along (`ARROW:schema`): readers that know Arrow see units
/// and facts where Arrow has them. For those that do not, the file's own metadata hold the facts, and
/// `muprime.columns`: name, unit and meaning of every column as JSON.
pub fn bytes(table: &Table, facts: &Facts) -> miette::Result<Vec<u8>> {
    let batch = super::arrow::batch(table, facts)?;
    let about = |column: &Column| serde_json::json!({ "name": column.name, "unit": column.unit(), "description": column.words });
    let columns = serde_json::Value::Array(table.iter().map(about).collect()).to_string();
    let fact = |(name, fact): (&String, &String)| KeyValue::new(format!("muprime.{name}"), fact.clone());
    let columns = KeyValue::new("muprime.columns".to_string(), columns);
    let metadata = facts.iter().map(fact).chain(std::iter::once(columns));
    let properties = WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .set_created_by(format!("muprime {}", env!("CARGO_PKG_VERSION")))
        .set_key_value_metadata(Some(metadata.collect()))
        .build();
    let mut bytes = Vec::new();
    let mut writer = ArrowWriter::try_new(&mut bytes, batch.schema(), Some(properties)).into_diagnostic()?;
    writer.write(&batch).into_diagnostic()?;
    writer.close().into_diagnostic()?;
    Ok(bytes)
}
