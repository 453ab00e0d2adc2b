//! Two runs' folders compared: statistics, what must be minded, what differed.

use super::differences::{Difference, between, warnings};
use super::{ComparisonAnswer, Judged, Reference, RunComparison, Side, compare};
use crate::run_dir::{record_facts, records_in};
use crate::{Outcome, RunData};
use miette::{IntoDiagnostic, WrapErr};
use models::PassNoise;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// What `muprime compare` says of two runs.
#[derive(Clone, Debug, Serialize)]
pub struct Compared {
    /// Their folders.
    pub runs: [PathBuf; 2],
    /// What speaks against a plain reading: shared seeds, an early ending, damage.
    pub warnings: Vec<String>,
    /// The statistics.
    pub comparison: RunComparison,
    /// What differed in setup, plan, certificates and model.
    pub differences: Vec<Difference>,
    /// What is known of each, for the top of a page.
    #[serde(skip)]
    pub about: [Vec<(&'static str, String)>; 2],
}

impl Compared {
    /// Compares the runs in two folders.
    ///
    /// # Errors
    /// A folder that holds no run, a run without a pass without vibration.
    pub fn of(folders: [&Path; 2]) -> miette::Result<Self> {
        let [a, b] = [read_run(folders[0])?, read_run(folders[1])?];
        // The records were just read: what can fail is that there is none.
        let facts = |(at, run): (usize, &RunData)| record_facts(folders[at]).unwrap_or(run.facts.clone());
        let [facts_a, facts_b] = [(0, &a), (1, &b)].map(facts);
        let sides = [Side::of(&a, noise(folders[0])?), Side::of(&b, noise(folders[1])?)];
        let [first, second] = [0, 1].map(|i| reference(&sides[i], folders[i]));
        let mut comparison = compare([&sides[0], &sides[1]], [first?, second?]);
        let [table_a, table_b] = folders.map(|folder| std::fs::read(folder.join("points.csv")).ok());
        let mut warnings = warnings(&facts_a, &facts_b, table_a == table_b);
        // Of two runs whose noise is one a difference is a difference; likeness shows nothing.
        let alike = |j: &&mut Judged| !warnings.is_empty() && j.answer == ComparisonAnswer::NoDifferenceSeen;
        comparison.judged.iter_mut().filter(alike).for_each(|j| j.answer = ComparisonAnswer::NotIndependent);
        for (folder, run) in folders.into_iter().zip([&a, &b]) {
            warnings.extend(run.damage.iter().map(|d| format!("{}: {d}", folder.display())));
        }
        Ok(Compared {
            runs: folders.map(Path::to_path_buf),
            warnings,
            comparison,
            differences: between(&facts_a, &facts_b),
            about: [a.about, b.about],
        })
    }
}

/// A run; an early ending and a missing record count as damage. Without a record run.toml gives its facts.
pub(super) fn read_run(folder: &Path) -> miette::Result<RunData> {
    let mut run = crate::run_data::read(folder)?;
    if run.summary.as_ref().is_none_or(|s| s.outcome != Outcome::Complete) {
        run.damage.insert(0, run.ending());
    }
    if records_in(folder)?.is_empty() {
        let stated: toml::Table = crate::input::text_of(&folder.join("run.toml"))
            .and_then(|text| toml::from_str(&text).into_diagnostic())
            .wrap_err("without a record, run.toml must have the run's seed, setup and plan: keep it too")?;
        let words = |value: toml::Value| value.as_str().map_or_else(|| value.to_string(), String::from);
        let of_record = |name: String| if name == "model" { "model_identity".into() } else { name };
        run.facts = stated.into_iter().map(|(name, value)| (of_record(name), words(value))).collect();
        if let Some(summary) = &run.summary {
            let clock = if summary.loop_report.is_none() { "virtual" } else { "monotonic" };
            run.facts.insert("clock".into(), clock.into());
        }
        run.damage.push("no record: seed, setup and plan are those of run.toml".into());
    }
    Ok(run)
}

/// `mu_0` of a run; the error names its folder.
pub(super) fn reference(side: &Side, folder: &Path) -> miette::Result<Reference> {
    side.reference().map_err(|why| miette::miette!("{}: {why}", folder.display()))
}

pub(super) fn noise(folder: &Path) -> miette::Result<PassNoise> {
    Ok(crate::input::rig_file(&folder.join("rig.toml"))?.noise)
}
