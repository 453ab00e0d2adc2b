//! Parquet: written as one row group, and read for the diagnosis.

use super::columns::{Column, Table};
use super::facts::Facts;
use miette::IntoDiagnostic;
use parquet::arrow::ArrowWriter;
use parquet::basic::Compression;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::Field;
use std::path::Path;

/// The table of [`super::arrow`], whose schema goes along (`ARROW:schema`): readers that know Arrow see units and facts where
/// Arrow has them. For those that do not, the file's own metadata hold the facts, and `muprime.columns`: name, unit and meaning
/// of every column as JSON.
pub fn bytes(table: &Table, facts: &Facts) -> miette::Result<Vec<u8>> {
    let batch = super::arrow::batch(table, facts)?;
    let about = |column: &Column| serde_json::json!({ "name": column.name, "unit": column.unit(), "description": column.words });
    let columns = serde_json::Value::Array(table.iter().map(about).collect()).to_string();
    let fact = |(name, fact): (&String, &String)| KeyValue::new(format!("muprime.{name}"), fact.clone());
    let columns = KeyValue::new("muprime.columns".to_string(), columns);
    let told = facts.iter().map(fact).chain(std::iter::once(columns));
    let properties = WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .set_created_by(format!("muprime {}", env!("CARGO_PKG_VERSION")))
        .set_key_value_metadata(Some(told.collect()))
        .build();
    let mut bytes = Vec::new();
    let mut writer = ArrowWriter::try_new(&mut bytes, batch.schema(), Some(properties)).into_diagnostic()?;
    writer.write(&batch).into_diagnostic()?;
    writer.close().into_diagnostic()?;
    Ok(bytes)
}

/// The columns of a Parquet point table as CSV text: one reader judges both formats.
///
/// # Errors
/// A file that is no Parquet table.
pub fn as_csv(path: &Path) -> miette::Result<String> {
    let reader = SerializedFileReader::new(std::fs::File::open(path).into_diagnostic()?).into_diagnostic()?;
    let mut text = String::new();
    let names: Vec<String> = reader
        .metadata()
        .file_metadata()
        .schema_descr()
        .columns()
        .iter()
        .map(|c| c.name().to_string())
        .collect();
    text.push_str(&names.join(","));
    text.push('\n');
    for row in reader.get_row_iter(None).into_diagnostic()? {
        let row = row.into_diagnostic()?;
        let cells: Vec<String> = row
            .get_column_iter()
            .map(|(_, field)| match field {
                Field::Null => String::new(),
                Field::Str(s) => format!("\"{}\"", s.replace('"', "\"\"")),
                Field::Double(v) => format!("{v:e}"),
                Field::Float(v) => format!("{v:e}"),
                other => other.to_string(),
            })
            .collect();
        text.push_str(&cells.join(","));
        text.push('\n');
    }
    Ok(text)
}
