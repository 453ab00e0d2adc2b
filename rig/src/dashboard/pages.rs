//! What is read from the disk for a browser.

use super::download::files_in;
use miette::{IntoDiagnostic, WrapErr};
use runs::catalogue::{Lineage, RunEntry, lineage, runs_in};
use runs::compare::Compared;
use runs::compare::groups::{GroupBy, Grouped};
use runs::run_dir::is_held;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Largest page that is served, in bytes.
const LARGEST: u64 = 32 << 20;

/// A run in the list.
#[derive(Serialize)]
pub struct Listed {
    #[serde(flatten)]
    entry: RunEntry,
    /// Whether a process drives it now.
    live: bool,
    /// Names of the HTML pages in its folder.
    pages: Vec<String>,
    /// Measured `mu'` against amplitude, as SVG.
    picture: Option<String>,
}

/// A run with what belongs to it.
#[derive(Serialize)]
pub struct Described {
    #[serde(flatten)]
    listed: Listed,
    /// Names of the files that may be downloaded.
    files: Vec<String>,
    /// Runs before it and after it.
    lineage: Lineage,
}

/// The runs of a folder, newest first; none where there is no folder yet.
///
/// # Errors
/// A folder that cannot be read.
pub fn runs(folder: &Path) -> miette::Result<Vec<Listed>> {
    Ok(runs_in(folder)?.into_iter().map(|entry| listed(folder, entry)).collect())
}

fn listed(folder: &Path, mut entry: RunEntry) -> Listed {
    let run = folder.join(&entry.folder);
    let picture = entry.thumbnail.take();
    Listed { live: is_held(&run), pages: pages_in(&run), picture, entry }
}

/// One run of a folder.
///
/// # Errors
/// A folder that cannot be read, or holds no run of that name.
pub fn run(folder: &Path, name: &str) -> miette::Result<Described> {
    let mut all = runs_in(folder)?;
    let lineage = lineage(folder, &all, name);
    let at = all.iter().position(|run| run.folder == name);
    let entry = all.swap_remove(at.ok_or_else(|| miette::miette!("no session of this run has begun"))?);
    Ok(Described { listed: listed(folder, entry), files: files_in(&folder.join(name)), lineage })
}

/// The runs of a folder that a process drives, the newest session first.
pub fn live(folder: &Path) -> Vec<String> {
    let began = |run: &Path| run.join("sessions.jsonl").metadata().and_then(|meta| meta.modified()).ok();
    let held =
        std::fs::read_dir(folder).into_iter().flatten().flatten().filter(|entry| is_held(&entry.path()));
    let mut live: Vec<_> = held
        .filter_map(|entry| Some((began(&entry.path()), entry.file_name().into_string().ok()?)))
        .collect();
    live.sort_by(|a, b| b.cmp(a));
    live.into_iter().map(|(_, name)| name).collect()
}

fn pages_in(run: &Path) -> Vec<String> {
    let names = std::fs::read_dir(run).into_iter().flatten().flatten();
    let names = names.filter_map(|entry| entry.file_name().into_string().ok());
    let mut pages: Vec<String> = names.filter(|name| name.ends_with(".html")).collect();
    pages.sort();
    pages
}

/// A page of a run's folder, as it was written.
///
/// # Errors
/// There is none of that name, or it cannot be read.
pub fn page(run: &Path, name: &str) -> miette::Result<String> {
    // Only what is listed: no path leads elsewhere.
    if !pages_in(run).iter().any(|page| page == name) {
        miette::bail!("there is no page of this name");
    }
    let path = run.join(name);
    let meta = path.symlink_metadata().into_diagnostic()?;
    if !meta.is_file() || meta.len() > LARGEST {
        miette::bail!("{name} is not a file, or larger than {} MiB", LARGEST >> 20);
    }
    std::fs::read_to_string(&path).into_diagnostic().wrap_err_with(|| name.to_string())
}

/// The comparison of two runs, or of more by groups.
///
/// # Errors
/// Runs that cannot be compared.
pub fn compare(runs: &[PathBuf], by: Option<GroupBy>) -> miette::Result<String> {
    match runs {
        [a, b] if by.is_none() => runs::report::comparison::page(&Compared::of([a, b])?),
        more => runs::report::groups::page(&Grouped::of(more, by.unwrap_or_default())?),
    }
}
