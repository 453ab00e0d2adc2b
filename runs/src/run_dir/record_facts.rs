//! What a run's record says of the run besides its passes.

use super::records_in;
use miette::{IntoDiagnostic, WrapErr};
use realtime::recorder::{self, Entry, Reader};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// Entries of a record among which its facts are.
const HEAD: usize = 64;

/// What the records of a run say of it: facts by name, and its files' keys by `file: key`.
pub type RecordFacts = BTreeMap<String, String>;

/// The facts at the head of a run's first record; none where there is no record that says any. It reads
/// no cycle.
pub fn header_facts(folder: &Path) -> RecordFacts {
    let head = |path: &std::path::PathBuf| {
        let reader = Reader::new(BufReader::new(File::open(path).ok()?)).only(recorder::EVENTS);
        let header = |entry| match entry {
            Entry::Facts { name, facts } if name == recorder::HEADER => Some(facts),
            _ => None,
        };
        reader.take(HEAD).find_map(header)
    };
    records_in(folder).ok().and_then(|all| head(all.first()?)).unwrap_or_default()
}

/// What the first record of a run says of it.
///
/// # Errors
/// A folder without a record, or one that cannot be read.
pub fn record_facts(folder: &Path) -> miette::Result<RecordFacts> {
    let first = records_in(folder)?.into_iter().next();
    let path = first.ok_or_else(|| miette::miette!("{} holds no record", folder.display()))?;
    let file = File::open(&path).into_diagnostic().wrap_err_with(|| path.display().to_string())?;
    let mut all = RecordFacts::new();
    let mut reader = Reader::new(BufReader::new(file)).only(recorder::EVENTS);
    for entry in &mut reader {
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
