//! Foreign tables made into point tables. Their contents are detected or stated, every number is converted to
//! SI once, and every repair, omission and assumption is reported.

#[cfg(feature = "matlab")]
mod arrays;
mod binary;
mod clock;
mod grid;
pub mod guess;
#[cfg(feature = "matlab")]
mod hdf5;
mod head;
pub mod map;
#[cfg(feature = "matlab")]
mod mat;
pub(crate) mod remarks;
mod series;
pub mod targets;
mod text;
mod units;
mod values;
#[cfg(feature = "excel")]
mod workbook;
mod write;

use calibration::certificate::sha256_hex;
use map::Map;
use miette::{IntoDiagnostic, WrapErr};
use models::pass::{Pass, read_passes};
use serde::Serialize;
use series::Spread;
use std::path::Path;
use targets::{ColumnKind, Id, TARGETS};
use values::{Dropped, Values};

pub use grid::Grid;
pub use remarks::{Range, of_table as remarks_of};
pub use series::{Counts, Cut};
pub use text::Marks;

/// Refuses: built without MAT and HDF5.
#[cfg(not(feature = "matlab"))]
mod mat {
    /// Refuses.
    pub fn read(_: &[u8], _: Option<&str>, _: &[String]) -> miette::Result<super::Grid> {
        Err(crate::built_without("matlab", "take CSV"))
    }
}
#[cfg(not(feature = "matlab"))]
use mat as hdf5;

/// Refuses: built without workbooks.
#[cfg(not(feature = "excel"))]
mod workbook {
    /// Refuses.
    pub fn read(_: &[u8], _: Option<&str>) -> miette::Result<super::Grid> {
        Err(crate::built_without("excel", "save the sheet as CSV"))
    }
}

/// How a column was taken.
#[derive(Clone, Debug, Serialize)]
pub struct MappedColumn {
    /// Column of the source.
    pub from: String,
    /// Column of the point table.
    pub column: &'static str,
    /// What it was taken for.
    pub target: &'static str,
    /// Its unit.
    pub unit: String,
    /// `SI = number * factor + offset`; powers of ten move the decimal point.
    pub factor: f64,
    /// Added after the factor.
    pub offset: f64,
}

/// The log of an import, `import.json`.
#[derive(Clone, Debug, Serialize)]
pub struct Log {
    /// `muprime.import/1`.
    pub schema: &'static str,
    /// Version of the program.
    pub version: &'static str,
    /// The file that was read.
    pub source: String,
    /// Its SHA-256.
    pub sha256: String,
    /// Its format, in words.
    pub format: String,
    /// Columns that were taken.
    pub map: Vec<MappedColumn>,
    /// The same as `--map` takes it.
    pub map_argument: String,
    /// Columns of the source that were not taken.
    pub not_taken: Vec<String>,
    /// Constants, as `--set` had them.
    pub set: Vec<String>,
    /// What was passed over or assumed.
    pub notes: Vec<String>,
    /// What was assumed in rig.toml.
    pub assumed: Vec<String>,
    /// Rows of data in the source.
    pub rows: usize,
    /// Passes in the table.
    pub passes: usize,
    /// Rows that were left out, each with its reason.
    pub dropped: Vec<Dropped>,
    /// How a series was cut.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub series: Option<SeriesLog>,
    /// Ranges in SI.
    pub ranges: Vec<Range>,
    /// What looks wrong.
    pub remarks: Vec<String>,
}

/// How a series was cut, and what became of its samples.
#[derive(Clone, Debug, Serialize)]
pub struct SeriesLog {
    /// The requested cut.
    pub cut: Cut,
    /// The counts of its samples.
    #[serde(flatten)]
    pub counts: Counts,
}

/// What an import makes.
#[derive(Clone, Debug)]
pub struct Imported {
    /// points.csv.
    pub table: String,
    /// rig.toml.
    pub rig: String,
    /// import.json.
    pub log: Log,
}

/// What is wanted of a source.
#[derive(Clone, Debug, Default)]
pub struct Wanted<'a> {
    /// What is taken from where.
    pub map: Map,
    /// As `--set` had it, for the log.
    pub set: Vec<String>,
    /// Present: the source is a time series.
    pub series: Option<Cut>,
    /// The text of a rig.toml that is known.
    pub rig: Option<String>,
    /// A fingertip of the library.
    pub tip: Option<&'a str>,
    /// Rows of zeros at the end are room that a record did not fill.
    pub padding: bool,
    /// A time that goes back is right: rows are sorted otherwise.
    pub unsorted: bool,
}

