//! Results in Parquet: `index`, `key` (SHA-256), `failed` (why there is no result), then the columns of the kind. The file's own
//! metadata say of which study it is, and who made it; what is gathered holds the first and not the second.

use super::kinds::{CaseKind, Cell, Type};
use super::run::Entry;
use arrow_array::builder::{
    BooleanBuilder, FixedSizeBinaryBuilder, Float64Builder, StringBuilder, UInt64Builder,
};
use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, UInt64Type};
use arrow_array::{Array, ArrayRef, RecordBatch};
use arrow_schema::{DataType, Field, Schema};
use miette::{Context, IntoDiagnostic};
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::{ParquetRecordBatchReader, ParquetRecordBatchReaderBuilder};
use parquet::basic::Compression;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::sync::Arc;
use tables::export::unit;

/// Rows of a row group, in shards and in what is gathered: what is held in memory at once.
pub const ROWS: usize = super::run::PORTION;

/// What a file says of itself, sorted by name.
pub type Facts = BTreeMap<String, String>;

/// The schema of a kind's results.
pub fn schema(kind: &CaseKind) -> Arc<Schema> {
    let description = |words: &str| HashMap::from([("description".to_string(), words.to_string())]);
    let field =
        |name, data, words| Field::new(name, data, name == "failed").with_metadata(description(words));
    let mut fields = vec![
        field("index", DataType::UInt64, "index of the case in its file, from 0"),
        field("key", DataType::FixedSizeBinary(32), "SHA-256 of version and inputs of the case"),
        field("failed", DataType::Utf8, "why there is no result; missing where there is one"),
    ];
    for column in kind.columns {
        let (data, unit) = match column.cells {
            Type::Number => (DataType::Float64, Some(unit::of(column.name))),
            Type::Count => (DataType::UInt64, Some("1")),
            Type::Flag => (DataType::Boolean, None),
            Type::Text => (DataType::Utf8, None),
        };
        let mut about = description(column.words);
        about.extend(unit.map(|unit| ("unit".to_string(), unit.to_string())));
        fields.push(Field::new(column.name, data, true).with_metadata(about));
    }
    Arc::new(Schema::new(fields))
}

fn batch(kind: &CaseKind, schema: &Arc<Schema>, entries: &[Entry]) -> miette::Result<RecordBatch> {
    let (mut index, mut failed) = (UInt64Builder::new(), StringBuilder::new());
    let mut key = FixedSizeBinaryBuilder::new(32);
    for entry in entries {
        index.append_value(entry.index);
        key.append_value(entry.key).into_diagnostic()?;
        failed.append_option(entry.outcome.as_ref().err());
    }
    let mut arrays: Vec<ArrayRef> =
        vec![Arc::new(index.finish()), Arc::new(key.finish()), Arc::new(failed.finish())];
    for (i, column) in kind.columns.iter().enumerate() {
        let cells = entries
            .iter()
            .map(|e| e.outcome.as_ref().map_or(&Cell::Missing, |row| row.get(i).unwrap_or(&Cell::Missing)));
        macro_rules! column {
            ($builder:ty, $of:pat => $value:expr) => {{
                let mut builder = <$builder>::new();
                for cell in cells {
                    match cell {
                        $of => builder.append_value($value),
                        Cell::Missing => builder.append_null(),
                        other => {
                            miette::bail!("{}: {other:?} in a column of {:?}", column.name, column.cells)
                        }
                    }
                }
                Arc::new(builder.finish()) as ArrayRef
            }};
        }
        arrays.push(match column.cells {
            Type::Number => column!(Float64Builder, Cell::Number(v) => *v),
            Type::Count => column!(UInt64Builder, Cell::Count(v) => *v),
            Type::Flag => column!(BooleanBuilder, Cell::Flag(v) => *v),
            Type::Text => column!(StringBuilder, Cell::Text(v) => v),
        });
    }
    RecordBatch::try_new(Arc::clone(schema), arrays).into_diagnostic()
}

