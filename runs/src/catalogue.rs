//! The runs of a folder, as their own folders describe them. There is no other list: a run that was copied in
//! is listed, and one that was removed is not.

use crate::run_dir::{self, passes_in, record_facts, sessions_in};
use miette::{IntoDiagnostic, WrapErr};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// One run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RunEntry {
    /// Folder of the run.
    pub folder: String,
    /// Name of the plan.
    pub plan: String,
    /// Name of the setup.
    pub setup: String,
    /// When it began, in s since 1970.
    pub started_unix_s: f64,
    /// How it ended; empty while it runs or was killed.
    pub outcome: String,
    /// Passes acknowledged.
    pub passes: usize,
    /// Passes planned; 0 where the run has no ending and was made by a version that did not write the number.
    pub planned: usize,
    /// Whether the measurement disagrees with the model.
    pub departed: bool,
}

/// The part of a summary that a list needs.
#[derive(Deserialize)]
struct Ending {
    outcome: String,
    passes: usize,
    planned: usize,
    model_departed: bool,
}

impl RunEntry {
    /// The run in a folder; `None` where no session of a run has begun. A damaged file leaves its part empty:
    /// `muprime check` explains the damage.
    fn of(run: &Path) -> Option<Self> {
        let start_unix_ns = match sessions_in(run) {
            Ok(sessions) => sessions.first()?.start_unix_ns,
            Err(_) => 0,
        };
        let (mut plan, mut setup, mut planned) = (String::new(), String::new(), 0);
        if let Ok(identity) = run_dir::identity_in(run) {
            (plan, setup, planned) = (identity.plan, identity.setup, identity.planned);
        }
        if plan.is_empty() {
            // A version before this one wrote the names into the record alone.
            let mut facts = record_facts(run).unwrap_or_default();
            let mut fact = |name| facts.remove(name).unwrap_or_default();
            (plan, setup) = (fact("plan"), fact("setup"));
        }
        let summary = std::fs::read(run.join(run_dir::SUMMARY)).ok();
        let ending = summary.and_then(|text| serde_json::from_slice(&text).ok()).unwrap_or_else(|| {
            let passes = passes_in(run).unwrap_or_default();
            let model_departed = passes.iter().any(|p| p.comparison.is_some_and(|c| c.departed));
            Ending { outcome: String::new(), passes: passes.len(), planned, model_departed }
        });
        Some(RunEntry {
            folder: run.file_name()?.to_string_lossy().into_owned(),
            plan,
            setup,
            started_unix_s: start_unix_ns as f64 * 1e-9,
            outcome: ending.outcome,
            passes: ending.passes,
            planned: ending.planned,
            departed: ending.model_departed,
        })
    }
}

/// The runs of a folder, newest first; none where the folder does not exist.
///
/// # Errors
/// A folder that cannot be read.
pub fn runs_in(folder: &Path) -> miette::Result<Vec<RunEntry>> {
    if !folder.exists() {
        return Ok(Vec::new());
    }
    let entries = std::fs::read_dir(folder).into_diagnostic();
    let entries = entries.wrap_err_with(|| folder.display().to_string())?;
    let mut runs: Vec<RunEntry> = entries.flatten().filter_map(|entry| RunEntry::of(&entry.path())).collect();
    let newest_first = |a: &RunEntry, b: &RunEntry| {
        b.started_unix_s.total_cmp(&a.started_unix_s).then(b.folder.cmp(&a.folder))
    };
    runs.sort_by(newest_first);
    Ok(runs)
}

/// The runs of a folder, newest first, at least one.
///
/// # Errors
/// There is none; a folder that cannot be read.
pub fn existing(folder: &Path) -> miette::Result<Vec<RunEntry>> {
    let runs = runs_in(folder)?;
    if runs.is_empty() {
        miette::bail!(help = "give --folder, or make a run first", "{} holds no run", folder.display());
    }
    Ok(runs)
}

/// The folder of runs: `MUPRIME_RUNS`, or `runs` here.
pub fn runs_folder() -> PathBuf {
    std::env::var_os("MUPRIME_RUNS").map_or_else(|| PathBuf::from("runs"), PathBuf::from)
}
