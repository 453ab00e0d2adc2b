//! What a run's record says of the run besides its passes.

use super::records_in;
use miette::{IntoDiagnostic, WrapErr};
use realtime::recorder::{self, Entry, Reader};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// What the records of a run say of it: facts by name, and its files' keys by `file: key`.
pub type Said = BTreeMap<String, String>;

/// What the first record of a run says of it.
///
/// # Errors
/// A folder without a record, or one that cannot be read.
pub fn said(folder: &Path) -> miette::Result<Said> {
    let first = records_in(folder)?.into_iter().next();
    let path = first.ok_or_else(|| miette::miette!("{} holds no record", folder.display()))?;
    let file = File::open(&path).into_diagnostic().wrap_err_with(|| path.display().to_string())?;
    let mut said = Said::new();
    let mut reader = Reader::new(BufReader::new(file)).only(recorder::EVENTS);
    for entry in &mut reader {
        match entry {
            Entry::Facts { name, facts } if name == recorder::HEADER => said.extend(facts),
            Entry::File { name, bytes, .. } => {
                let text = String::from_utf8_lossy(&bytes);
                match text.parse::<toml::Table>() {
                    Ok(table) => keys(&format!("{name}: "), &toml::Value::Table(table), &mut said),
                    Err(_) => drop(said.insert(name, calibration::certificate::sha256_hex(&bytes))),
                }
            }
            _ => {}
        }
    }
    Ok(said)
}

fn keys(path: &str, value: &toml::Value, said: &mut Said) {
    match value {
        toml::Value::Table(table) => {
            for (key, value) in table {
                let dot = if path.ends_with(": ") { "" } else { "." };
                keys(&format!("{path}{dot}{key}"), value, said);
            }
        }
        value => drop(said.insert(path.to_string(), value.to_string())),
    }
}
