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
        Field::Long(v) if ticks.get(k).is_some_and(Option::is_some) => {
            ticks[k].as_ref().map_or(Cell::Empty, |ticks| ticks.cell(*v))
        }
        Field::Null => Cell::Empty,
        Field::Double(v) if v.is_nan() => Cell::Empty,
        Field::Float(v) if v.is_nan() => Cell::Empty,
        Field::Double(v) => Cell::Number(*v),
        // The fewest digits of a single stand for what was meant.
        Field::Float(v) => Cell::of(&format!("{v:e}")),
        Field::TimestampMillis(v) => Cell::Clock(*v as f64 * 1e-3),
        Field::TimestampMicros(v) => Cell::Clock(*v as f64 * 1e-6),
        Field::Str(text) => Cell::of(text),
        Field::Group(_) | Field::ListInternal(_) | Field::MapInternal(_) => Cell::Text("(nested)".into()),
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
    use arrow_array::types::{
        Float32Type, Float64Type, Int8Type, Int16Type, Int32Type, Int64Type, UInt8Type, UInt16Type,
        UInt32Type, UInt64Type,
    };
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
        macro_rules! number {
            ($type:ty) => {
                match column.as_primitive::<$type>().value(k) as f64 {
                    v if v.is_nan() => Cell::Empty,
                    v => Cell::Number(v),
                }
            };
        }
        if column.is_null(k) {
            return Cell::Empty;
        }
        match column.data_type() {
            DataType::Float64 => number!(Float64Type),
            DataType::Float32 => Cell::of(&format!("{:e}", column.as_primitive::<Float32Type>().value(k))),
            DataType::Int8 => number!(Int8Type),
            DataType::Int16 => number!(Int16Type),
            DataType::Int32 => number!(Int32Type),
            DataType::Int64 => number!(Int64Type),
            DataType::UInt8 => number!(UInt8Type),
            DataType::UInt16 => number!(UInt16Type),
            DataType::UInt32 => number!(UInt32Type),
            DataType::UInt64 => number!(UInt64Type),
            DataType::Utf8 => Cell::of(column.as_string::<i32>().value(k)),
            DataType::LargeUtf8 => Cell::of(column.as_string::<i64>().value(k)),
            other => Cell::Text(format!("({other})")),
        }
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
    let version = *bytes.get(6).ok_or_else(short)?;
    let (length, start): (_, usize) = match version {
        1 => (bytes.get(8..10).map(|b| usize::from(u16::from_le_bytes([b[0], b[1]]))), 10),
        _ => (bytes.get(8..12).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize), 12),
    };
    let length = length.ok_or_else(short)?;
    let header = bytes.get(start..start.saturating_add(length)).ok_or_else(short)?;
    let header = std::str::from_utf8(header).into_diagnostic()?;
    let data = &bytes[start + length..];
    let value = |key: &str| header.split_once(&format!("'{key}':")).map(|(_, rest)| rest.trim_start());
    let shape = value("shape")
        .and_then(|v| v.strip_prefix('(')?.split(')').next())
        .ok_or_else(|| refuse("no shape"))?;
    let shape: Vec<usize> = shape.split(',').filter_map(|n| n.trim().parse().ok()).collect();
    let by_columns = value("fortran_order").is_some_and(|v| v.starts_with("True"));
    let descr = value("descr").ok_or_else(|| refuse("no type"))?;
    let quoted =
        |text: &str| -> Vec<String> { text.split('\'').skip(1).step_by(2).map(String::from).collect() };
    let (names, kinds, rows) = match (descr.strip_prefix('['), &shape[..]) {
        (Some(fields), [rows]) => {
            let words = quoted(fields.split(']').next().unwrap_or_default());
            let (names, kinds): (Vec<_>, Vec<_>) =
                words.chunks_exact(2).map(|p| (p[0].clone(), p[1].clone())).unzip();
            (names, kinds, *rows)
        }
        (None, [rows]) => {
            (vec!["#1".to_string()], vec![quoted(descr).first().cloned().unwrap_or_default()], *rows)
        }
        // A number has a byte at least, so that a shape is no larger than its bytes.
        (None, [rows, columns]) if *rows > 0 && *columns > 0 && *columns <= data.len() => {
            let kind = quoted(descr).first().cloned().unwrap_or_default();
            ((1..=*columns).map(|k| format!("#{k}")).collect(), vec![kind; *columns], *rows)
        }
        (None, [_, _]) => return Err(refuse("it is empty, or cut short")),
        _ => return Err(refuse("neither of one or two dimensions nor a list of records")),
    };
    let size = |kind: &str| match kind {
        "<f8" | "<i8" => Ok(8),
        "<f4" | "<i4" => Ok(4),
        other => Err(refuse(&format!("numbers of type '{other}'; '<f8', '<f4', '<i8' and '<i4' are read"))),
    };
    let sizes = kinds.iter().map(|k| size(k)).collect::<miette::Result<Vec<usize>>>()?;
    let wide: usize = sizes.iter().sum();
    // Rows of no bytes could be any number.
    if wide == 0 || wide.checked_mul(rows) != Some(data.len()) {
        return Err(short());
    }
    let offsets: Vec<usize> = sizes
        .iter()
        .scan(0, |at, s| {
            *at += s;
            Some(*at - s)
        })
        .collect();
    let cell = |row: usize, column: usize| {
        let at = if by_columns { (column * rows + row) * sizes[0] } else { row * wide + offsets[column] };
        let b = &data[at..at + sizes[column]];
        let eight = || [b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]];
        match kinds[column].as_str() {
            "<f8" => Cell::Number(f64::from_le_bytes(eight())),
            "<i8" => Cell::Number(i64::from_le_bytes(eight()) as f64),
            "<i4" => Cell::Number(f64::from(i32::from_le_bytes([b[0], b[1], b[2], b[3]]))),
            _ => Cell::of(&format!("{:e}", f32::from_le_bytes([b[0], b[1], b[2], b[3]]))),
        }
    };
    let cell = |row, column| match cell(row, column) {
        Cell::Number(v) if v.is_nan() => Cell::Empty,
        cell => cell,
    };
    let row = |r| Row::new(r as u64 + 1, (0..names.len()).map(|c| cell(r, c)).collect());
    let rows: Vec<Row> = (0..rows).map(row).collect();
    Ok(Grid::named("NumPy".into(), names, rows))
}