/// A Parquet point table as CSV text: one reader judges both formats.
///
/// # Errors
/// A file that is not Parquet table.
pub fn parquet_as_csv(path: &Path) -> miette::Result<String> {
    let grid = unharmed(|| binary::parquet(path));
    grid.unwrap_or_else(|| {
        Err(miette::miette!(help = "export it again, or as CSV", "{}: the file is damaged", path.display()))
    })?
    .csv()
}

/// Cells that a source of so many bytes can hold in earnest: what says more is damaged or hostile, and is
/// refused before memory is taken for it.
#[cfg(any(feature = "arrow", feature = "excel", feature = "matlab", feature = "parquet"))]
pub(crate) const fn most_cells(bytes: usize) -> usize {
    4 * bytes + 1_000_000
}

/// The refusal of a source that says more than [`most_cells`].
#[cfg(any(feature = "arrow", feature = "excel", feature = "matlab", feature = "parquet"))]
pub(crate) fn too_many(what: &str, cells: usize, bytes: usize) -> miette::Report {
    miette::miette!(
        help = "export the part that holds numbers, as CSV",
        "{what} says that it has {cells} cells, in {bytes} bytes: it is damaged, or almost all of it is empty"
    )
}

/// Reads a source of any known format; `wanted` are the columns that will be taken, where they are known.
///
/// # Errors
/// A format that is not read, with the remedy; what its reader says.
pub fn read(
    path: &Path,
    bytes: &[u8],
    sheet: Option<&str>,
    marks: Marks,
    wanted: &[String],
) -> miette::Result<Grid> {
    let shown = path.display();
    // Damaged files can drive the libraries that read binary formats into a panic: that is a refusal of the file.
    let grid = unharmed(|| read_known(path, bytes, sheet, marks, wanted))
        .unwrap_or_else(|| Err(miette::miette!(help = "export it again, or as CSV", "the file is damaged")));
    let grid = grid.wrap_err_with(|| shown.to_string())?;
    if grid.rows.is_empty() {
        let notes = grid.notes.join("\n");
        miette::bail!(help = head::NO_ROWS_HELP, "{shown}: no rows of numbers\n{notes}");
    }
    Ok(grid)
}

thread_local! {
    /// Whether this thread reads a foreign file.
    static READS: std::cell::Cell<bool> = const { std::cell::Cell::new(false) };
}

/// Runs a library's reader; `None` where it panics, of which nothing is printed: the refusal of the file says what is to be known.
fn unharmed<T>(reads: impl FnOnce() -> T) -> Option<T> {
    static QUIET: std::sync::Once = std::sync::Once::new();
    QUIET.call_once(|| {
        let usual = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            if !READS.get() {
                usual(panic);
            }
        }));
    });
    READS.set(true);
    let read = std::panic::catch_unwind(std::panic::AssertUnwindSafe(reads));
    READS.set(false);
    read.ok()
}

fn read_known(
    path: &Path,
    bytes: &[u8],
    sheet: Option<&str>,
    marks: Marks,
    wanted: &[String],
) -> miette::Result<Grid> {
    let shown = path.display();
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
    let workbook = ["xlsx", "xlsm", "xlsb", "xls", "ods"].contains(&ending.as_str());
    if bytes.starts_with(b"PAR1") {
        binary::parquet(path)
    } else if bytes.starts_with(b"ARROW1") {
        binary::arrow(bytes)
    } else if bytes.starts_with(b"\x93NUMPY") {
        binary::npy(bytes)
    } else if bytes.starts_with(b"MATLAB 5.0 MAT-file") {
        mat::read(bytes, sheet, wanted)
    } else if bytes.starts_with(b"\x89HDF\r\n") || bytes.starts_with(b"MATLAB 7.3 MAT-file") {
        hdf5::read(bytes, sheet, wanted)
    } else if workbook || bytes.starts_with(b"\xd0\xcf\x11\xe0") {
        workbook::read(bytes, sheet)
    } else if bytes.starts_with(b"PK\x03\x04") || bytes.starts_with(b"\x1f\x8b") {
        miette::bail!(help = "unpack it first; of .npz, save one array as .npy", "{shown} is packed")
    } else {
        text::read(bytes, marks)
    }
}

