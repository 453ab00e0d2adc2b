//! `muprime case`: one range of a study's cases, or one task's share of them.

use super::prelude::*;
use std::ops::Range;
use studies::cases::study::Study;
use studies::cases::task_range::Share;
use studies::cases::worker::{Done, work};

#[derive(Debug, clap::Args)]
pub struct Args {
    /// The file of cases
    #[arg(long, value_name = "FILE")]
    cases: PathBuf,
    /// Index of one case, from 0
    #[arg(long, value_name = "N", conflicts_with_all = ["range", "task", "of"])]
    index: Option<u64>,
    /// Indices of several: the first, and the one after the last
    #[arg(long, value_name = "FIRST..END", value_parser = range_of, conflicts_with_all = ["task", "of"])]
    range: Option<Range<u64>>,
    /// What is missing of an equal share, counted from 0 (left out: SLURM_ARRAY_TASK_ID, PBS_ARRAY_INDEX,
    /// PBS_ARRAYID or JOB_COMPLETION_INDEX)
    #[arg(long, value_name = "I", requires = "of")]
    task: Option<u64>,
    /// Number of shares (left out: SLURM_ARRAY_TASK_COUNT)
    #[arg(long, value_name = "N")]
    of: Option<u64>,
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

/// Runs the range, or what is missing of the share, unless its shard is there; refused: a task that nobody
/// names, bad cases, a folder of another study, a disk that is full.
pub fn run(args: Args, json: bool) -> miette::Result<ExitCode> {
    if args.threads == Some(0) {
        miette::bail!("--threads 0: at least one is needed");
    }
    // Before the folder is made: a share that nobody names is refused.
    let share = match (&args.range, args.index, args.task, args.of) {
        (Some(_), ..) | (_, Some(_), ..) => None,
        (_, _, Some(task), Some(of)) => Some(Share::new(task, of)?),
        (.., of) => Some(Share::from_environment(of, &|name| std::env::var(name).ok())?),
    };
    let study = Study::begin(&args.cases, &args.out)?;
    let threads = args.threads.unwrap_or(0);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().into_diagnostic()?;
    let program = runs::version::program_sha256().into_diagnostic()?;
    let ranges = match (share, args.range.or(args.index.map(|n| n..n.saturating_add(1)))) {
        (Some(share), _) => share.missing(&study)?,
        (None, range) => range.into_iter().collect(),
    };
    let (mut shards, mut cancelled) = (Vec::new(), false);
    for range in ranges {
        let done = pool.install(|| work(&study, range.clone(), &program, args.job.as_deref()))?;
        let (shard, cases) = (study.shard(&range), range.end - range.start);
        let (word, failed) = match done {
            Done::There => ("there", None),
            Done::Made { failed } => ("made", Some(failed)),
            Done::Cancelled => ("cancelled", None),
        };
        cancelled |= done == Done::Cancelled;
        if !json {
            let failed =
                failed.filter(|n| *n > 0).map(|n| format!(", {n} without a result")).unwrap_or_default();
            out!("{}: {word}, {cases} cases{failed}", shard.display());
        }
        shards.push(json!({ "shard": shard, "cases": cases, "done": word, "failed": failed }));
    }
    if let Some(Share { task, of }) = share {
        let part = Share { task, of }.part(study.file.header.cases);
        let (first, end) = (part.start, part.end);
        if json {
            answer_json(&json!({ "task": task, "of": of, "range": [first, end], "shards": shards }));
        } else {
            out!("task {task} of {of}: cases {first}..{end}, {} shards were missing", shards.len());
        }
    } else if let Some(shard) = shards.first().filter(|_| json) {
        out!("{shard}");
    }
    exit(if cancelled { FAILED } else { DONE })
}
