//! Tables of binary formats: Parquet, Arrow, NumPy.

use super::grid::{Cell, Grid, Row};
use miette::IntoDiagnostic;

/// A Parquet table.
///
/// # Errors
/// A file that is none, or uses a compression that is not built in.
#[cfg(feature = "parquet")]
pub fn parquet(path: &std::path::Path) -> miette::Result<Grid> {
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::Field;
    let wrong = |e: parquet::errors::ParquetError| {
        miette::miette!(help = "write it uncompressed or with snappy, or as CSV", "the Parquet file: {e}")
    };
    let reader = SerializedFileReader::new(std::fs::File::open(path).into_diagnostic()?).map_err(wrong)?;
    let about = reader.metadata().file_metadata();
    let names: Vec<String> = {
        let fields = about.schema_descr().root_schema().get_fields();
        fields.iter().map(|f| f.name().to_string()).collect()
    };
    let size = path.metadata().map_or(0, |m| m.len() as usize);
    let cells = usize::try_from(about.num_rows()).unwrap_or(0).saturating_mul(names.len());
    if cells > super::most_cells(size) {
        return Err(super::too_many("the Parquet file", cells, size));
    }
    // Readers that know Arrow find the units of the fields in its schema.
    let schema = parquet::arrow::parquet_to_arrow_schema(about.schema_descr(), about.key_value_metadata());
    let fields = schema.map(|s| s.fields().clone()).unwrap_or_default();
    let ticks: Vec<Option<Ticks>> = fields.iter().map(|f| Ticks::of(f.data_type())).collect();
    let units = (fields.iter().zip(&ticks))
        .map(|(f, ticks)| if matches!(ticks, Some(Ticks::Span(_))) { "s".into() } else { unit(f.metadata()) })
        .collect();
    let cell = |k: usize, field: &Field| match field {
        Field::Null => Cell::Empty,
        Field::Double(v) => Cell::number(*v),
        Field::Float(v) => Cell::single(*v),
        Field::TimestampMillis(v) => Cell::Clock(*v as f64 * 1e-3),
        Field::TimestampMicros(v) => Cell::Clock(*v as f64 * 1e-6),
        Field::Str(text) => Cell::of(text),
        Field::Group(_) | Field::ListInternal(_) | Field::MapInternal(_) => Cell::Text("(nested)".into()),
        Field::Long(v) => {
            let clock = ticks.get(k).copied().flatten();
            clock.map_or_else(|| Cell::of(&v.to_string()), |ticks| ticks.cell(*v))
        }
        other => Cell::of(&other.to_string()),
    };
    let mut rows = Vec::new();
    for (k, row) in (1..).zip(reader.get_row_iter(None).map_err(wrong)?) {
        let cells = row.map_err(wrong)?.get_column_iter().enumerate().map(|(k, (_, f))| cell(k, f)).collect();
        rows.push(Row::new(k, cells));
    }
    Ok(Grid { units, ..Grid::named("Parquet".into(), names, rows) })
}

/// Whole numbers of a clock, with the power of ten of their unit in s.
#[cfg(feature = "parquet")]
#[derive(Clone, Copy)]
enum Ticks {
    /// A time since some day.
    Clock(i32),
    /// A length of time.
    Span(i32),
}

#[cfg(feature = "parquet")]
impl Ticks {
    fn of(kind: &arrow_schema::DataType) -> Option<Self> {
        use arrow_schema::{DataType, TimeUnit};
        let ten = |unit: &TimeUnit| match unit {
            TimeUnit::Second => 0,
            TimeUnit::Millisecond => -3,
            TimeUnit::Microsecond => -6,
            TimeUnit::Nanosecond => -9,
        };
        match kind {
            DataType::Timestamp(unit, _) | DataType::Time64(unit) => Some(Ticks::Clock(ten(unit))),
            DataType::Duration(unit) => Some(Ticks::Span(ten(unit))),
            _ => None,
        }
    }