/// Makes a point table of a source.
///
/// # Errors
/// Columns that are missing or given twice, all at once; fewer than half of the rows that can be taken; a
/// series without steady stretches. Nothing is written.
pub fn import(source: &str, bytes: &[u8], grid: &Grid, wanted: &Wanted<'_>) -> miette::Result<Imported> {
    let map = &wanted.map;
    let not_taken: Vec<String> = (0..grid.header.len())
        .filter(|k| !map.columns.iter().any(|c| c.index == *k))
        .map(|k| grid.header[k].clone())
        .collect();
    refuse_lacks(source, grid, wanted, &not_taken)?;
    let mut notes = grid.notes.clone();
    let maps = maps(source, grid, map, &mut notes)?;
    let clocks = match map.columns.iter().find(|c| c.target == Id::Time as usize) {
        Some(column) => {
            let (times, remarks) = clock::times(grid, column.index, &column.unit_text)
                .map_err(|e| miette::miette!("{source}: {e}"))?;
            notes.extend(remarks);
            times
        }
        None => Vec::new(),
    };
    if map.time_by_rows {
        notes.push("time_s is the number of the row, a second each".into());
    }
    let full = grid.rows.iter().rposition(|r| !is_padding(r)).map_or(0, |k| k + 1);
    let padded = grid.rows.len() - full;
    let room_from = if wanted.padding { full } else { grid.rows.len() };
    let (mut values, mut dropped) = rows(grid, &maps, &clocks, room_from);
    let is_row = |d: &&Dropped| d.reason != PADDING && d.reason != head::ONE_TEXT;
    let mut of = (values.len() + dropped.iter().filter(is_row).count(), "rows");
    let mut series = None;
    let mut spreads = Vec::new();
    if let Some(cut) = wanted.series {
        if 2 * values.len() < of.0 {
            return Err(mostly_dropped(source, grid, wanted, &dropped, (values.len(), of), padded));
        }
        let unusable = series::unusable(&mut values);
        dropped.extend(unusable);
        let (passes, of_each, counts) =
            series::cut(&values, &cut).map_err(|e| miette::miette!("{source}: {e}"))?;
        (values, spreads) = (passes, of_each);
        of = (values.len(), "steady stretches");
        series = Some(SeriesLog { cut, counts });
    }
    let (passes, taken) = passes(&values, &spreads, &mut dropped);
    dropped.sort_by_key(|d| d.row);
    if 2 * passes.len() < of.0 || passes.is_empty() {
        return Err(mostly_dropped(source, grid, wanted, &dropped, (passes.len(), of), padded));
    }
    if series.is_none() {
        let back = clock::order(&taken, wanted.unsorted).map_err(|e| {
            miette::miette!(
                help = "if that column restarts with each step, map the column that numbers the steps (HEADER=run), or import each step \
                        by itself; if the rows are sorted otherwise and the times are those of one clock: --accept unsorted",
                "{source}: {e}{}",
                grid.notes.iter().filter(|n| n.contains("header again")).map(|n| format!("\n{n}")).collect::<String>()
            )
        })?;
        notes.extend(back);
    }
    let columns = write::columns(map, series.is_some());
    let table = written(&passes, &columns, map.has(Id::Frequency))?;
    let (rig, assumed) = match &wanted.rig {
        Some(text) => (text.clone(), Vec::new()),
        None => write::rig(&passes, source, wanted.tip)?,
    };
    let mapped = |c: &map::Taken| MappedColumn {
        from: c.header.clone(),
        column: TARGETS[c.target].column,
        target: TARGETS[c.target].name,
        unit: c.unit_text.clone(),
        factor: c.unit.factor(),
        offset: c.unit.offset(),
    };
    let log = Log {
        schema: "muprime.import/1",
        version: env!("CARGO_PKG_VERSION"),
        source: source.into(),
        sha256: sha256_hex(bytes),
        format: grid.format.clone(),
        map: map.columns.iter().map(mapped).collect(),
        map_argument: map.written(),
        not_taken,
        set: wanted.set.clone(),
        notes,
        assumed,
        rows: grid.rows.len(),
        passes: passes.len(),
        series,
        ranges: remarks::ranges(&passes, &columns),
        remarks: [map::contradicted(map, grid), remarks::remarks(&passes, &columns)].concat(),
        dropped,
    };
    Ok(Imported { table, rig, log })
}

