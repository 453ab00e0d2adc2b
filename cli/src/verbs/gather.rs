//! `muprime gather`: the results of a study as one table.

use super::prelude::*;
use studies::cases::gather::{Gathered, gather};
use studies::cases::study::Study;

#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder of the results
    dir: PathBuf,
    /// The table, in Parquet [default: DIR/gathered.parquet]
    #[arg(long, short = 'o', value_name = "FILE")]
    output: Option<PathBuf>,
    /// The file of cases, where it was moved
    #[arg(long, value_name = "FILE")]
    cases: Option<PathBuf>,
    /// Take results of several builds of this version
    #[arg(long)]
    any_build: bool,
}

/// Gathers; no table is written of holes, duplicates that differ, mixed versions or builds.
pub fn run(args: Args, json: bool) -> miette::Result<ExitCode> {
    let study = Study::in_folder(&args.dir, args.cases.as_deref())?;
    let to = args.output.unwrap_or_else(|| study.out.join("gathered.parquet"));
    let gathered = gather(&study, &to, args.any_build)?;
    if gathered.parts > 0 && !json {
        say!("{} unfinished files in parts/: of workers at work, or killed", gathered.parts);
    }
    let Gathered { file, cases, shards, failed, sha256, .. } = &gathered;
    let words = format!("{cases} cases of {shards} shards, {failed} without a result\nSHA-256 {sha256}");
    answered(json, &gathered, format!("{}: {words}", file.display()))
}
