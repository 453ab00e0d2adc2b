//! Foreign tables made into point tables. Their contents are detected or stated, every number is converted to
//! SI once, and every repair, omission and assumption is reported.

#[cfg(feature = "matlab")]
mod arrays;
mod binary;
mod clock;
mod formats;
mod grid;
pub mod guess;
#[cfg(feature = "matlab")]
mod hdf5;
mod head;
mod log;
pub mod map;
#[cfg(feature = "matlab")]
mod mat;
mod refusals;
pub(crate) mod remarks;
mod series;
pub mod targets;
mod text;
mod values;
#[cfg(feature = "excel")]
mod workbook;
mod write;

use calibration::certificate::sha256_hex;
use map::Map;
use models::{Pass, RigFile};
use series::Spread;
use targets::Id;
use values::{Dropped, Values};

pub use formats::read;
pub(crate) use formats::{as_csv, is_parquet};
pub use grid::Grid;
pub(crate) use grid::csv_of;
pub use log::{Log, MappedColumn};
pub use map::guessed_lines;
pub(crate) use remarks::points;
pub use remarks::{Range, never_lifts, of_table as remarks_of};
pub use series::{Counts, Cut};
pub use text::Marks;

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

/// Pieces at marks outside of double quotes.
pub(crate) fn apart(text: &str, mark: impl Fn(char) -> bool) -> impl Iterator<Item = &str> {
    let mut quoted = false;
    text.split(move |c| {
        quoted ^= c == '"';
        mark(c) && !quoted
    })
}

/// Makes a point table of a source.
///
/// # Errors
/// Columns that are missing or given twice, all at once; fewer than half of the rows that can be taken; a
/// series without steady stretches. Nothing is written.
pub fn import(source: &str, bytes: &[u8], grid: &Grid, wanted: &Wanted<'_>) -> miette::Result<Imported> {
    let map = &wanted.map;
    let import = Import { source, grid, wanted, map };
    let not_taken: Vec<String> = map.free(grid).map(|k| grid.header[k].clone()).collect();
    import.refuse_lacks(&not_taken)?;
    let mut notes = grid.notes.clone();
    let Table { passes, dropped, series } = import.table(&mut notes)?;
    let columns = write::columns(map, series.is_some());
    let table = write::written(&passes, &columns, map.has(Id::Frequency))?;
    let (rig, assumed) = match &wanted.rig {
        Some(text) => (text.clone(), Vec::new()),
        None => write::rig(&passes, source, wanted.tip)?,
    };
    let slack = RigFile::parse(&rig).ok().and_then(|rig| never_lifts(&passes, &rig.finger));
    let log = Log {
        schema: "muprime.import/1",
        version: env!("CARGO_PKG_VERSION"),
        source: source.into(),
        sha256: sha256_hex(bytes),
        format: grid.format.clone(),
        map: map.columns.iter().map(MappedColumn::of).collect(),
        map_argument: map.written(),
        not_taken,
        set: wanted.set.clone(),
        notes,
        assumed,
        rows: grid.rows.len(),
        passes: passes.len(),
        series,
        ranges: remarks::ranges(&passes, &columns),
        remarks: [map::contradicted(map, grid), remarks::remarks(&passes, &columns), Vec::from_iter(slack)]
            .concat(),
        dropped,
    };
    Ok(Imported { table, rig, log })
}

/// A source with what is wanted of it.
struct Import<'a> {
    source: &'a str,
    grid: &'a Grid,
    wanted: &'a Wanted<'a>,
    map: &'a Map,
}

/// The passes of a source, and what became of its other rows.
struct Table {
    passes: Vec<Pass>,
    dropped: Vec<Dropped>,
    series: Option<Counts>,
}

/// Why a row of padding is left out.
const PADDING: &str = "zeros at the end: room that was not filled";

