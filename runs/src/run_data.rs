//! A run, finished or not, as it is read from its folder for pages, comparisons and exports. An error is a
//! folder that holds no run.

pub mod about;
pub mod remarks;

use crate::fidelity::{self, Fidelity};
use crate::input::rig_file;
use crate::run_dir::{differences, missing_records, of_record, open_record, passes_in, records_in};
use crate::{MeasuredPass, Outcome, Summary};
use models::pass::coulomb_coefficient;
use models::{Finger, PassNoise};
use realtime::recorder::{self, Entry};
use std::collections::BTreeMap;
use std::path::Path;

/// A run as its folder holds it.
pub struct RunData {
    /// What is known of the run, for the top of a page.
    pub about: Vec<(&'static str, String)>,
    /// Facts of the record's first words.
    pub facts: BTreeMap<String, String>,
    /// Files that the record holds, by name: setup, plan, rig.toml, certificates, model, profiles.
    pub files: BTreeMap<String, Vec<u8>>,
    /// The passes with their comparisons. Measured `mu'` is over the `mu_0` of all passes without vibration, as
    /// in `muprime compare`; the loop had the estimate so far, which the model moves.
    pub passes: Vec<MeasuredPass>,
    /// Events with loop time in s.
    pub events: Vec<(f64, serde_json::Value)>,
    /// How it ended; `None` for a run that was killed or is still going.
    pub summary: Option<Summary>,
    /// The finger of rig.toml.
    pub finger: Finger,
    /// How faithfully it rendered its target; none of a run that rendered nothing.
    pub fidelity: Option<Fidelity>,
    /// What is damaged or missing in the run's folder.
    pub damage: Vec<String>,
}

impl RunData {
    /// How the run ended, in words.
    pub fn ending(&self) -> String {
        let Some(Summary { outcome, planned, links, .. }) = &self.summary else {
            return "The run has no ending: it was killed, or is still going".into();
        };
        let why = match outcome {
            Outcome::Complete => return format!("Complete: {} of {planned} passes", self.passes.len()),
            Outcome::Tripped(trip) => {
                let last = |(name, link): (&String, &serde_json::Value)| {
                    let text = link["last_problem"].as_str().filter(|text| !text.is_empty())?;
                    Some(format!("; last problem of `{name}`: {text}"))
                };
                format!("tripped, {trip}{}", links.iter().filter_map(last).collect::<String>())
            }
            outcome => outcome.words(),
        };
        format!("Ended early after {} of {planned} passes: {why}", self.passes.len())
    }
}

/// Reads a run's folder.
pub fn read(folder: &Path) -> miette::Result<RunData> {
    let mut passes = passes_in(folder)?;
    let mut facts = BTreeMap::new();
    let mut files = BTreeMap::new();
    let mut events = Vec::new();
    let mut damage = missing_records(folder)?;
    for path in records_in(folder)? {
        let mut start = 0u64;
        // Entry by entry: the rows of hours would not fit into memory.
        let mut reader = open_record(&path, recorder::EVENTS)?;
        for entry in &mut reader {
            match entry {
                Entry::Facts { name, facts: found } if name == recorder::HEADER => {
                    start = found.get("start_unix_ns").and_then(|s| s.parse().ok()).unwrap_or(0);
                    facts = found;
                }
                Entry::Message { log_time, text, .. } => {
                    if let Ok(event) = serde_json::from_slice(&text) {
                        events.push((log_time.saturating_sub(start) as f64 * 1e-9, event));
                    }
                }
                Entry::File { name, bytes, .. } => drop(files.insert(name, bytes)),
                Entry::Facts { .. } => {}
            }
        }
        damage.extend(of_record(&path, reader.integrity().clone()));
    }
    damage.extend(differences(folder, &passes)?);
    let rig = rig_file(&folder.join("rig.toml"))?;
    let mu0 = restated(&mut passes, &rig.noise);
    let summary = Summary::written_in(folder);
    let mut about = about::of_run(folder, &facts, Some(&rig));
    about.extend(mu0.map(|mu0| ("mu_0", format!("{mu0:.4}, of all passes without vibration"))));
    let fidelity = fidelity::read(folder);
    Ok(RunData { about, facts, files, passes, events, summary, finger: rig.finger, fidelity, damage })
}

/// Takes the run's own `mu_0` for the measured `mu'` of every pass that was compared, and returns it.
fn restated(passes: &mut [MeasuredPass], noise: &PassNoise) -> Option<f64> {
    let mu0 = coulomb_coefficient(passes.iter().map(|p| &p.pass)).filter(|mu0| *mu0 > 0.0)?;
    let mu0_sd = noise.coulomb_coefficient_sd(mu0, passes.iter().map(|p| &p.pass));
    for MeasuredPass { pass, comparison, .. } in passes {
        let Some((friction, found)) = pass.friction_force_n().zip(comparison.as_mut()) else { continue };
        let mu = friction / (mu0 * pass.normal_force_n);
        found.mu_relative_sd = Some(noise.mu_relative_sd(mu, pass.normal_force_n, [mu0, mu0_sd]));
        found.mu_relative = Some(mu);
    }
    Some(mu0)
}
