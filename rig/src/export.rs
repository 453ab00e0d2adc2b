//! Conversions of a run's tables. Written beside the goal, synced and moved there: never half a file.

#[cfg(feature = "arrow")]
mod arrow;
mod columns;
mod csv;
#[cfg(feature = "parquet")]
mod parquet;

/// Stands in where the feature is off: every call says how to get it.
#[cfg(not(feature = "arrow"))]
mod arrow {
    pub fn bytes(_: &super::columns::Table) -> miette::Result<Vec<u8>> {
        Err(super::absent("arrow"))
    }
}

/// Stands in where the feature is off: every call says how to get it.
#[cfg(not(feature = "parquet"))]
mod parquet {
    pub fn bytes(_: &super::columns::Table) -> miette::Result<Vec<u8>> {
        Err(super::absent("parquet"))
    }
    /// Refuses.
    ///
    /// # Errors
    /// Always.
    pub fn as_csv(_: &std::path::Path) -> miette::Result<String> {
        Err(super::absent("parquet"))
    }
}

use crate::report::RunData;
use clap::ValueEnum;
use std::path::Path;

pub use parquet::as_csv as parquet_as_csv;

/// A format to export to. Add one: a file in `export/`, a variant, and a line in [`export`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// The point table with the comparison's columns, as CSV.
    Csv,
    /// The same as Parquet.
    Parquet,
    /// The same as an Arrow IPC file.
    Arrow,
}

impl Format {
    /// Ending of a file's name.
    pub const fn ending(self) -> &'static str {
        match self {
            Format::Csv => "csv",
            Format::Parquet => "parquet",
            Format::Arrow => "arrow",
        }
    }
}

#[cfg(not(all(feature = "arrow", feature = "parquet")))]
fn absent(feature: &str) -> miette::Report {
    miette::miette!(
        help = "build it with `cargo install --path rig` (the feature is on by default), or take CSV",
        "this muprime was built without its feature `{feature}`"
    )
}

/// Exports a run's passes.
///
/// # Errors
/// Whatever the file system or the format's library says.
pub fn export(run: &RunData, format: Format, to: &Path) -> miette::Result<()> {
    let table = columns::of(&run.passes);
    let bytes = match format {
        Format::Csv => csv::bytes(&table)?,
        Format::Parquet => parquet::bytes(&table)?,
        Format::Arrow => arrow::bytes(&table)?,
    };
    crate::files::write_whole(to, &bytes)
}
