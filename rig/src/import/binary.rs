//! Tables of binary formats: workbooks, Parquet, NumPy.

use super::grid::{Cell, Grid, Row};
#[cfg(feature = "excel")]
use super::head::Source;
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
    use calamine::Reader;
    refuse_bombs(bytes)?;
    let mut book = calamine::open_workbook_auto_from_rs(std::io::Cursor::new(bytes)).into_diagnostic()?;
    let names = book.sheet_names();
    let named = match sheet {
        Some(name) => names.iter().find(|n| *n == name),
        None if names.len() == 1 => names.first(),
        None => {
            let mut filled = Vec::new();
            for name in &names {
                if sheet_rows(&mut book, name, bytes.len()).is_ok_and(|(rows, _)| !rows.is_empty()) {
                    filled.push(name);
                }
            }
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
    let (rows, formulas) = sheet_rows(&mut book, &name, bytes.len())?;
    // Numbers that were typed as text follow the mark of the country.
    let text_with_comma = |c: &Cell| matches!(c, Cell::Text(t) if t.contains(',') && !t.contains('.'));
    let comma = rows.iter().any(|r| {
        r.cells.iter().any(|c| {
            text_with_comma(c) && c.digits(true).is_some_and(|d| super::units::Unit::SI.apply(&d).is_some())
        })
    });
    let source = Source { format: format!("workbook, sheet '{name}'"), comma, places: true, ..Source::default() };
    let mut grid = source.find(rows);
    if formulas > 0 {
        grid.notes.push(format!(
            "{formulas} cells are formulas without a stored result: open the workbook in a spreadsheet program and save it there"
        ));
    }
    Ok(grid)
}

/// The rows of a sheet, from its first column that holds something, and how many cells are formulas without a result.
#[cfg(feature = "excel")]
fn sheet_rows(
    book: &mut calamine::Sheets<std::io::Cursor<&[u8]>>,
    name: &str,
    size: usize,
) -> miette::Result<(Vec<Row>, usize)> {
    use calamine::{Data, DataRef, Reader, Sheets};
    let cell = |data: Data| match data {
        Data::Int(v) => Cell::Number(v as f64),
        Data::Float(v) => Cell::Number(v),
        Data::Bool(v) => Cell::Number(f64::from(u8::from(v))),
        Data::DateTime(v) => Cell::Clock(v.as_f64() * DAY_S),
        Data::String(text) | Data::DateTimeIso(text) | Data::DurationIso(text) => Cell::of(&text),
        Data::Error(error) => Cell::Text(format!("{error}")),
        Data::Empty => Cell::Empty,
    };
    let mut sheet = Sheet { rows: Vec::new(), cells: 0, size };
    let mut formulas = 0;
    match book {
        Sheets::Xlsx(book) => {
            let mut reader = book.worksheet_cells_reader(name).into_diagnostic()?;
            let percent: Vec<bool> = (reader.styles().iter())
                .map(|s| s.number_format.as_ref().is_some_and(|f| f.format_code.contains('%')))
                .collect();
            while let Some((one, style)) = reader.next_cell_with_style_id().into_diagnostic()? {
                let value = match cell(Data::from(one.get_value().clone())) {
                    Cell::Number(v) if percent.get(style) == Some(&true) => Cell::Percent(v),
                    value => value,
                };
                sheet.put(one.get_position(), value)?;
            }
            drop(reader);
            let mut reader = book.worksheet_cells_reader(name).into_diagnostic()?;
            while let Some(one) = reader.next_cell_with_formula().into_diagnostic()? {
                if let (DataRef::Empty, Some(formula)) = (&one.value, &one.formula) {
                    formulas += 1;
                    sheet.put(one.pos, Cell::Text(format!("={formula}")))?;
                }
            }
        }
        Sheets::Xlsb(book) => {
            let mut reader = book.worksheet_cells_reader(name).into_diagnostic()?;
            while let Some(one) = reader.next_cell().into_diagnostic()? {
                sheet.put(one.get_position(), cell(Data::from(one.get_value().clone())))?;
            }
        }
        Sheets::Xls(_) | Sheets::Ods(_) => {
            let range = book.worksheet_range(name).into_diagnostic()?;
            let (top, left) = range.start().unwrap_or_default();
            for (row, column, value) in range.used_cells() {
                sheet.put((top + row as u32, left + column as u32), cell(value.clone()))?;
            }
        }
    }
    sheet.rows.sort_by_key(|row| row.place);
    let blank = |row: &Row| row.cells.iter().position(|c| *c != Cell::Empty);
    let left = sheet.rows.iter().filter_map(blank).min().unwrap_or(0);
    sheet.rows.iter_mut().for_each(|row| drop(row.cells.drain(..left.min(row.cells.len()))));
    Ok((sheet.rows, formulas))
}

/// A sheet while its cells come.
#[cfg(feature = "excel")]
struct Sheet {
    rows: Vec<Row>,
    cells: usize,
    /// Bytes of the file.
    size: usize,
}

#[cfg(feature = "excel")]
impl Sheet {
    /// Takes a cell where it belongs; refuses cells so far apart that almost all between them are empty.
    fn put(&mut self, (row, column): (u32, u32), cell: Cell) -> miette::Result<()> {
        if cell == Cell::Empty {
            return Ok(());
        }
        let (place, column) = (u64::from(row) + 1, column as usize);
        let at = match self.rows.last() {
            Some(last) if last.place == place => self.rows.len() - 1,
            Some(last) if last.place > place => match self.rows.binary_search_by_key(&place, |r| r.place) {
                Ok(at) => at,
                Err(at) => {
                    self.rows.insert(at, Row::new(place, Vec::new()));
                    at
                }
            },
            _ => {
                self.rows.push(Row::new(place, Vec::new()));
                self.rows.len() - 1
            }
        };
        let cells = &mut self.rows[at].cells;
        self.cells += (column + 1).saturating_sub(cells.len());
        if self.cells > super::most_cells(self.size) / 4 {
            return Err(super::too_many("the sheet", self.cells, self.size));
        }
        if cells.len() <= column {
            cells.resize(column + 1, Cell::Empty);
        }
        cells[column] = cell;
        Ok(())
    }
}

/// Refuses a packed workbook that unfolds to far more than it is, before its reader takes memory for that.
#[cfg(feature = "excel")]
fn refuse_bombs(bytes: &[u8]) -> miette::Result<()> {
    use std::io::Read;
    let number = |at: usize, n: usize| -> Option<usize> {
        Some(bytes.get(at..at + n)?.iter().rev().fold(0, |all, b| all << 8 | usize::from(*b)))
    };
    let mut left = 48 * bytes.len() + (16 << 20);
    // The directory stands at the end (PKWARE, APPNOTE 4.3.12): each entry names where its data begin.
    let from = bytes.len().saturating_sub(65_557);
    let Some(end) = bytes[from..].windows(4).rposition(|w| w == b"PK\x05\x06").map(|at| from + at) else { return Ok(()) };
    let mut at = number(end + 16, 4).unwrap_or(0);
    let mut buffer = vec![0; 1 << 16];
    while bytes.get(at..).is_some_and(|rest| rest.starts_with(b"PK\x01\x02")) {
        let (Some(method), Some(packed), Some(local)) = (number(at + 10, 2), number(at + 20, 4), number(at + 42, 4)) else {
            break;
        };
        let start = local + 30 + number(local + 26, 2).unwrap_or(0) + number(local + 28, 2).unwrap_or(0);
        if method == 8 {
            let data = bytes.get(start..).unwrap_or_default();
            let mut unfolded = flate2::read::DeflateDecoder::new(&data[..packed.min(data.len())]);
            let mut repeated = Repeats::default();
            while let Ok(n) = unfolded.read(&mut buffer) {
                if n == 0 {
                    break;
                }
                repeated.look(&buffer[..n]);
                left = left.saturating_sub(n);
                if left == 0 || repeated.cells > super::most_cells(bytes.len()) {
                    miette::bail!(
                        help = "save the sheet as CSV",
                        "the workbook unfolds to far more than its {} bytes: it is damaged, or almost all of it is empty",
                        bytes.len()
                    );
                }
            }
        }
        let lengths = [28, 30, 32].map(|k| number(at + k, 2).unwrap_or(0));
        at += 46 + lengths.iter().sum::<usize>();
    }
    Ok(())
}

/// Cells that an OpenDocument sheet stands for by repeating few.
#[cfg(feature = "excel")]
#[derive(Default)]
struct Repeats {
    /// What was read and does not end with a whole tag.
    rest: Vec<u8>,
    /// How often the row that is open is repeated, its cells up to the last that holds something, and those behind.
    row: (usize, usize, usize),
    /// Cells so far.
    cells: usize,
}

#[cfg(feature = "excel")]
impl Repeats {
    fn look(&mut self, bytes: &[u8]) {
        self.rest.extend_from_slice(bytes);
        let whole = self.rest.iter().rposition(|b| *b == b'>').map_or(0, |at| at + 1);
        let text: Vec<u8> = self.rest.drain(..whole).collect();
        // What is one tag of more than this is no tag.
        if self.rest.len() > 1 << 16 {
            self.rest.clear();
        }
        let text = String::from_utf8_lossy(&text);
        for tag in text.split('<').filter(|t| t.starts_with("table:table-")) {
            let times = |name: &str| {
                let value = tag.split_once(name)?.1.split_once('"')?.1;
                value.split('"').next()?.parse::<usize>().ok()
            };
            if tag.starts_with("table:table-row") {
                self.row = (times("number-rows-repeated").unwrap_or(1), 0, 0);
            } else if tag.starts_with("table:table-cell") {
                let count = times("number-columns-repeated").unwrap_or(1);
                let (rows, filled, empty) = self.row;
                if tag.contains("office:") {
                    let more = empty.saturating_add(count);
                    self.row = (rows, filled.saturating_add(more), 0);
                    self.cells = self.cells.saturating_add(rows.saturating_mul(more));
                } else {
                    self.row.2 = empty.saturating_add(count);
                }
            }
        }
    }
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
    let units = schema.map(|s| s.fields().iter().map(|f| unit(f.metadata())).collect()).unwrap_or_default();
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
        Field::Group(_) | Field::ListInternal(_) | Field::MapInternal(_) => Cell::Text("(nested)".into()),
        other => Cell::of(&other.to_string()),
    };
    let mut rows = Vec::new();
    for (k, row) in (1..).zip(reader.get_row_iter(None).map_err(wrong)?) {
        let cells = row.map_err(wrong)?.get_column_iter().map(|(_, f)| cell(f)).collect();
        rows.push(Row::new(k, cells));
    }
    Ok(Grid { units, ..Grid::named("Parquet".into(), names, rows) })
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
        Float32Type, Float64Type, Int8Type, Int16Type, Int32Type, Int64Type, UInt8Type, UInt16Type, UInt32Type, UInt64Type,
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
///
/// # Errors
/// Always.
#[cfg(not(feature = "arrow"))]
pub fn arrow(_: &[u8]) -> miette::Result<Grid> {
    miette::bail!(
        help = "build it with `cargo install --path rig` (the feature is on by default), or take CSV",
        "this muprime was built without its feature `arrow`"
    )
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
        (None, [rows]) => (vec!["#1".to_string()], vec![quoted(descr).first().cloned().unwrap_or_default()], *rows),
        // A number has a byte at least, so that a shape is no larger than its bytes.
        (None, [rows, columns]) if *rows > 0 && *columns <= data.len() => {
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
    let row = |r| Row::new(r as u64 + 1, (0..names.len()).map(|c| cell(r, c)).collect());
    let rows: Vec<Row> = (0..rows).map(row).collect();
    Ok(Grid::named("NumPy".into(), names, rows))
}