    fn cell(&self, count: i64) -> Cell {
        match self {
            Ticks::Clock(ten) => Cell::Clock(count as f64 / 10f64.powi(-ten)),
            // Through the decimal digits: every nanosecond counts.
            Ticks::Span(ten) => Cell::Text(format!("{count}e{ten}")),
        }
    }
}

/// The unit that the metadata of a field state.
#[cfg(feature = "arrow")]
fn unit(about: &arrow_schema::Metadata) -> String {
    let found = about.iter().find(|(name, _)| ["unit", "units"].contains(&name.to_lowercase().as_str()));
    found.map(|(_, unit)| unit.to_string()).unwrap_or_default()
}

/// An Arrow IPC (Feather) file.
///
/// # Errors
/// A file that is none, a compression that is not built in, columns of other than numbers and text.
#[cfg(feature = "arrow")]
pub fn arrow(bytes: &[u8]) -> miette::Result<Grid> {
    use arrow_array::cast::AsArray;
    use arrow_array::types::{Float32Type, Float64Type};
    use arrow_array::{Array, ArrayRef};
    use arrow_schema::DataType;
    let wrong = |e: arrow_schema::ArrowError| {
        miette::miette!(help = "write it without compression, or as CSV", "the Arrow file: {e}")
    };
    let reader = arrow_ipc::reader::FileReader::try_new(std::io::Cursor::new(bytes), None).map_err(wrong)?;
    let schema = reader.schema();
    let names = schema.fields().iter().map(|f| f.name().clone()).collect();
    let units = schema.fields().iter().map(|f| unit(f.metadata())).collect();
    let cell = |column: &ArrayRef, k: usize| {
        if column.is_null(k) {
            return Cell::Empty;
        }
        arrow_array::downcast_integer_array!(
            column => Cell::Number(column.value(k) as f64),
            DataType::Float64 => Cell::number(column.as_primitive::<Float64Type>().value(k)),
            DataType::Float32 => Cell::single(column.as_primitive::<Float32Type>().value(k)),
            DataType::Utf8 => Cell::of(column.as_string::<i32>().value(k)),
            DataType::LargeUtf8 => Cell::of(column.as_string::<i64>().value(k)),
            other => Cell::Text(format!("({other})")),
        )
    };
    let mut rows = Vec::new();
    for batch in reader {
        let batch = batch.map_err(wrong)?;
        let cells = (rows.len() + batch.num_rows()).saturating_mul(batch.num_columns());
        if cells > super::most_cells(bytes.len()) {
            return Err(super::too_many("the Arrow file", cells, bytes.len()));
        }
        for k in 0..batch.num_rows() {
            let cells = batch.columns().iter().map(|column| cell(column, k)).collect();
            rows.push(Row::new(rows.len() as u64 + 1, cells));
        }
    }
    Ok(Grid { units, ..Grid::named("Arrow".into(), names, rows) })
}

/// Refuses: built without Arrow.
#[cfg(not(feature = "arrow"))]
pub fn arrow(_: &[u8]) -> miette::Result<Grid> {
    Err(crate::built_without("arrow", "take CSV"))
}

/// Refuses: built without Parquet.
#[cfg(not(feature = "parquet"))]
pub fn parquet(_: &std::path::Path) -> miette::Result<Grid> {
    Err(crate::built_without("parquet", "take CSV"))
}

