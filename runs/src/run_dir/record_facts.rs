//! What a run's record says of the run besides its passes.

use super::{open_record, records_in};
use realtime::recorder::{self, Entry};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Entries of a record among which its facts are.
const HEAD: usize = 64;

/// What the records of a run say of it: facts by name, and its files' keys by `file: key`.
pub type RecordFacts = BTreeMap<String, String>;

/// The facts at the head of a run's first record; none where there is no record that says any. It reads
/// no cycle.
pub fn header_facts(folder: &Path) -> RecordFacts {
    let header = |entry| match entry {
        Entry::Facts { name, facts } if name == recorder::HEADER => Some(facts),
        _ => None,
    };
    let head =
        |all: Vec<PathBuf>| open_record(all.first()?, recorder::EVENTS).ok()?.take(HEAD).find_map(header);
    records_in(folder).ok().and_then(head).unwrap_or_default()
}

/// What the first record of a run says of it.
///
/// # Errors
/// A folder without a record, or one that cannot be read.
pub fn record_facts(folder: &Path) -> miette::Result<RecordFacts> {
    let first = records_in(folder)?.into_iter().next();
    let path = first.ok_or_else(|| miette::miette!("{} holds no record", folder.display()))?;
    let mut all = RecordFacts::new();
    for entry in open_record(&path, recorder::EVENTS)? {
        match entry {
            Entry::Facts { name, facts } if name == recorder::HEADER => all.extend(facts),
            Entry::File { name, bytes, .. } => {
                let text = String::from_utf8_lossy(&bytes);
                match text.parse::<toml::Table>() {
                    Ok(table) => keys(&format!("{name}: "), &toml::Value::Table(table), &mut all),
                    Err(_) => drop(all.insert(name, calibration::certificate::sha256_hex(&bytes))),
                }
            }
            _ => {}
        }
    }
    Ok(all)
}

fn keys(path: &str, value: &toml::Value, facts: &mut RecordFacts) {
    match value {
        toml::Value::Table(table) => {
            for (key, value) in table {
                let dot = if path.ends_with(": ") { "" } else { "." };
                keys(&format!("{path}{dot}{key}"), value, facts);
            }
        }
        value => drop(facts.insert(path.to_string(), value.to_string())),
    }
}
