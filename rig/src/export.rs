//! Conversions of a run's tables. Written beside the goal, synced and moved there: never half a file.

mod arrow;
mod columns;
mod csv;
mod parquet;

use crate::report::RunData;
use clap::ValueEnum;
use std::path::Path;

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
