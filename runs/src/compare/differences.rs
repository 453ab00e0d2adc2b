//! What differs between two runs besides what was measured: setup, plan, model, seed, versions, fingertip.

use crate::input::in_si;
use crate::run_dir::RecordFacts;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

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

/// What differs, by name; without the record of a run (it alone names the model) only what both state.
pub fn between(a: &RecordFacts, b: &RecordFacts) -> Vec<Difference> {
    let names: BTreeSet<&String> = a.keys().chain(b.keys()).collect();
    let equal = |name: &str| match (a.get(name), b.get(name)) {
        (Some(a), Some(b)) => a == b || numbers(name, a).is_some_and(|of| Some(of) == numbers(name, b)),
        _ => false,
    };
    let both = [a, b].iter().any(|facts| !facts.contains_key("model"));
    let known = |name: &str| !both || a.contains_key(name) && b.contains_key(name);
    let differs = |name: &&String| *name != "start_unix_ns" && known(name) && !equal(name);
    let difference =
        |name: &String| Difference { what: name.clone(), a: a.get(name).cloned(), b: b.get(name).cloned() };
    names.into_iter().filter(differs).map(difference).collect()
}

/// What must be known before equality is taken for a proof: tables that are the same bytes, and noise of the
/// same seed. A run that does not state its clock may be virtual.
pub fn warnings(a: &RecordFacts, b: &RecordFacts, same_bytes: bool) -> Vec<String> {
    let is_virtual = |facts: &RecordFacts| facts.get("clock").is_none_or(|c| c == "virtual");
    let seed = a.get("seed").filter(|seed| b.get("seed") == Some(seed) && is_virtual(a) && is_virtual(b));
    let twice = "the point tables are byte-identical: this is one measurement, not two".to_string();
    let noise = |seed| {
        format!(
            "both runs have seed {seed} on the virtual rig: their noise is the same; equality proves nothing"
        )
    };
    same_bytes.then_some(twice).into_iter().chain(seed.map(noise)).collect()
}