fn entries(kind: &CaseKind, batch: &RecordBatch) -> Vec<Entry> {
    let (index, key) = (batch.column(0).as_primitive::<UInt64Type>(), batch.column(1).as_fixed_size_binary());
    let failed = batch.column(2).as_string::<i32>();
    let cell = |i: usize, row: usize| {
        let array = batch.column(3 + i);
        if array.is_null(row) {
            return Cell::Missing;
        }
        match kind.columns[i].cells {
            Type::Number => Cell::Number(array.as_primitive::<Float64Type>().value(row)),
            Type::Count => Cell::Count(array.as_primitive::<UInt64Type>().value(row)),
            Type::Flag => Cell::Flag(array.as_boolean().value(row)),
            Type::Text => Cell::Text(array.as_string::<i32>().value(row).to_string()),
        }
    };
    (0..batch.num_rows())
        .map(|row| Entry {
            index: index.value(row),
            key: key.value(row).try_into().unwrap_or([0; 32]),
            outcome: if failed.is_null(row) {
                Ok((0..kind.columns.len()).map(|i| cell(i, row)).collect())
            } else {
                Err(failed.value(row).to_string())
            },
        })
        .collect()
}

/// Writes results in row groups of [`ROWS`], whatever the portions that they come in.
pub struct Writer<W: Write + Send> {
    kind: &'static CaseKind,
    schema: Arc<Schema>,
    writer: ArrowWriter<W>,
    held: Vec<Entry>,
}

impl<W: Write + Send> Writer<W> {
    /// Of a kind.
    ///
    /// # Errors
    /// As the file system.
    pub fn new(kind: &'static CaseKind, to: W) -> miette::Result<Self> {
        let schema = schema(kind);
        let properties = WriterProperties::builder()
            .set_compression(Compression::SNAPPY)
            .set_created_by("muprime".into())
            .build();
        let writer = ArrowWriter::try_new(to, Arc::clone(&schema), Some(properties)).into_diagnostic()?;
        Ok(Writer { kind, schema, writer, held: Vec::new() })
    }

    /// One row more.
    ///
    /// # Errors
    /// As the file system.
    pub fn push(&mut self, entry: Entry) -> miette::Result<()> {
        self.held.push(entry);
        if self.held.len() == ROWS { self.flush() } else { Ok(()) }
    }

    /// Writes what is held as a row group.
    fn flush(&mut self) -> miette::Result<()> {
        if self.held.is_empty() {
            return Ok(());
        }
        let batch = batch(self.kind, &self.schema, &self.held)?;
        self.held.clear();
        self.writer.write(&batch).and_then(|()| self.writer.flush()).into_diagnostic()
    }

    /// Ends the file with what it says of itself, and gives back what was written to.
    ///
    /// # Errors
    /// As the file system.
    pub fn end(mut self, facts: &Facts) -> miette::Result<W> {
        self.flush()?;
        for (name, fact) in facts {
            self.writer.append_key_value_metadata(KeyValue::new(format!("muprime.{name}"), fact.clone()));
        }
        self.writer.into_inner().into_diagnostic()
    }
}

/// An open shard.
pub struct Reader {
    /// What it says of itself.
    pub facts: Facts,
    /// Rows that its end states.
    pub rows: u64,
    kind: &'static CaseKind,
    batches: ParquetRecordBatchReader,
    ready: std::vec::IntoIter<Entry>,
    shown: String,
}