/// A NumPy array: two-dimensional, or of records with named fields (numpy/lib/format.py, versions 1 to 3).
///
/// # Errors
/// A header that cannot be read, other numbers than little-endian ones, other shapes.
pub fn npy(bytes: &[u8]) -> miette::Result<Grid> {
    let refuse = |what: &str| {
        miette::miette!(
            help = "save a table of numbers: numpy.savetxt, or a structured array of '<f8' fields",
            "the NumPy file: {what}"
        )
    };
    let short = || refuse("it is cut short");
    let (length, start): (_, usize) = match bytes.get(6).ok_or_else(short)? {
        1 => (bytes.get(8..10), 10),
        _ => (bytes.get(8..12), 12),
    };
    let length = length.ok_or_else(short)?.iter().rev().fold(0, |all, b| all << 8 | usize::from(*b));
    let header = bytes.get(start..start.saturating_add(length)).ok_or_else(short)?;
    let header = std::str::from_utf8(header).into_diagnostic()?;
    let data = &bytes[start + length..];
    let value = |key: &str| header.split_once(&format!("'{key}':")).map(|(_, rest)| rest.trim_start());
    let shape = value("shape").and_then(|v| v.strip_prefix('(')?.split(')').next());
    let shape = shape.ok_or_else(|| refuse("no shape"))?.split(',');
    let shape: Vec<usize> = shape.filter_map(|n| n.trim().parse().ok()).collect();
    let by_columns = value("fortran_order").is_some_and(|v| v.starts_with("True"));
    let descr = value("descr").ok_or_else(|| refuse("no type"))?;
    let quoted = |text: &'_ str| text.split('\'').skip(1).step_by(2).map(String::from).collect::<Vec<_>>();
    let kind = || quoted(descr).first().cloned().unwrap_or_default();
    let (names, kinds, rows) = match (descr.strip_prefix('['), &shape[..]) {
        (Some(fields), [rows]) => {
            let words = quoted(fields.split(']').next().unwrap_or_default());
            let (names, kinds) = words.chunks_exact(2).map(|p| (p[0].clone(), p[1].clone())).unzip();
            (names, kinds, *rows)
        }
        (None, [rows]) => (vec!["#1".to_string()], vec![kind()], *rows),
        // A number has a byte at least, so that a shape is no larger than its bytes.
        (None, [rows, columns]) if *rows > 0 && *columns > 0 && *columns <= data.len() => {
            ((1..=*columns).map(|k| format!("#{k}")).collect(), vec![kind(); *columns], *rows)
        }
        (None, [_, _]) => return Err(refuse("it is empty, or cut short")),
        _ => return Err(refuse("neither of one or two dimensions nor a list of records")),
    };
    let sizes = kinds.iter().map(|kind: &String| match kind.as_str() {
        "<f8" | "<i8" => Ok(8),
        "<f4" | "<i4" => Ok(4),
        other => Err(refuse(&format!("numbers of type '{other}'; '<f8', '<f4', '<i8' and '<i4' are read"))),
    });
    let sizes = sizes.collect::<miette::Result<Vec<usize>>>()?;
    let mut wide = 0;
    let offset = |size: &usize| {
        wide += size;
        wide - size
    };
    let offsets: Vec<usize> = sizes.iter().map(offset).collect();
    // Rows of no bytes could be any number.
    if wide == 0 || wide.checked_mul(rows) != Some(data.len()) {
        return Err(short());
    }
    let cell = |row: usize, column: usize| {
        let at = if by_columns { (column * rows + row) * sizes[0] } else { row * wide + offsets[column] };
        let (bytes, size) = (&data[at..], "as many bytes as its type has");
        match kinds[column].as_str() {
            "<f8" => Cell::number(f64::from_le_bytes(*bytes.first_chunk().expect(size))),
            "<i8" => Cell::Number(i64::from_le_bytes(*bytes.first_chunk().expect(size)) as f64),
            "<i4" => Cell::Number(i32::from_le_bytes(*bytes.first_chunk().expect(size)).into()),
            _ => Cell::single(f32::from_le_bytes(*bytes.first_chunk().expect(size))),
        }
    };
    let row = |r| Row::new(r as u64 + 1, (0..names.len()).map(|c| cell(r, c)).collect());
    let rows: Vec<Row> = (0..rows).map(row).collect();
    Ok(Grid::named("NumPy".into(), names, rows))
}

#[cfg(all(test, feature = "parquet"))]
mod tests;
