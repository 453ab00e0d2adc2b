//! Results of a study in a file of JSON lines, one a case, under the case's content key: a study that was
//! stopped goes on where it was, and a case that is there is not run again.

use miette::{IntoDiagnostic, WrapErr, miette};
use models::ridge::study::content_key;
use models::ridge::{self, RidgeCase, RidgeRun, RunSettings};
use rayon::prelude::*;
use runs::say;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::sync::Mutex;

/// The stored results of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StoredRun {
    /// Content key of the case.
    pub key: String,
    /// mu'.
    pub mu_relative: f64,
    /// Its standard error over the cycles.
    pub mu_relative_sd: f64,
    /// Mean reaction force over the applied one.
    pub reaction_over_load: f64,
    /// Share of time in contact.
    pub contact_fraction: f64,
    /// Phase shift in degrees; missing without vibration.
    pub phase_shift_deg: Option<f64>,
    /// Whether the period is doubled.
    pub period_doubled: bool,
    /// Whether the cycles became steady.
    pub steady: bool,
    /// Cycles run.
    pub cycles: usize,
}

impl StoredRun {
    fn of(key: String, case: &RidgeCase, run: &RidgeRun) -> StoredRun {
        StoredRun {
            key,
            mu_relative: run.mu_relative,
            mu_relative_sd: run.mu_relative_sd,
            reaction_over_load: run.mean_reaction_force_n / case.normal_force_n,
            contact_fraction: run.contact_fraction,
            phase_shift_deg: run.phase_shift_deg,
            period_doubled: run.period_doubled,
            steady: run.steady,
            cycles: run.cycles,
        }
    }
}

/// Results by content key.
pub type Results = HashMap<String, StoredRun>;

/// Reads what is there; a last line cut short by a stop is left out, with a word.
pub fn read(path: &Path) -> miette::Result<Results> {
    let mut results = Results::new();
    let Ok(file) = File::open(path) else {
        return Ok(results);
    };
    let lines: Vec<String> = BufReader::new(file).lines().collect::<Result<_, _>>().into_diagnostic()?;
    for (n, line) in lines.iter().enumerate() {
        match serde_json::from_str::<StoredRun>(line) {
            Ok(run) => {
                results.insert(run.key.clone(), run);
            }
            Err(_) if n + 1 == lines.len() => {
                say!("{}: the last line was cut short; its case is run again", path.display());
            }
            Err(why) => return Err(miette!("{} line {}: {why}", path.display(), n + 1)),
        }
    }
    Ok(results)
}

/// Runs what is missing of `cases`, on all cores, and returns all results. Cases that fail are named and
/// counted; no result stands for them.
pub fn complete(
    path: &Path,
    cases: impl IntoIterator<Item = RidgeCase>,
    settings: &RunSettings,
) -> miette::Result<(Results, usize)> {
    let mut results = read(path)?;
    let mut seen = std::collections::HashSet::new();
    let todo: Vec<(String, RidgeCase)> = cases
        .into_iter()
        .map(|case| (content_key(&case, settings), case))
        .filter(|(key, _)| !results.contains_key(key) && seen.insert(key.clone()))
        .collect();
    if todo.is_empty() {
        return Ok((results, 0));
    }
    let file = runs::files::open_plain(path, OpenOptions::new().create(true).append(true)).into_diagnostic();
    let file = file.wrap_err_with(|| format!("cannot write {}", path.display()))?;
    drop_cut_line(path, &file)?;
    let file = Mutex::new(file);
    let bar = crate::progress::bar(todo.len() as u64, "cases");
    let (kept_in, of) = (path.display().to_string(), todo.len());
    crate::progress::on_interrupt(&bar, move |done| {
        say!("partial: {done} of {of} cases are stored in {kept_in}; to run the others, repeat the command");
    })?;
    let run = |(key, case): &(String, RidgeCase)| {
        let outcome = ridge::run(case, settings).map(|run| StoredRun::of(key.clone(), case, &run));
        bar.inc(1);
        match outcome {
            Ok(stored) => {
                let line = serde_json::to_string(&stored).into_diagnostic()? + "\n";
                let mut file = file.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
                file.write_all(line.as_bytes()).into_diagnostic()?;
                Ok(Some(stored))
            }
            Err(why) => {
                bar.suspend(|| say!("{why}: {case:?}"));
                Ok(None)
            }
        }
    };
    let new: Vec<Option<StoredRun>> = todo.par_iter().map(run).collect::<miette::Result<_>>()?;
    bar.finish_and_clear();
    let failed = new.iter().filter(|k| k.is_none()).count();
    results.extend(new.into_iter().flatten().map(|run| (run.key.clone(), run)));
    Ok((results, failed))
}

/// Takes away a last line that was cut short.
fn drop_cut_line(path: &Path, file: &File) -> miette::Result<()> {
    let text = std::fs::read(path).into_diagnostic()?;
    let whole = text.iter().rposition(|b| *b == b'\n').map_or(0, |at| at + 1);
    if whole < text.len() {
        file.set_len(whole as u64).into_diagnostic()?;
    }
    Ok(())
}