/// Refuses a map that lacks columns, all at once.
fn refuse_lacks(source: &str, grid: &Grid, wanted: &Wanted<'_>, not_taken: &[String]) -> miette::Result<()> {
    let (twice, lacks) = (wanted.map.twice(), wanted.map.lacks(grid, wanted.series.is_some()));
    let all = [&twice[..], &lacks[..]].concat().join("\n");
    if lacks.is_empty() {
        return if twice.is_empty() { Ok(()) } else { Err(miette::miette!(help = map::ONCE, "{all}")) };
    }
    let left = if not_taken.is_empty() {
        String::new()
    } else {
        format!("\ncolumns of {source} that are not taken: {}", not_taken.join(", "))
    };
    let across = across(grid).unwrap_or_default();
    let once = if twice.is_empty() { String::new() } else { format!("\n{}", map::ONCE) };
    miette::bail!(help = format!("state what is missing with --map and --set{once}{left}{across}"), "{all}");
}

/// The map of each block of the source; none of a block that is another table.
fn maps(source: &str, grid: &Grid, map: &Map, notes: &mut Vec<String>) -> miette::Result<Vec<Option<Map>>> {
    let mut maps = vec![Some(map.clone())];
    for block in &grid.blocks {
        let under = map::under(map, grid, block).map_err(|e| {
            miette::miette!(help = "make a file of each part, or give them the same columns", "{source}: {e}")
        })?;
        if under.is_none() {
            notes.push(format!("row {} heads another table: its rows were not taken", block.place));
        }
        maps.push(under);
    }
    Ok(maps)
}

/// Why a row of padding is left out.
const PADDING: &str = "zeros at the end: room that was not filled";

/// The values of the rows, and the rows that are left out. Those from number `room_from` on are padding.
fn rows(
    grid: &Grid,
    maps: &[Option<Map>],
    clocks: &[Option<f64>],
    room_from: usize,
) -> (Vec<Values>, Vec<Dropped>) {
    let left_out = |(row, text, reason): &(u64, String, String)| Dropped {
        row: *row,
        column: String::new(),
        text: text.clone(),
        reason: reason.clone(),
    };
    let mut dropped: Vec<Dropped> = grid.left_out.iter().map(left_out).collect();
    let mut values = Vec::new();
    for (number, row) in grid.rows.iter().enumerate() {
        let Some(map) = &maps[row.block] else { continue };
        if number >= room_from {
            dropped.push(left_out(&(row.place, "0".into(), PADDING.into())));
            continue;
        }
        match Values::read(grid, map, row, number, clocks.get(number).copied().flatten()) {
            Ok(v) => values.push(v),
            Err(why) => dropped.push(why),
        }
    }
    (values, dropped)
}

/// The passes, and the values of each; a series has the spread of each as well.
fn passes<'a>(
    values: &'a [Values],
    spreads: &[Spread],
    dropped: &mut Vec<Dropped>,
) -> (Vec<Pass>, Vec<&'a Values>) {
    let (mut passes, mut taken) = (Vec::new(), Vec::new());
    for (k, value) in values.iter().enumerate() {
        match value.pass(k as u64 + 1) {
            Ok(mut pass) => {
                if let Some(spread) = spreads.get(k) {
                    spread.put(&mut pass);
                }
                passes.push(pass);
                taken.push(value);
            }
            Err(why) => dropped.push(why),
        }
    }
    (passes, taken)
}

