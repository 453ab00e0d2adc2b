//! Parquet: written as one row group, and read for the diagnosis.

use super::columns::{Column, Table};
use miette::IntoDiagnostic;
use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use parquet::record::Field;
use parquet::schema::types::Type;
use std::path::Path;
use std::sync::Arc;

pub fn bytes(table: &Table) -> miette::Result<Vec<u8>> {
    let field = |(name, column): &(&'static str, Column)| {
        let (kind, logical) = match column {
            Column::Numbers(_) => (Physical::DOUBLE, None),
            Column::Counts(_) => (Physical::INT64, None),
            Column::Texts(_) => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
        };
        let builder = Type::primitive_type_builder(name, kind).with_repetition(Repetition::OPTIONAL);
        builder.with_logical_type(logical).build().map(Arc::new)
    };
    let fields = table.iter().map(field).collect::<Result<Vec<_>, _>>().into_diagnostic()?;
    let schema = Type::group_type_builder("passes").with_fields(fields).build().into_diagnostic()?;
    let properties = WriterProperties::builder().set_compression(Compression::SNAPPY).build();
    let mut bytes = Vec::new();
    let mut file =
        SerializedFileWriter::new(&mut bytes, Arc::new(schema), Arc::new(properties)).into_diagnostic()?;
    let mut group = file.next_row_group().into_diagnostic()?;
    for (_, column) in table {
        let Some(mut writer) = group.next_column().into_diagnostic()? else { break };
        match column {
            Column::Numbers(v) => {
                let (values, levels) = present(v.iter().copied());
                writer.typed::<DoubleType>().write_batch(&values, Some(&levels), None).into_diagnostic()?;
            }
            Column::Counts(v) => {
                let (values, levels) = present(v.iter().map(|v| v.map(|v| v as i64)));
                writer.typed::<Int64Type>().write_batch(&values, Some(&levels), None).into_diagnostic()?;
            }
            Column::Texts(v) => {
                let (values, levels) = present(v.iter().map(|v| v.as_deref().map(ByteArray::from)));
                writer
                    .typed::<ByteArrayType>()
                    .write_batch(&values, Some(&levels), None)
                    .into_diagnostic()?;
            }
        }
        writer.close().into_diagnostic()?;
    }
    group.close().into_diagnostic()?;
    file.close().into_diagnostic()?;
    Ok(bytes)
}

/// Parquet's way with missing values: those that are there, and a level for each row.
fn present<T>(values: impl Iterator<Item = Option<T>>) -> (Vec<T>, Vec<i16>) {
    let mut there = Vec::new();
    let levels = values
        .map(|value| {
            let level = i16::from(value.is_some());
            there.extend(value);
            level
        })
        .collect();
    (there, levels)
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
