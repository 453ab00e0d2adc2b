//! `muprime submit`: runs what is missing of a study, here or on an engine.

use super::prelude::*;
use studies::cases::study::Study;
use studies::cases::submit::{Options, cancel, submit};

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The file of cases
    #[arg(required_unless_present = "cancel")]
    cases: Option<PathBuf>,
    /// Folder of the results: shared with the engine's machines
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// local, slurm, hq or dask
    #[arg(long, default_value = "local")]
    engine: String,
    /// Cases at one time (local: all cores; else as many as the engine gives)
    #[arg(long, value_name = "N")]
    workers: Option<u64>,
    /// Time limit of one task, as in 30:00 or 2:00:00 (from a pilot if left out)
    #[arg(long, value_parser = seconds_of)]
    time: Option<f64>,
    /// Seconds that a task is meant to take
    #[arg(long, default_value_t = 300.0, value_name = "S")]
    task_s: f64,
    /// Cases of the pilot, which is run here for 20 s at most
    #[arg(long, default_value_t = 8, value_name = "N")]
    pilot: usize,
    /// Seconds of a case, where they are known: no pilot is run
    #[arg(long, value_name = "S")]
    case_s: Option<f64>,
    /// Do not wait for the end
    #[arg(long)]
    detach: bool,
    /// hq: folder of its server; dask: address of its scheduler
    #[arg(long)]
    server: Option<String>,
    /// Python that has the package hyperqueue or distributed
    #[arg(long, default_value = "python3")]
    python: String,
    /// Passed on to sbatch (may be repeated), as in --option=--partition=short
    #[arg(long, value_name = "OPTION", allow_hyphen_values = true)]
    option: Vec<String>,
    /// End what runs and what waits; results that are there stay
    #[arg(long)]
    cancel: bool,
}

/// Seconds of MM, MM:SS, H:MM:SS or D-HH:MM:SS, as Slurm writes them.
fn seconds_of(text: &str) -> Result<f64, String> {
    let wrong = || "MM:SS, H:MM:SS or D-HH:MM:SS".to_string();
    let (days, rest) = text.split_once('-').unwrap_or(("0", text));
    let parts: Result<Vec<u64>, _> = std::iter::once(days).chain(rest.split(':')).map(str::parse).collect();
    let seconds = match parts.map_err(|_| wrong())?[..] {
        [0, m] => 60 * m,
        [0, m, s] => 60 * m + s,
        [d, h, m, s] => 86400 * d + 3600 * h + 60 * m + s,
        _ => return Err(wrong()),
    };
    if seconds == 0 { Err(wrong()) } else { Ok(seconds as f64) }
}

/// Submits, follows, says what is missing.
///
/// # Errors
/// Bad cases, an engine that takes nothing.
pub fn run(args: Args, json: bool) -> miette::Result<ExitCode> {
    if args.cancel {
        let ids = cancel(&args.out)?;
        if json {
            out!("{}", serde_json::json!({ "cancelled": ids }));
        } else {
            out!("cancelled: {}", if ids.is_empty() { "nothing was at work".into() } else { ids.join(", ") });
        }
        return exit(DONE);
    }
    let positive = |name: &str, value: Option<f64>| match value {
        Some(v) if !(v > 0.0 && v.is_finite()) => Err(miette::miette!("--{name} {v}: above 0")),
        _ => Ok(()),
    };
    positive("task-s", Some(args.task_s))?;
    positive("case-s", args.case_s)?;
    if args.workers == Some(0) {
        miette::bail!("--workers 0: at least one is needed");
    }
    studies::cases::engines::by_name(&args.engine)?;
    if args.engine == "dask" && (args.server.is_none() || args.detach) {
        miette::bail!(
            "--engine dask needs --server, the address of its scheduler, and cannot be detached from: it drops what waits when its client leaves"
        );
    }
    let study = Study::begin(args.cases.as_deref().unwrap_or(&args.out), &args.out)?;
    let options = Options {
        engine: args.engine,
        workers: args.workers,
        task_s: args.task_s,
        limit_s: args.time,
        pilot: args.pilot,
        case_s: args.case_s,
        detach: args.detach,
        server: args.server,
        python: args.python,
        options: args.option,
    };
    let submitted = submit(&study, &options)?;
    let whole = submitted.missing == 0 || options.detach;
    if json {
        out!("{}", serde_json::to_string(&submitted).into_diagnostic()?);
    } else {
        if let Some(pilot) = submitted.pilot {
            say!(
                "pilot: {:.3} s a case, the longest of {} {:.3} s; {} tasks of {} cases, {:.0} s each at most",
                pilot.mean_s,
                pilot.cases,
                pilot.longest_s,
                submitted.tasks,
                submitted.cases_a_task,
                submitted.limit_s
            );
        }
        out!(
            "{}: {} of {} cases have a result, {} of them from before; {:.1} s",
            submitted.out.display(),
            submitted.cases - submitted.missing,
            submitted.cases,
            submitted.there,
            submitted.wall_seconds
        );
        if !whole {
            out!("output of the tasks: {}", submitted.out.join("jobs").display());
        }
    }
    exit(if whole { DONE } else { FAILED })
}

#[cfg(test)]
mod tests {
    use super::seconds_of;

    #[test]
    fn times_are_read_as_slurm_writes_them() {
        assert_eq!(seconds_of("5"), Ok(300.0));
        assert_eq!(seconds_of("1:30"), Ok(90.0));
        assert_eq!(seconds_of("2:00:01"), Ok(7201.0));
        assert_eq!(seconds_of("1-00:00:00"), Ok(86400.0));
        for bad in ["", "0", "x", "1-5", "1:2:3:4", "-5"] {
            assert!(seconds_of(bad).is_err(), "{bad}");
        }
    }
}
