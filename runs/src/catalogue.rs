//! The runs of a folder, as their own folders describe them. There is no other list: a run that was copied in
//! is listed, and one that was removed is not.

mod annotations;
mod lineage;
mod thumbnail;

pub use annotations::{ANNOTATIONS, Annotations, LONGEST_NOTE, LONGEST_TAG, MOST_TAGS};
pub use lineage::{Lineage, lineage};

use crate::run_dir::{self, header_facts, passes_in, sessions_in};
use crate::verdict_text::files::DOCUMENT;
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
    /// Who led the run.
    pub operator: Option<String>,
    /// What was measured.
    pub sample: Option<String>,
    /// Name of the fingertip.
    pub tip: Option<String>,
    /// The model that the run was compared with.
    pub model: String,
    /// Seed of the order, and on a virtual rig of the noise.
    pub seed: Option<u64>,
    /// Friction coefficient of the passes without vibration; none where there is none.
    pub mu0: Option<f64>,
    /// The diagnosis in one sentence; none where the folder holds none.
    pub verdict: Option<String>,
    /// Tags that people gave it.
    pub tags: Vec<String>,
    /// The note that people wrote.
    pub note: String,
    /// Measured `mu'` against amplitude, as a small SVG; none without such passes.
    #[serde(skip)]
    pub thumbnail: Option<String>,
}

/// What a list is sorted by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
#[allow(missing_docs, reason = "the fields of an entry, under their names")]
pub enum SortBy {
    Started,
    Folder,
    Plan,
    Operator,
    Sample,
    Tip,
    Setup,
    Model,
    Seed,
    Mu0,
    Passes,
    Outcome,
    Verdict,
    Tags,
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
    /// How it ended and what it found, for people.
    pub fn outcome_words(&self) -> String {
        let outcome =
            if self.outcome.is_empty() { "no ending".into() } else { self.outcome.replace('_', " ") };
        outcome + if self.departed { ", disagrees with the model" } else { "" }
    }

    /// Whether each of these words is somewhere in its texts, whatever their case.
    pub fn has(&self, words: &str) -> bool {
        let texts = [&self.folder, &self.plan, &self.setup, &self.model, &self.note, &self.outcome_words()];
        let maybe = [&self.operator, &self.sample, &self.tip, &self.verdict];
        let all = texts.into_iter().chain(maybe.into_iter().flatten()).chain(&self.tags);
        let text = all.map(|text| text.to_lowercase()).collect::<Vec<_>>().join("\n");
        words.to_lowercase().split_whitespace().all(|word| text.contains(word))
    }

    /// The run in a folder; `None` where no session of a run has begun. A damaged file leaves its part empty:
    /// `muprime check` explains the damage.
    fn of(run: &Path) -> Option<Self> {
        let start_unix_ns = match sessions_in(run) {
            Ok(sessions) => sessions.first()?.start_unix_ns,
            Err(_) => 0,
        };
        // A version before this one wrote the names into the record alone.
        let mut facts = header_facts(run);
        let mut fact = |name: &str| facts.remove(name).filter(|text| !text.is_empty());
        let identity = run_dir::identity_in(run).ok();
        let named = |of: fn(&run_dir::Identity) -> &String| {
            identity.as_ref().map(|one| of(one).clone()).filter(|name| !name.is_empty())
        };
        let plan = named(|one| &one.plan).or_else(|| fact("plan")).unwrap_or_default();
        let setup = named(|one| &one.setup).or_else(|| fact("setup")).unwrap_or_default();
        let model = fact("model").or_else(|| named(|one| &one.model)).unwrap_or_default();
        let notes = identity.as_ref().map(|one| one.notes.clone()).unwrap_or_default();
        let planned = identity.as_ref().map_or(0, |one| one.planned);
        let passes = passes_in(run).unwrap_or_default();
        let annotations = Annotations::read(run).unwrap_or_default();
        let summary = std::fs::read(run.join(run_dir::SUMMARY)).ok();
        let ending = summary.and_then(|text| serde_json::from_slice(&text).ok()).unwrap_or_else(|| {
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
            operator: notes.operator.or_else(|| fact("operator")),
            sample: notes.sample.or_else(|| fact("sample")),
            tip: fact("fingertip"),
            model,
            seed: identity.map(|one| one.seed),
            mu0: models::pass::coulomb_coefficient(passes.iter().map(|p| &p.pass)),
            verdict: verdict_in(run),
            tags: annotations.tags,
            note: annotations.note,
            thumbnail: thumbnail::thumbnail(&passes),
        })
    }
}

/// The verdict's first statement, up to what it says of the gap.
fn verdict_in(run: &Path) -> Option<String> {
    let text = crate::input::bytes_of(&run.join(DOCUMENT), crate::input::MAX_BYTES).ok()?;
    let document: serde_json::Value = serde_json::from_slice(&text).ok()?;
    Some(document["text"].as_str()?.split(';').next()?.to_string())
}

/// The runs of a folder, newest first; none where it does not exist, an error where it cannot be read.
pub fn runs_in(folder: &Path) -> miette::Result<Vec<RunEntry>> {
    if !folder.exists() {
        return Ok(Vec::new());
    }
    let entries = std::fs::read_dir(folder).into_diagnostic();
    let entries = entries.wrap_err_with(|| folder.display().to_string())?;
    let mut runs: Vec<RunEntry> = entries.flatten().filter_map(|entry| RunEntry::of(&entry.path())).collect();
    runs.sort_by(|a, b| b.started_unix_s.total_cmp(&a.started_unix_s).then(b.folder.cmp(&a.folder)));
    Ok(runs)
}

/// Sorts entries by a column, empty ones last; entries that are alike stay in their order.
pub fn sort(runs: &mut [RunEntry], by: SortBy) {
    let mut by_text = |of: fn(&RunEntry) -> Option<String>| {
        runs.sort_by_cached_key(|run| {
            let text = of(run).filter(|text| !text.is_empty());
            (text.is_none(), text)
        });
    };
    let mu0 = |run: &RunEntry| run.mu0.unwrap_or(f64::MAX);
    match by {
        SortBy::Started => runs.sort_by(|a, b| b.started_unix_s.total_cmp(&a.started_unix_s)),
        SortBy::Folder => by_text(|r| Some(r.folder.clone())),
        SortBy::Plan => by_text(|r| Some(r.plan.clone())),
        SortBy::Operator => by_text(|r| r.operator.clone()),
        SortBy::Sample => by_text(|r| r.sample.clone()),
        SortBy::Tip => by_text(|r| r.tip.clone()),
        SortBy::Setup => by_text(|r| Some(r.setup.clone())),
        SortBy::Model => by_text(|r| Some(r.model.clone())),
        SortBy::Seed => runs.sort_by_key(|r| r.seed.unwrap_or(u64::MAX)),
        SortBy::Mu0 => runs.sort_by(|a, b| mu0(a).total_cmp(&mu0(b))),
        SortBy::Passes => runs.sort_by_key(|r| r.passes),
        SortBy::Outcome => by_text(|r| Some(r.outcome_words())),
        SortBy::Verdict => by_text(|r| r.verdict.clone()),
        SortBy::Tags => by_text(|r| Some(r.tags.join(" "))),
    }
}

/// The runs of a folder, newest first; it is an error where there is none, or the folder cannot be read.
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
