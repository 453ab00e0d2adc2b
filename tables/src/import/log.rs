//! The log of an import, `import.json`.

use super::map::Taken;
use super::remarks::Range;
use super::series::Counts;
use super::values::Dropped;
use serde::Serialize;

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

impl MappedColumn {
    /// A column of the map.
    pub fn of(column: &Taken) -> Self {
        MappedColumn {
            from: column.header.clone(),
            column: column.target.column,
            target: column.target.name,
            unit: column.unit_text.clone(),
            factor: column.unit.factor(),
            offset: column.unit.offset(),
        }
    }
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
    /// How a series was cut, and what became of its samples.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub series: Option<Counts>,
    /// Ranges in SI.
    pub ranges: Vec<Range>,
    /// What looks wrong.
    pub remarks: Vec<String>,
}
