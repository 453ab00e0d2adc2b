//! `muprime runs`: the runs of a folder.

use miette::IntoDiagnostic;
use runs::catalogue::{existing, runs_folder};
use runs::out;
use std::path::PathBuf;
use std::process::ExitCode;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder of the runs [default: $MUPRIME_RUNS or ./runs]
    #[arg(long)]
    folder: Option<PathBuf>,
    /// Only runs whose plan's name contains this
    #[arg(long)]
    plan: Option<String>,
    /// Only runs that did not end by themselves
    #[arg(long)]
    unfinished: bool,
}

/// Lists.
///
/// # Errors
/// A folder that holds no run, or cannot be read.
pub fn run(args: Args, json: bool) -> miette::Result<ExitCode> {
    let folder = args.folder.unwrap_or_else(runs_folder);
    let mut runs = existing(&folder)?;
    runs.retain(|r| args.plan.as_ref().is_none_or(|p| r.plan.contains(p.as_str())));
    runs.retain(|r| !args.unfinished || r.outcome != "complete");
    if json {
        out!("{}", serde_json::to_string(&runs).into_diagnostic()?);
        return super::exit(super::DONE);
    }
    for r in runs {
        let outcome = if r.outcome.is_empty() { "no ending".into() } else { r.outcome.replace('_', " ") };
        let departed = if r.departed { "  disagrees" } else { "" };
        out!("{:40} {:>5}/{:<5} {outcome:12} {}{departed}", r.folder, r.passes, r.planned, r.setup);
    }
    super::exit(super::DONE)
}