#[cfg(all(test, feature = "parquet"))]
mod tests {
    use super::*;
    use arrow_array::{ArrayRef, DurationNanosecondArray, Int64Array, RecordBatch, TimestampNanosecondArray};
    use std::sync::Arc;

    #[test]
    fn times_of_parquet_have_the_unit_of_their_type() {
        let columns: [(&str, ArrayRef); 3] = [
            ("at", Arc::new(TimestampNanosecondArray::from(vec![1_700_000_000_500_000_000]))),
            ("span", Arc::new(DurationNanosecondArray::from(vec![2_500_000_001]))),
            ("n", Arc::new(Int64Array::from(vec![7]))),
        ];
        let batch = RecordBatch::try_from_iter(columns).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.parquet");
        let file = std::fs::File::create(&path).unwrap();
        let mut writer = ::parquet::arrow::ArrowWriter::try_new(file, batch.schema(), None).unwrap();
        writer.write(&batch).unwrap();
        writer.close().unwrap();
        let grid = super::parquet(&path).unwrap();
        assert_eq!(grid.rows[0].cells[0], Cell::Clock(1_700_000_000.5));
        assert_eq!(grid.rows[0].cells[1].digits(false).as_deref(), Some("2500000001e-9"));
        assert_eq!(grid.units, ["", "s", ""]);
        assert_eq!(grid.rows[0].cells[2].shown(), "7");
    }
}
