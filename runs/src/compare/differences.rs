//! What differs between two runs besides what was measured: setup, plan, model, seed, versions, fingertip.

use crate::input::in_si;
use crate::run_dir::RecordFacts;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

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

/// A value that is numbers, whatever the unit that it was written in.
#[derive(PartialEq, Deserialize)]
#[serde(untagged)]
enum Numbers {
    One(f64),
    List(Vec<f64>),
}

/// The numbers of a key in SI: `2um` is 2e-6.
fn numbers(name: &str, value: &str) -> Option<BTreeMap<String, Numbers>> {
    let key = name.rsplit(['.', ' ']).next()?;
    toml::from_str(&in_si(&format!("{key} = {value}"))).ok()
}

/// What differs, by name.
pub fn between(a: &RecordFacts, b: &RecordFacts) -> Vec<Difference> {
    let mut names: Vec<&String> = a.keys().chain(b.keys()).collect();
    names.sort_unstable();
    names.dedup();
    let equal = |name: &str| match (a.get(name), b.get(name)) {
        (Some(a), Some(b)) => a == b || numbers(name, a).is_some_and(|of| Some(of) == numbers(name, b)),
        _ => false,
    };
    let differs = |name: &&String| !TIMES.contains(&name.as_str()) && !equal(name);
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