/// The table as CSV. What is written must be what was meant: it is read back as a diagnosis would.
fn written(passes: &[Pass], columns: &[&'static str], states_frequency: bool) -> miette::Result<String> {
    let table = write::table(passes, columns)?;
    let mut back = read_passes(table.as_bytes()).into_diagnostic().wrap_err("the table that was made")?;
    if !states_frequency {
        back.iter_mut().zip(passes).for_each(|(b, p)| b.frequency_hz = p.frequency_hz);
    }
    if back != passes {
        miette::bail!(
            "the table that was made does not read back as it was written: please report this file"
        );
    }
    Ok(table)
}

/// Whether a row holds nothing but zeros.
fn is_padding(row: &grid::Row) -> bool {
    row.cells.iter().all(|c| {
        matches!(c, grid::Cell::Empty) || c.digits(false).is_some_and(|d| d.parse::<f64>() == Ok(0.0))
    })
}

/// Columns whose names are values with a unit, as of a table with a factor down and another across.
fn across(grid: &Grid) -> Option<String> {
    let value = |name: &&String| {
        let digits = name.bytes().take_while(|b| b.is_ascii_digit() || b".,".contains(b)).count();
        digits > 0 && (units::is_unit(&name[digits..]) || digits == name.len())
    };
    let values: Vec<&str> = grid.header.iter().filter(value).map(String::as_str).collect();
    (values.len() > 1).then(|| {
        format!(
            "\nthe names {} are values: one row a pass is needed, with that value in a column of its own (in Python: pandas.melt; in R: \
             tidyr::pivot_longer)",
            values.join(", ")
        )
    })
}

/// The refusal of a table of which less than half can be taken: that is a wrong map, not a few bad rows.
fn mostly_dropped(
    source: &str,
    grid: &Grid,
    wanted: &Wanted<'_>,
    dropped: &[Dropped],
    (taken, (all, what)): (usize, (usize, &str)),
    padded: usize,
) -> miette::Report {
    let mut reasons: Vec<(String, usize, &Dropped)> = Vec::new();
    for d in dropped {
        let what = format!("{}: {}", d.column, d.reason);
        match reasons.iter_mut().find(|(w, ..)| *w == what) {
            Some((_, n, _)) => *n += 1,
            None => reasons.push((what, 1, d)),
        }
    }
    reasons.sort_by_key(|(_, n, _)| std::cmp::Reverse(*n));
    let mut list: Vec<String> = reasons
        .iter()
        .take(4)
        .map(|(what, n, first)| format!("{n} rows: {what} (first in row {}: '{}')", first.row, first.text))
        .collect();
    list.extend(map::contradicted(&wanted.map, grid));
    let help = remedy(grid, dropped, reasons.first().map(|(.., first)| *first), padded);
    miette::miette!(help = help, "{source}: {taken} of {all} {what} can be taken\n{}", list.join("\n"))
}

/// What cures most of the rows that are left out; `worst` is the first of the most frequent kind.
fn remedy(grid: &Grid, dropped: &[Dropped], worst: Option<&Dropped>, padded: usize) -> String {
    let negative = dropped.iter().filter(|d| d.column == "normal_force_n" && d.text.starts_with('-')).count();
    let (text, reason) = worst.map_or(("", ""), |d| (&d.text, &d.reason));
    if 2 * negative > dropped.len() {
        "compression is positive: turn the column with a minus before its unit, as in normal_force:-N"
            .to_string()
    } else if 2 * padded > dropped.len() {
        format!("the last {padded} rows are zeros in every column: --accept padding leaves them out")
    } else if reason == values::NO_NUMBER && text.chars().all(|c| "+-0123456789., '\u{a0}".contains(c)) {
        "export the table without thousands separators and with one decimal mark; --decimal states the mark"
            .to_string()
    } else if reason == values::NO_NUMBER {
        format!("'{text}' is no number: correct these cells at the source, or map another column")
    } else if reason == values::NO_TIME {
        "export the times as seconds, 12:34:56.7, 2024-03-01 12:34:56 or 01.03.2024 12:34:56".to_string()
    } else if grid.format.starts_with("text") {
        "check the map and its units; --decimal and --delimiter say how text is read".to_string()
    } else {
        "check the map and its units".to_string()
    }
}

/// The columns that the headers suggest, as text for people and whether anything was assumed.
pub fn guessed_lines(guessed: &[map::Taken]) -> Vec<String> {
    let line = |c: &map::Taken| {
        let target = &TARGETS[c.target];
        let assumed = if c.assumed { " (no unit stated: SI assumed)" } else { "" };
        let peak = if c.target == Id::AmplitudePp as usize && !targets::plain(&c.header).contains("pp") {
            " (taken as peak to peak: amplitude_peak is half of it)"
        } else {
            ""
        };
        let unit = if matches!(target.kind, ColumnKind::Number(_)) {
            format!(" in {}", c.unit_text)
        } else {
            String::new()
        };
        format!("  {} -> {}{unit}: {}{assumed}{peak}", c.header, target.name, target.words)
    };
    guessed.iter().map(line).collect()
}
