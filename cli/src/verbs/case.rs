//! `muprime case`: one range of a study's cases.

use super::prelude::*;
use std::ops::Range;
use studies::cases::study::{Study, program};
use studies::cases::worker::{Done, work};

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The file of cases
    #[arg(long, value_name = "FILE")]
    cases: PathBuf,
    /// Index of one case, from 0
    #[arg(long, value_name = "N", conflicts_with = "range", required_unless_present = "range")]
    index: Option<u64>,
    /// Indices of several: the first, and the one after the last
    #[arg(long, value_name = "FIRST..END", value_parser = range_of)]
    range: Option<Range<u64>>,
    /// Folder of the results
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Threads (all cores if left out)
    #[arg(long)]
    threads: Option<usize>,
    /// Folder of the job that this belongs to: a file `cancelled` there ends it
    #[arg(long, hide = true)]
    job: Option<PathBuf>,
}

fn range_of(text: &str) -> Result<Range<u64>, String> {
    let parsed = text.split_once("..").and_then(|(a, b)| Some(a.parse().ok()?..b.parse().ok()?));
    parsed
        .filter(|r: &Range<u64>| r.start < r.end)
        .ok_or_else(|| "FIRST..END, as in 0..100 for the first hundred".to_string())
}

/// Runs the range unless its shard is there.
///
/// # Errors
/// Bad cases, a folder of another study, a disk that is full.
pub fn run(args: Args, json: bool) -> miette::Result<ExitCode> {
    if args.threads == Some(0) {
        miette::bail!("--threads 0: at least one is needed");
    }
    let range = args.range.or(args.index.map(|n| n..n.saturating_add(1))).unwrap_or(0..0);
    let study = Study::begin(&args.cases, &args.out)?;
    let threads = args.threads.unwrap_or(0);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().into_diagnostic()?;
    let program = program()?;
    let done = pool.install(|| work(&study, range.clone(), &program, args.job.as_deref()))?;
    let (shard, cases) = (study.shard(&range), range.end - range.start);
    let (word, failed) = match done {
        Done::There => ("there", None),
        Done::Made { failed } => ("made", Some(failed)),
        Done::Cancelled => ("cancelled", None),
    };
    if json {
        out!("{}", serde_json::json!({ "shard": shard, "cases": cases, "done": word, "failed": failed }));
    } else {
        let failed = failed.filter(|n| *n > 0).map(|n| format!(", {n} without a result")).unwrap_or_default();
        out!("{}: {word}, {cases} cases{failed}", shard.display());
    }
    exit(if done == Done::Cancelled { FAILED } else { DONE })
}
