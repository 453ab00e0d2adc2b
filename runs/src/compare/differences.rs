//! What differs between two runs besides what was measured: setup, plan, model, seed, versions, fingertip.

use crate::run_dir::RecordFacts;
use serde::Serialize;

/// Facts that say when a run was and not what it was.
const TIMES: [&str; 1] = ["start_unix_ns"];

/// One thing that differs.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Difference {
    /// A fact of the record, or a file in it and the key.
    pub what: String,
    /// The first run's; `None` where it has none.
    pub a: Option<String>,
    /// The second run's.
    pub b: Option<String>,
}

/// What differs, by name.
pub fn between(a: &RecordFacts, b: &RecordFacts) -> Vec<Difference> {
    let mut names: Vec<&String> = a.keys().chain(b.keys()).collect();
    names.sort_unstable();
    names.dedup();
    let differs = |name: &&String| !TIMES.contains(&name.as_str()) && a.get(*name) != b.get(*name);
    let difference =
        |name: &String| Difference { what: name.clone(), a: a.get(name).cloned(), b: b.get(name).cloned() };
    names.into_iter().filter(differs).map(difference).collect()
}

/// What must be known before equality is taken for a proof: tables that are the same bytes, and noise of the same seed.
pub fn warnings(a: &RecordFacts, b: &RecordFacts, same_bytes: bool) -> Vec<String> {
    let mut all = Vec::new();
    if same_bytes {
        all.push("the point tables are byte-identical: this is one measurement, not two".to_string());
    }
    let virtual_clock = |facts: &RecordFacts| facts.get("clock").is_some_and(|c| c == "virtual");
    if let (Some(seed), Some(other)) = (a.get("seed"), b.get("seed"))
        && seed == other
        && virtual_clock(a)
        && virtual_clock(b)
    {
        all.push(format!(
            "both runs have seed {seed} on the virtual rig: their noise is the same; equality proves nothing"
        ));
    }
    all
}