impl Import<'_> {
    fn table(&self, notes: &mut Vec<String>) -> miette::Result<Table> {
        let Import { source, grid, wanted, .. } = *self;
        let full = grid.rows.iter().rposition(|r| !is_padding(r)).map_or(0, |k| k + 1);
        let padded = grid.rows.len() - full;
        let room_from = if wanted.padding { full } else { grid.rows.len() };
        let (mut values, mut dropped) = self.rows(notes, room_from)?;
        let is_row = |d: &&Dropped| d.reason != PADDING && d.reason != head::ONE_TEXT;
        let mut of = (values.len() + dropped.iter().filter(is_row).count(), "rows");
        let (mut series, mut spreads) = (None, Vec::new());
        if let Some(cut) = wanted.series {
            dropped.extend(series::unusable(&mut values));
            if 2 * values.len() < of.0 {
                return Err(self.mostly_dropped(&dropped, values.len(), of, padded));
            }
            let (cut, counts) = series::cut(&values, &cut).map_err(|e| miette::miette!("{source}: {e}"))?;
            (values, spreads) = cut.into_iter().unzip();
            (of, series) = ((values.len(), "steady stretches"), Some(counts));
        }
        let (passes, taken) = passes(&values, &spreads, &mut dropped);
        dropped.sort_by_key(|d| d.row);
        // A word that is not understood may be that of every pass in one direction.
        let no_way = dropped.iter().filter(|d| d.reason == values::NO_WAY).count();
        if 2 * passes.len() < of.0 || passes.is_empty() || 10 * no_way > of.0 {
            return Err(self.mostly_dropped(&dropped, passes.len(), of, padded));
        }
        if series.is_none() {
            let again = grid.notes.iter().filter(|n| n.contains("header again"));
            let back = clock::order(&taken, wanted.unsorted).map_err(|e| {
                miette::miette!(
                    help = "if that column restarts with each step, map the column that numbers the steps (HEADER=run), or import each step \
                            by itself; if the rows are sorted otherwise and the times are those of one clock: --accept unsorted",
                    "{source}: {e}{}",
                    again.map(|n| format!("\n{n}")).collect::<String>()
                )
            })?;
            notes.extend(back);
        }
        Ok(Table { passes, dropped, series })
    }

    /// The times of the rows where a clock, or their number, gives them; none otherwise.
    fn clocks(&self, notes: &mut Vec<String>) -> miette::Result<Vec<Option<f64>>> {
        if self.map.time_by_rows {
            notes.push("time_s is the number of the row, a second each".into());
            return Ok((0..self.grid.rows.len()).map(|number| Some(number as f64)).collect());
        }
        let column = self.map.columns.iter().find(|c| c.target.id == Id::Time);
        let read = column.map(|c| clock::times(self.grid, c.index, &c.unit_text)).transpose();
        let (times, remarks) = read.map_err(|e| miette::miette!("{}: {e}", self.source))?.unwrap_or_default();
        notes.extend(remarks);
        Ok(times)
    }

    /// The map of each block of the source; none of a block that is another table.
    fn maps(&self, notes: &mut Vec<String>) -> miette::Result<Vec<Option<Map>>> {
        let mut maps = vec![Some(self.map.clone())];
        for block in &self.grid.blocks {
            let under = map::under(self.map, self.grid, block).map_err(|e| {
                let help = "make a file of each part, or give them the same columns";
                miette::miette!(help = help, "{}: {e}", self.source)
            })?;
            if under.is_none() {
                notes.push(format!("row {} heads another table: its rows were not taken", block.place));
            }
            maps.push(under);
        }
        Ok(maps)
    }

    /// The values of the rows, and the rows that are left out. Those from number `room_from` on are padding.
    fn rows(&self, notes: &mut Vec<String>, room_from: usize) -> miette::Result<(Vec<Values>, Vec<Dropped>)> {
        let (maps, clocks) = (self.maps(notes)?, self.clocks(notes)?);
        let (mut values, mut dropped) = (Vec::new(), self.grid.left_out.clone());
        for (number, row) in self.grid.rows.iter().enumerate() {
            let Some(map) = &maps[row.block] else { continue };
            if number >= room_from {
                let (text, reason) = ("0".into(), PADDING.into());
                dropped.push(Dropped { row: row.place, column: String::new(), text, reason });
                continue;
            }
            match Values::read(self.grid, map, row, clocks.get(number).copied().flatten()) {
                Ok(v) => values.push(v),
                Err(why) => dropped.push(why),
            }
        }
        Ok((values, dropped))
    }
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

/// Whether a row holds nothing but zeros.
fn is_padding(row: &grid::Row) -> bool {
    row.cells.iter().all(|c| {
        matches!(c, grid::Cell::Empty) || c.digits(false).is_some_and(|d| d.parse::<f64>() == Ok(0.0))
    })
}
