//! Conversions of a run for other programs. Each is made beside its goal, synced and moved there: never half a file.
//!
//! All but CSV carry what the numbers are: the unit and the meaning of every column or topic, and the facts
//! of the run ([`facts`]): operator, sample, instruments, certificates, versions, seed, licence.

#[cfg(feature = "arrow")]
mod arrow;
mod columns;
mod crate_of_run;
mod csv;
mod cycles;
pub mod facts;
#[cfg(feature = "matlab")]
mod hdf5;
mod mcap;
#[cfg(feature = "parquet")]
mod parquet;
pub mod topics;
pub mod unit;

/// Stands in for a format where its feature is off: every call says how to get it.
macro_rules! left_out {
    ($format:ident without $feature:literal) => {
        #[cfg(not(feature = $feature))]
        mod $format {
            pub fn bytes(_: &super::columns::Table, _: &super::facts::Facts) -> miette::Result<Vec<u8>> {
                Err(crate::built_without($feature, "take CSV"))
            }
        }
    };
}

left_out!(arrow without "arrow");
left_out!(hdf5 without "matlab");
left_out!(parquet without "parquet");

use clap::ValueEnum;
use runs::RunData;
use std::path::{Path, PathBuf};

/// A format to export to. Add one: a file in `export/`, a variant, and a line in [`export`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// The point table with the comparison's columns, as CSV.
    Csv,
    /// The same as Parquet, with units and facts.
    Parquet,
    /// The same as an Arrow IPC file, with units and facts.
    Arrow,
    /// The same as HDF5 in the manner of NeXus, with units and facts.
    Hdf5,
    /// Every cycle as flat topics that viewers plot at once.
    Mcap,
    /// A description of the run's folder for repositories (RO-Crate), with sizes and checksums.
    RoCrate,
}

impl Format {
    /// Default name of the file.
    pub const fn file(self) -> &'static str {
        match self {
            Format::Csv => "passes.csv",
            Format::Parquet => "passes.parquet",
            Format::Arrow => "passes.arrow",
            Format::Hdf5 => "passes.h5",
            Format::Mcap => "signals.mcap",
            Format::RoCrate => crate_of_run::FILE,
        }
    }
}

/// The passes of a run as an Arrow IPC file in memory, with units and facts.
///
/// # Errors
/// Whatever the format's library says; a build without Arrow.
pub fn arrow_bytes(run: &RunData) -> miette::Result<Vec<u8>> {
    arrow::bytes(&columns::of(&run.passes), &facts::of(run, &facts::ExportFacts::default()))
}

/// The cycles of a run's records as an Arrow IPC file in memory: session, loop time, and a column for each
/// curve that [`Format::Mcap`] has, with units and facts. `points`: those passes alone; all where it is
/// empty.
///
/// # Errors
/// A record that cannot be read; a build without Arrow.
pub fn cycles_bytes(folder: &Path, run: &RunData, points: &[u32]) -> miette::Result<Vec<u8>> {
    arrow::bytes(&cycles::of(folder, points)?, &facts::of(run, &facts::ExportFacts::default()))
}

/// What was exported.
#[derive(Debug)]
pub struct Exported {
    /// Where it stands.
    pub file: PathBuf,
    /// How many passes it holds: of a record that is cut fewer than the run has.
    pub passes: usize,
}

/// Exports the run in `folder` to `to`, or to the format's own name in the folder. A
/// licence that is stated now replaces the one that the run was made with.
///
/// # Errors
/// Whatever the file system or the format's library says; a crate of a run without a licence, or at another
/// place than the run's folder.
pub fn export(
    folder: &Path,
    run: &RunData,
    format: Format,
    stated: &facts::ExportFacts,
    to: Option<&Path>,
) -> miette::Result<Exported> {
    let facts = facts::of(run, stated);
    let table = columns::of(&run.passes);
    let file = to.map_or_else(|| folder.join(format.file()), Path::to_path_buf);
    let bytes = match format {
        Format::Csv => csv::bytes(&table)?,
        Format::Parquet => parquet::bytes(&table, &facts)?,
        Format::Arrow => arrow::bytes(&table, &facts)?,
        Format::Hdf5 => hdf5::bytes(&table, &facts)?,
        Format::Mcap => {
            let passes = mcap::write(folder, run, &facts, &file)?;
            return Ok(Exported { file, passes });
        }
        Format::RoCrate => crate_of_run::bytes(folder, run, &facts, &file)?,
    };
    runs::files::write_output(&file, &bytes)?;
    Ok(Exported { file, passes: run.passes.len() })
}
