//! What is read from the disk for a browser.

use crate::live::{Ended, Message, Progress, Run, TimedEvent};
use miette::{IntoDiagnostic, WrapErr};
use runs::catalogue::{RunEntry, runs_in};
use runs::run_dir::is_held;
use runs::setup::Guards;
use serde::Serialize;
use std::path::Path;

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
}

/// The runs of a folder, newest first; none where there is no folder yet.
///
/// # Errors
/// A folder that cannot be read.
pub fn runs(folder: &Path) -> miette::Result<Vec<Listed>> {
    Ok(runs_in(folder)?
        .into_iter()
        .map(|entry| {
            let run = folder.join(&entry.folder);
            Listed { live: is_held(&run), pages: pages_in(&run), entry }
        })
        .collect())
}

fn pages_in(run: &Path) -> Vec<String> {
    let names = std::fs::read_dir(run).into_iter().flatten().flatten();
    let mut pages: Vec<String> = names
        .filter_map(|entry| entry.file_name().into_string().ok())
        .filter(|name| name.ends_with(".html"))
        .collect();
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
        miette::bail!("{name} is no file, or larger than {} MiB", LARGEST >> 20);
    }
    std::fs::read_to_string(&path).into_diagnostic().wrap_err_with(|| name.to_string())
}

/// The comparison of two runs.
///
/// # Errors
/// Runs that cannot be compared.
pub fn compare(a: &Path, b: &Path) -> miette::Result<String> {
    let compared = runs::compare::Compared::of([a, b])?;
    runs::report::comparison::page(&compared)
}

/// What a viewer of an ended run gets: the messages of a running one, without states.
///
/// # Errors
/// A folder that holds no run, or one that cannot be read.
pub fn past(folder: &Path) -> miette::Result<Vec<Message>> {
    let run = runs::report::read(folder)?;
    let fact = |name: &str| run.facts.get(name).cloned();
    let planned = run.summary.as_ref().map_or(run.passes.len(), |s| s.planned);
    let of = Run {
        folder: folder.to_path_buf(),
        plan: fact("plan").unwrap_or_default(),
        setup: fact("setup").unwrap_or_default(),
        model: fact("model").unwrap_or_default(),
        operator: fact("operator"),
        sample: fact("sample"),
        started_unix_s: fact("start_unix_ns").and_then(|ns| ns.parse::<f64>().ok()).unwrap_or(0.0) * 1e-9,
        fast: fact("clock").as_deref() == Some("virtual"),
        process: 0,
        planned,
        made_before: 0,
        guards: Guards::of_facts(fact),
    };
    let mut messages = vec![Message::Run(Box::new(of))];
    let progress = Progress { made: run.passes.len(), planned, remaining_s: 0.0 };
    messages.extend(run.passes.iter().map(|pass| Message::Pass(Box::new(pass.clone()))));
    messages.extend(run.events.iter().filter_map(|(at_s, event)| {
        // Events of a later version are left to that one.
        let event = serde_json::from_value(event.clone()).ok()?;
        Some(Message::Event(TimedEvent::of(*at_s, event)))
    }));
    messages.push(Message::Progress(progress));
    messages.push(Message::Ended(Box::new(match run.summary {
        Some(summary) => Ended::of(&Ok(summary)),
        None => {
            let error = "the run has no ending: it was killed, or it still goes on".to_string();
            Ended { outcome: None, remedy: None, error: Some(error), off: None, agreement: None }
        }
    })));
    Ok(messages)
}