impl Reader {
    /// Opens a shard of a kind.
    ///
    /// # Errors
    /// A file that cannot be read, that is no whole Parquet file, or that holds other columns.
    pub fn open(kind: &'static CaseKind, path: &Path) -> miette::Result<Reader> {
        let shown = path.display().to_string();
        let named = || shown.clone();
        let file = File::open(path).into_diagnostic().wrap_err_with(named)?;
        let builder =
            ParquetRecordBatchReaderBuilder::try_new(file).into_diagnostic().wrap_err_with(named)?;
        let file = builder.metadata().file_metadata();
        let (rows, values) = (file.num_rows(), file.key_value_metadata().cloned().unwrap_or_default());
        let fact = |kv: KeyValue| Some((kv.key.strip_prefix("muprime.")?.to_string(), kv.value?));
        let facts: Facts = values.into_iter().filter_map(fact).collect();
        let same = |a: &Field, b: &Field| a.name() == b.name() && a.data_type() == b.data_type();
        let wanted = schema(kind);
        let found = builder.schema().fields();
        if found.len() != wanted.fields().len() || !found.iter().zip(wanted.fields()).all(|(a, b)| same(a, b))
        {
            miette::bail!("{shown}: no results of the kind {} as this version has them", kind.name);
        }
        let batches = builder.with_batch_size(ROWS).build().into_diagnostic().wrap_err_with(named)?;
        Ok(Reader { facts, rows: rows.max(0) as u64, kind, batches, ready: Vec::new().into_iter(), shown })
    }
}

impl Iterator for Reader {
    type Item = miette::Result<Entry>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(entry) = self.ready.next() {
                return Some(Ok(entry));
            }
            match self.batches.next()? {
                Ok(batch) => self.ready = entries(self.kind, &batch).into_iter(),
                Err(why) => return Some(Err(why).into_diagnostic().wrap_err_with(|| self.shown.clone())),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cases::kinds::{KINDS, ridge};

    fn rows(kind: &CaseKind, n: u64) -> Vec<Entry> {
        let cell = |t: Type, i: u64| match (t, i % 3) {
            (_, 2) => Cell::Missing,
            (Type::Number, _) => Cell::Number(1.0 / (1.0 + i as f64)),
            (Type::Count, _) => Cell::Count(i),
            (Type::Flag, _) => Cell::Flag(i.is_multiple_of(2)),
            (Type::Text, _) => Cell::Text(format!("text {i}")),
        };
        let outcome = |i: u64| {
            if i % 7 == 6 {
                Err(format!("reason {i}"))
            } else {
                Ok(kind.columns.iter().map(|c| cell(c.cells, i)).collect())
            }
        };
        (0..n).map(|i| Entry { index: i, key: kind.key(&i.to_string()), outcome: outcome(i) }).collect()
    }

    #[test]
    fn what_is_read_is_what_was_written_to_the_bit_and_the_bytes_know_no_portions() {
        for kind in KINDS {
            let all = rows(kind, ROWS as u64 + 10);
            let bytes = || {
                let mut writer = Writer::new(kind, Vec::new()).unwrap();
                all.iter().for_each(|e| writer.push(e.clone()).unwrap());
                writer.end(&Facts::from([("a".into(), "b".into())])).unwrap()
            };
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("x.parquet");
            std::fs::write(&path, bytes()).unwrap();
            assert_eq!(bytes(), bytes());
            let read = Reader::open(kind, &path).unwrap();
            assert_eq!((read.rows, read.facts["a"].as_str()), (all.len() as u64, "b"));
            assert_eq!(read.map(Result::unwrap).collect::<Vec<_>>(), all);
        }
    }

    #[test]
    fn a_cut_shard_and_one_of_another_kind_are_refused() {
        let mut writer = Writer::new(&ridge::KIND, Vec::new()).unwrap();
        rows(&ridge::KIND, 20).into_iter().for_each(|e| writer.push(e).unwrap());
        let bytes = writer.end(&Facts::new()).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.parquet");
        std::fs::write(&path, &bytes).unwrap();
        assert!(Reader::open(super::super::kinds::by_name("noop").unwrap(), &path).is_err());
        for keep in [0, 4, bytes.len() / 2, bytes.len() - 1] {
            std::fs::write(&path, &bytes[..keep]).unwrap();
            assert!(Reader::open(&ridge::KIND, &path).is_err(), "{keep} bytes");
        }
    }
}
