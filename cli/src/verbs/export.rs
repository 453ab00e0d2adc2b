//! `muprime export RUN --to csv|parquet|arrow|hdf5|mcap|ro-crate`.

use super::prelude::*;
use tables::export::facts::ExportFacts;
use tables::export::{Format, export};

#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder of the run
    run: PathBuf,
    /// Format
    #[arg(long, value_enum)]
    to: Format,
    /// Where to write it [default: passes.csv and the like, in the run's folder]
    #[arg(long)]
    out: Option<PathBuf>,
    #[command(flatten)]
    stated: ExportFacts,
}

/// Converts; refused: a folder that holds no run, or a place that cannot be written.
pub fn run(args: Args, json: bool) -> miette::Result<ExitCode> {
    super::must_exist(&args.run, "run")?;
    let run = runs::run_data::read(&args.run)?;
    let out = export(&args.run, &run, args.to, &args.stated, args.out.as_deref())?;
    if json {
        answer_json(&json!({ "file": out.file, "passes": out.passes, "damage": run.damage }));
    } else {
        match run.passes.len() {
            all if all == out.passes => say!("{all} passes: {}", out.file.display()),
            all => say!("{} of {all} passes, which the record holds: {}", out.passes, out.file.display()),
        }
        run.damage.iter().for_each(|d| say!("{d}"));
    }
    exit(DONE)
}
