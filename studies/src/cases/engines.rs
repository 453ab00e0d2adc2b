//! Engines of institutes. To add one, add a file here and a line in [`ENGINES`]. An engine only runs
//! commands, reports whether they may still succeed, and ends them. The folder alone shows the results.

pub mod python;
pub mod slurm;

use miette::{Context, IntoDiagnostic};
use serde::{Deserialize, Serialize};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::Child;
use std::time::Instant;

/// All engines but this machine itself.
pub const ENGINES: [&Engine; 3] = [&slurm::ENGINE, &python::HYPERQUEUE, &python::DASK];

/// An engine.
pub struct Engine {
    /// Name.
    pub name: &'static str,
    /// Hands the tasks over.
    pub submit: fn(&Path, &ClusterJob) -> miette::Result<Accepted>,
    /// Takes up a job that an earlier command handed over.
    pub again: fn(&Path, &ClusterJob) -> miette::Result<Accepted>,
    /// Whether tasks may still be run; hands over more where not all are.
    pub alive: fn(&Path, &ClusterJob, &mut Accepted) -> miette::Result<bool>,
    /// Ends what runs and what waits.
    pub cancel: fn(&ClusterJob) -> miette::Result<()>,
}

/// `job.json` in a job's folder: what was handed over, to whom, and how.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ClusterJob {
    /// Name of the engine.
    pub engine: String,
    /// The engine's own names of the job.
    pub ids: Vec<String>,
    /// Name of the study's kind.
    pub kind: String,
    /// The worker's command but for its range.
    pub command: Vec<String>,
    /// Ranges, one a core of a task.
    pub ranges: Vec<Range<u64>>,
    /// Cores of a task.
    #[serde(default = "one")]
    pub cores_a_task: u64,
    /// Tasks that wait or run at one time at most.
    #[serde(default = "one")]
    pub window: u64,
    /// Memory that a task may take, bytes; as the engine has it if left out.
    pub memory_bytes: Option<u64>,
    /// Time that a task may take, s.
    pub limit_s: f64,
    /// Tasks at one time at most; as many as the engine gives if left out.
    pub workers: Option<u64>,
    /// Address or folder of the engine's server, where it has one.
    pub server: Option<String>,
    /// Python of the engines that are spoken to in it.
    pub python: String,
    /// Passed on to the engine as they are.
    pub options: Vec<String>,
}

/// What an engine has accepted.
pub struct Accepted {
    /// Its names.
    pub ids: Vec<String>,
    /// The process that stands between, where there is one.
    pub child: Option<Child>,
    /// Tasks that it has accepted.
    pub tasks: u64,
    /// Tasks of the next submission.
    pub array: u64,
    /// Refusals since the last submission that was accepted.
    pub refusals: u32,
    /// When the next submission is due.
    pub pause_until: Option<Instant>,
}

fn one() -> u64 {
    1
}

impl Accepted {
    /// What `job.json` states.
    pub fn of(job: &ClusterJob) -> Accepted {
        Accepted { ids: job.ids.clone(), child: None, tasks: 0, array: 1, refusals: 0, pause_until: None }
    }
}

impl ClusterJob {
    /// Reads `job.json`.
    ///
    /// # Errors
    /// A folder without one, one of another version, or one that another user wrote.
    pub fn read(folder: &Path) -> miette::Result<ClusterJob> {
        let path = folder.join("job.json");
        let shown = || path.display().to_string();
        let file = runs::files::open_plain(&path, std::fs::OpenOptions::new().read(true));
        let file = file.into_diagnostic().wrap_err_with(shown)?;
        if !runs::files::is_own(&file.metadata().into_diagnostic()?) {
            let help = "whoever handed it over follows and cancels it";
            miette::bail!(help = help, "{}: another user's job", shown());
        }
        let bytes = std::io::read_to_string(file).into_diagnostic().wrap_err_with(shown)?;
        serde_json::from_str(&bytes).into_diagnostic().wrap_err_with(|| path.display().to_string())
    }

    /// Writes `job.json`.
    ///
    /// # Errors
    /// Whatever the file system says.
    pub fn write(&self, folder: &Path) -> miette::Result<()> {
        runs::files::write_plain(&folder.join("job.json"), serde_json::to_vec_pretty(self).into_diagnostic()?)
    }
}

/// The engine of that name; none for this machine itself.
///
/// # Errors
/// There is none.
pub fn by_name(name: &str) -> miette::Result<Option<&'static Engine>> {
    if name == "local" {
        return Ok(None);
    }
    ENGINES.into_iter().find(|e| e.name == name).map(Some).ok_or_else(|| {
        let names: Vec<&str> = ENGINES.iter().map(|e| e.name).collect();
        miette::miette!("--engine {name}: local, {} is needed", names.join(", "))
    })
}

/// The folders of jobs, the oldest first.
///
/// # Errors
/// A folder that cannot be read.
pub fn folders(out: &Path) -> miette::Result<Vec<PathBuf>> {
    let jobs = out.join("jobs");
    if !jobs.exists() {
        return Ok(Vec::new());
    }
    let entries = std::fs::read_dir(&jobs).into_diagnostic()?;
    let mut all: Vec<PathBuf> =
        entries.filter_map(|e| Some(e.ok()?.path())).filter(|p| p.join("job.json").exists()).collect();
    all.sort();
    Ok(all)
}

/// The names of a job, where each is a number: anything else could be an option of the program that gets it.
///
/// # Errors
/// One that is none.
pub fn numbers(ids: &[String]) -> miette::Result<&[String]> {
    match ids.iter().find(|id| id.is_empty() || !id.bytes().all(|b| b.is_ascii_digit())) {
        None => Ok(ids),
        Some(id) => miette::bail!("a job's name is a number, and {id:?} is none"),
    }
}
