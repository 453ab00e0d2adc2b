//! Reading a record that may be cut or damaged anywhere, and making it whole.

use super::integrity::Integrity;
use super::sink::Sink;
use super::{Entry, RECOVERED, Reader, TOPICS};
use mcap::McapError;
use std::collections::BTreeMap;
use std::io::{Read, Seek, Write};

/// Checks a record from its first byte to its last.
pub fn inspect(from: impl Read + Seek) -> Integrity {
    let mut reader = Reader::new(from).no_messages();
    reader.by_ref().for_each(drop);
    reader.integrity().clone()
}

/// What a recovery found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Recovery {
    /// The file is as it was written, and nothing was written. It may have been recovered before.
    Whole(Integrity),
    /// It was cut or damaged; a whole record of what it still held was written.
    Rewritten {
        /// Messages saved.
        messages: usize,
        /// What was damaged, and what is missing.
        found: Integrity,
    },
    /// Nothing of a record could be read.
    Nothing {
        /// What was found instead.
        found: Integrity,
    },
}

/// Reads a record and, unless it is whole, writes a whole one of what it still holds: every chunk, file and fact whose checksum
/// agrees, also behind a damaged stretch. It is read twice: what it holds is never in memory at once.
///
/// # Errors
/// Whatever the writer says.
pub fn recover(mut from: impl Read + Seek, to: impl Read + Write + Seek) -> Result<Recovery, McapError> {
    let (mut messages, mut facts) = (0, 0);
    let mut reader = Reader::new(&mut from);
    for entry in &mut reader {
        match entry {
            Entry::Message { .. } => messages += 1,
            Entry::Facts { .. } => facts += 1,
            Entry::File { .. } => {}
        }
    }
    let found = reader.integrity().clone();
    if found.intact() {
        return Ok(Recovery::Whole(found));
    }
    if messages + facts == 0 {
        return Ok(Recovery::Nothing { found });
    }
    from.rewind()?;
    rewrite(Reader::new(from), &found, to)?;
    Ok(Recovery::Rewritten { messages, found })
}

fn rewrite(
    entries: impl Iterator<Item = Entry>,
    found: &Integrity,
    to: impl Read + Write + Seek,
) -> Result<(), McapError> {
    let mut sink = Sink::begin(to)?;
    let mut findings = found.sentences().join("; ");
    for entry in entries {
        match entry {
            // One entry of findings: it includes those of an earlier recovery.
            Entry::Facts { name, facts } if name == RECOVERED => {
                findings.extend(facts.get("found").map(|before| format!("; before that: {before}")));
            }
            Entry::Facts { name, facts } => sink.facts(&name, facts)?,
            Entry::File { name, time_ns, bytes } => sink.attach(time_ns, &name, &bytes)?,
            // The numbers stay what they were: gaps in them go on telling what is missing.
            Entry::Message { topic, number, log_time, text } => {
                let kind = TOPICS.iter().position(|t| *t == topic).expect("the reader gives out no other");
                sink.message(kind, number, log_time, &text)?;
            }
        }
    }
    sink.facts(RECOVERED, BTreeMap::from([("found".to_string(), findings)]))?;
    sink.end()
}
