//! A record in memory, with whatever it still holds.

use realtime::Row;
use realtime::recorder::{CYCLES, EVENTS, Entry, Integrity, PASSES, Reader};
use std::collections::BTreeMap;
use std::io::Cursor;

/// Whether a record is intact and holds everything that its session wrote.
pub fn complete(found: &Integrity) -> bool {
    found.intact() && found.missing.is_empty() && found.recovered.is_none()
}

/// What could be read of a record.
#[derive(Clone, Debug, Default)]
pub struct Contents {
    /// Metadata by name, in order.
    pub metadata: Vec<(String, BTreeMap<String, String>)>,
    /// Attached files: name and bytes.
    pub files: Vec<(String, Vec<u8>)>,
    /// Messages in order: topic, log time in ns since 1970, JSON text.
    pub messages: Vec<(&'static str, u64, Vec<u8>)>,
    /// What was found to be other than it was written.
    pub integrity: Integrity,
}

impl Contents {
    /// The rows.
    pub fn rows(&self) -> impl Iterator<Item = Row> + '_ {
        self.bodies(CYCLES).filter_map(|text| serde_json::from_slice(text).ok())
    }

    /// The passes, as JSON.
    pub fn passes(&self) -> impl Iterator<Item = serde_json::Value> + '_ {
        self.bodies(PASSES).filter_map(|text| serde_json::from_slice(text).ok())
    }

    /// The events, as JSON.
    pub fn events(&self) -> impl Iterator<Item = serde_json::Value> + '_ {
        self.bodies(EVENTS).filter_map(|text| serde_json::from_slice(text).ok())
    }

    fn bodies<'a>(&'a self, topic: &'a str) -> impl Iterator<Item = &'a [u8]> {
        self.messages.iter().filter(move |m| m.0 == topic).map(|m| &m.2[..])
    }

    /// Metadata of a name; the last one wins.
    pub fn facts(&self, name: &str) -> Option<&BTreeMap<String, String>> {
        self.metadata.iter().rev().find(|(n, _)| n == name).map(|(_, facts)| facts)
    }
}

/// Reads whatever a record still holds into memory, in the order it was written: see [`Reader`].
pub fn read(bytes: &[u8]) -> Contents {
    let mut contents = Contents::default();
    let mut reader = Reader::new(Cursor::new(bytes));
    for entry in &mut reader {
        match entry {
            Entry::Facts { name, facts } => contents.metadata.push((name, facts)),
            Entry::File { name, bytes, .. } => contents.files.push((name, bytes)),
            Entry::Message { topic, log_time, text, .. } => contents.messages.push((topic, log_time, text)),
        }
    }
    contents.integrity = reader.integrity().clone();
    contents
}
