//! HyperQueue and Dask, spoken to in Python by their own packages, with the script `hand_over.py` beside this file: it hands the tasks
//! over and stays until they have ended. HyperQueue goes on without it; a Dask scheduler drops what waits when its client leaves.

use super::{Accepted, ClusterJob, Engine, numbers};
use miette::{Context, IntoDiagnostic, miette};
use runs::files;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Command, Stdio};

/// HyperQueue.
pub const HYPERQUEUE: Engine = Engine { name: "hq", submit, again, alive, cancel };
/// Dask.distributed.
pub const DASK: Engine =
    Engine { name: "dask", submit, again: |_, job| Ok(Accepted::of(job)), alive, cancel };

/// What speaks to them.
const SCRIPT: &str = include_str!("hand_over.py");

fn submit(folder: &Path, job: &ClusterJob) -> miette::Result<Accepted> {
    job.write(folder)?;
    begun(folder, job, &[])
}

fn again(folder: &Path, job: &ClusterJob) -> miette::Result<Accepted> {
    begun(folder, job, numbers(&job.ids)?)
}

/// Starts the script; its first line names the job, or what is wrong.
fn begun(folder: &Path, job: &ClusterJob, ids: &[String]) -> miette::Result<Accepted> {
    let mut options = std::fs::OpenOptions::new();
    let path = folder.join("log.txt");
    let log = files::open_plain(&path, options.create(true).append(true));
    let log = log.into_diagnostic().wrap_err("log.txt")?;
    let mut child = Command::new(&job.python)
        // Nothing of the folder is run or trusted: the script is this program's, and the job comes by its standard input.
        .args(["-c", SCRIPT])
        .arg(folder)
        .args(ids)
        // What it says of an error is for people: no frames of other programs.
        .env("RUST_BACKTRACE", "0")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(log)
        .spawn()
        .into_diagnostic()
        .wrap_err_with(|| format!("{} cannot be run: name a Python with --python", job.python))?;
    if let Some(mut to) = child.stdin.take() {
        // One that ends at once says why below.
        let _ = to.write_all(&serde_json::to_vec(job).into_diagnostic()?);
    }
    let mut line = String::new();
    if let Some(stdout) = child.stdout.take() {
        BufReader::new(stdout).read_line(&mut line).into_diagnostic()?;
    }
    let named: Option<Vec<String>> = serde_json::from_str(&line).ok();
    let Some(ids) = named else {
        let _ = child.kill();
        let _ = child.wait();
        let log = std::fs::read_to_string(&path).unwrap_or_default();
        let last = log.lines().rev().find(|l| l.contains("Error")).unwrap_or("no output").to_string();
        return Err(miette!("{} takes no tasks: {last} (all of it: {})", job.engine, path.display()));
    };
    Ok(Accepted { ids, child: Some(child), tasks: job.ranges.len() as u64, ..Accepted::of(job) })
}

fn alive(_: &Path, _: &ClusterJob, handed: &mut Accepted) -> miette::Result<bool> {
    Ok(handed.child.as_mut().is_some_and(|child| matches!(child.try_wait(), Ok(None))))
}

/// Their workers look for the file `cancelled` in the job's folder, which is there by now: those that wait
/// end at once, those at work after their portion.
fn cancel(_: &ClusterJob) -> miette::Result<()> {
    Ok(())
}
