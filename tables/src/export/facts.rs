//! What goes with the numbers wherever they go: who, on what, with which instruments, certificates and
//! versions, under which licence.

use runs::RunData;
use std::collections::BTreeMap;

/// Facts by name.
pub type Facts = BTreeMap<String, String>;

/// What is stated when a run is exported.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct ExportFacts {
    /// Licence of the data: an SPDX identifier (CC-BY-4.0) or an address [default: the run's]
    #[arg(long, value_name = "ID")]
    pub licence: Option<String>,
    /// Who publishes the data, and where the operator works: NAME, or NAME with an address in angle brackets
    #[arg(long, value_name = "NAME")]
    pub organisation: Option<String>,
}

/// The facts of a run: those of its record, and what its folder says of instruments and certificates. A
/// licence that is stated now stands in place of the record's. What is not known is not there.
pub fn of(run: &RunData, stated: &ExportFacts) -> Facts {
    let mut facts = run.facts.clone();
    facts.remove(realtime::recorder::CHECKSUM);
    let profiles = run.files.keys().filter_map(|name| name.strip_prefix("profiles/")?.strip_suffix(".toml"));
    let instruments: Vec<&str> = profiles.collect();
    if !instruments.is_empty() {
        facts.insert("instruments".into(), instruments.join(", "));
    }
    let about = ["date", "certificates", "stiffness", "repeatability", "mu_0"];
    let about = run.about.iter().filter(|(name, _)| about.contains(name));
    facts.extend(about.map(|(name, words)| (name.to_string(), words.clone())));
    facts.extend(run.summary.iter().map(|s| ("outcome".to_string(), outcome(s))));
    let answered = run.events.iter().filter(|(_, event)| event["event"] == "answered");
    for (n, (_, event)) in answered.enumerate() {
        let part = |key: &str| event[key].as_str().unwrap_or_default();
        let words = format!("{}: {} ({})", part("step"), part("answer"), part("answered_by"));
        facts.insert(format!("at_rig.{:03}", n + 1), words);
    }
    let stated = [("licence", &stated.licence), ("organisation", &stated.organisation)];
    facts.extend(stated.into_iter().filter_map(|(name, fact)| Some((name.to_string(), fact.clone()?))));
    facts.insert(
        "units".into(),
        "SI; every name of a quantity ends with its unit; amplitudes are peak-to-peak".into(),
    );
    facts
}

fn outcome(summary: &runs::job::Summary) -> String {
    let outcome = serde_json::to_value(&summary.outcome).unwrap_or_default();
    outcome["outcome"].as_str().unwrap_or("unknown").to_string()
}
