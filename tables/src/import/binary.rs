//! Tables of binary formats: workbooks, Parquet, NumPy.

use super::grid::{Cell, Grid, Row};
use miette::IntoDiagnostic;

/// Days, as workbooks count time, in s.
#[cfg(feature = "excel")]
const DAY_S: f64 = 86_400.0;

/// A sheet of a workbook: Excel or OpenDocument.
///
/// # Errors
/// A file that is none, a sheet that is not there, several sheets and none named.
#[cfg(feature = "excel")]
pub fn workbook(bytes: &[u8], sheet: Option<&str>) -> miette::Result<Grid> {
    use calamine::{Data, Reader};
    let mut book = calamine::open_workbook_auto_from_rs(std::io::Cursor::new(bytes)).into_diagnostic()?;
    let names = book.sheet_names();
    let named = match sheet {
        Some(name) => names.iter().find(|n| *n == name),
        None if names.len() == 1 => names.first(),
        None => {
            let mut filled = names
                .iter()
                .filter(|n| book.worksheet_range(n).is_ok_and(|r| !r.is_empty()))
                .collect::<Vec<_>>();
            if filled.len() == 1 { filled.pop() } else { None }
        }
    };
    let Some(name) = named.cloned() else {
        let listed = names.iter().map(|n| format!("'{n}'")).collect::<Vec<_>>().join(", ");
        match sheet {
            Some(sheet) => {
                miette::bail!(help = format!("its sheets: {listed}"), "the workbook has no sheet '{sheet}'")
            }
            None => miette::bail!(
                help = format!("name one with --sheet: {listed}"),
                "the workbook has several sheets"
            ),
        }
    };
    let range = book.worksheet_range(&name).into_diagnostic()?;
    let top = range.start().map_or(0, |(row, _)| u64::from(row));
    let cell = |data: &Data| match data {
        Data::Int(v) => Cell::Number(*v as f64),
        Data::Float(v) => Cell::Number(*v),
        Data::Bool(v) => Cell::Number(f64::from(u8::from(*v))),
        Data::DateTime(v) => Cell::Clock(v.as_f64() * DAY_S),
        Data::String(text) | Data::DateTimeIso(text) | Data::DurationIso(text) => Cell::of(text),
        Data::Error(error) => Cell::Text(format!("{error}")),
        Data::Empty => Cell::Empty,
    };
    let row =
        |(k, cells): (u64, &[Data])| Row { place: top + k + 1, cells: cells.iter().map(cell).collect() };
    let rows: Vec<Row> = (0..).zip(range.rows()).map(row).collect();
    // Numbers that were typed as text follow the mark of the country.
    let text_with_comma = |c: &Cell| matches!(c, Cell::Text(t) if t.contains(',') && !t.contains('.'));
    let comma = rows.iter().any(|r| {
        r.cells.iter().any(|c| {
            text_with_comma(c) && c.digits(true).is_some_and(|d| super::units::Unit::SI.apply(&d).is_some())
        })
    });
    Ok(Grid::find(format!("workbook, sheet '{name}'"), rows, comma, None))
}

/// Refuses: built without workbooks.
///
/// # Errors
/// Always.
#[cfg(not(feature = "excel"))]
pub fn workbook(_: &[u8], _: Option<&str>) -> miette::Result<Grid> {
    miette::bail!(
        help = "build it with `cargo install --path rig` (the feature is on by default), or save the sheet as CSV",
        "this muprime was built without its feature `excel`"
    )
}

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
    let names: Vec<String> = reader
        .metadata()
        .file_metadata()
        .schema_descr()
        .columns()
        .iter()
        .map(|c| c.name().to_string())
        .collect();
    let cell = |field: &Field| match field {
        Field::Null => Cell::Empty,
        Field::Double(v) if v.is_nan() => Cell::Empty,
        Field::Float(v) if v.is_nan() => Cell::Empty,
        Field::Double(v) => Cell::Number(*v),
        // The fewest digits of a single stand for what was meant.
        Field::Float(v) => Cell::of(&format!("{v:e}")),
        Field::TimestampMillis(v) => Cell::Clock(*v as f64 * 1e-3),
        Field::TimestampMicros(v) => Cell::Clock(*v as f64 * 1e-6),
        Field::Str(text) => Cell::of(text),
        other => Cell::of(&other.to_string()),
    };
    let mut rows = Vec::new();
    for (k, row) in (1..).zip(reader.get_row_iter(None).map_err(wrong)?) {
        rows.push(Row {
            place: k,
            cells: row.map_err(wrong)?.get_column_iter().map(|(_, f)| cell(f)).collect(),
        });
    }
    Ok(Grid::named("Parquet".into(), names, rows))
}

/// Refuses: built without Parquet.
///
/// # Errors
/// Always.
#[cfg(not(feature = "parquet"))]
pub fn parquet(_: &std::path::Path) -> miette::Result<Grid> {
    miette::bail!(
        help = "build it with `cargo install --path rig` (the feature is on by default), or take CSV",
        "this muprime was built without its feature `parquet`"
    )
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
    let (length, start) = match version {
        1 => (bytes.get(8..10).map(|b| usize::from(u16::from_le_bytes([b[0], b[1]]))), 10),
        _ => (bytes.get(8..12).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize), 12),
    };
    let length = length.ok_or_else(short)?;
    let header = bytes.get(start..start + length).ok_or_else(short)?;
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
        (None, [rows, columns]) => {
            let kind = quoted(descr).first().cloned().unwrap_or_default();
            ((1..=*columns).map(|k| format!("#{k}")).collect(), vec![kind; *columns], *rows)
        }
        _ => return Err(refuse("neither two-dimensional nor a list of records")),
    };
    let size = |kind: &str| match kind {
        "<f8" | "<i8" => Ok(8),
        "<f4" | "<i4" => Ok(4),
        other => Err(refuse(&format!("numbers of type '{other}'; '<f8', '<f4', '<i8' and '<i4' are read"))),
    };
    let sizes = kinds.iter().map(|k| size(k)).collect::<miette::Result<Vec<usize>>>()?;
    let wide: usize = sizes.iter().sum();
    if wide.checked_mul(rows) != Some(data.len()) {
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
    let row = |r| Row { place: r as u64 + 1, cells: (0..names.len()).map(|c| cell(r, c)).collect() };
    let rows: Vec<Row> = (0..rows).map(row).collect();
    Ok(Grid::named("NumPy".into(), names, rows))
}
