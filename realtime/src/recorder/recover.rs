//! Reading a record that may have been cut anywhere, and making it whole.

use super::{CYCLES, ENCODING, EVENTS, Entry, PASSES, Reader, SCHEMA, schema_name};
use crate::turn::Row;
use mcap::records::MessageHeader;
use mcap::{Attachment, Compression, McapError, WriteOptions};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::{Cursor, Seek, Write};

/// What could be read of a record.
#[derive(Clone, Debug, Default)]
pub struct Contents {
    /// Metadata by name, in order.
    pub metadata: Vec<(String, BTreeMap<String, String>)>,
    /// Attached files: name and bytes.
    pub files: Vec<(String, Vec<u8>)>,
    /// Messages in order: topic, log time in ns since 1970, JSON text.
    pub messages: Vec<(String, u64, Vec<u8>)>,
    /// Why reading ended before a proper end, if it did.
    pub cut: Option<String>,
    /// Messages that are no longer what was written (their JSON does not parse): dropped and counted.
    pub damaged: u64,
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
    let mut reader = Reader::new(bytes);
    for entry in &mut reader {
        match entry {
            Entry::Facts { name, facts } => contents.metadata.push((name, facts)),
            Entry::File { name, bytes } => contents.files.push((name, bytes)),
            Entry::Message { topic, log_time, text } => contents.messages.push((topic, log_time, text)),
        }
    }
    contents.cut = reader.cut().map(str::to_string);
    contents.damaged = reader.damaged();
    contents
}

/// What a recovery found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Recovery {
    /// The record was whole: nothing was written.
    Whole,
    /// It was cut or damaged; a whole record of what it still held was written.
    Rewritten {
        /// Messages saved.
        messages: usize,
        /// Messages that were no longer what was written.
        damaged: u64,
        /// Why reading ended.
        because: String,
    },
    /// Nothing of a record could be read.
    Nothing {
        /// Why.
        because: String,
    },
}

/// Reads a record and, unless it is whole, writes a whole one of what it still holds. It is read twice: what it holds is never
/// in memory at once.
///
/// # Errors
/// Whatever the writer says.
pub fn recover(bytes: &[u8], to: impl Write + Seek) -> Result<Recovery, McapError> {
    let (mut messages, mut facts) = (0, 0);
    let mut reader = Reader::new(bytes);
    for entry in &mut reader {
        match entry {
            Entry::Message { .. } => messages += 1,
            Entry::Facts { .. } => facts += 1,
            Entry::File { .. } => {}
        }
    }
    let Some(because) = reader.cut().map(str::to_string) else {
        return Ok(Recovery::Whole);
    };
    if messages + facts == 0 {
        return Ok(Recovery::Nothing { because });
    }
    rewrite(Reader::new(bytes), to)?;
    Ok(Recovery::Rewritten { messages, damaged: reader.damaged(), because })
}

fn rewrite(entries: impl Iterator<Item = Entry>, to: impl Write + Seek) -> Result<(), McapError> {
    let options =
        WriteOptions::new().compression(Some(Compression::Lz4)).profile("").library("muprime recover");
    let mut writer = options.create(to)?;
    let mut channels: BTreeMap<String, (u16, u32)> = BTreeMap::new();
    for entry in entries {
        match entry {
            Entry::Facts { name, facts: metadata } => {
                writer.write_metadata(&mcap::records::Metadata { name, metadata })?;
            }
            Entry::File { name, bytes } => writer.attach(&Attachment {
                log_time: 0,
                create_time: 0,
                name,
                media_type: "text/plain".into(),
                data: Cow::Owned(bytes),
            })?,
            Entry::Message { topic, log_time, text } => {
                if !channels.contains_key(&topic) {
                    let schema = writer.add_schema(&schema_name(&topic), ENCODING, SCHEMA)?;
                    let channel = writer.add_channel(schema, &topic, "json", &BTreeMap::new())?;
                    channels.insert(topic.clone(), (channel, 0));
                }
                let (channel_id, sequence) = channels.get_mut(&topic).expect("inserted above");
                *sequence += 1;
                let header = MessageHeader {
                    channel_id: *channel_id,
                    sequence: *sequence,
                    log_time,
                    publish_time: log_time,
                };
                writer.write_to_known_channel(&header, &text)?;
            }
        }
    }
    writer.finish()?;
    Ok(())
}

/// A record in memory, for tests and conversions.
impl Contents {
    /// These contents as a whole record.
    ///
    /// # Errors
    /// Whatever the MCAP writer says.
    pub fn to_bytes(&self) -> Result<Vec<u8>, McapError> {
        let facts = self.metadata.iter().cloned().map(|(name, facts)| Entry::Facts { name, facts });
        let files = self.files.iter().cloned().map(|(name, bytes)| Entry::File { name, bytes });
        let messages = self.messages.iter().cloned();
        let messages = messages.map(|(topic, log_time, text)| Entry::Message { topic, log_time, text });
        let mut bytes = Cursor::new(Vec::new());
        rewrite(facts.chain(files).chain(messages), &mut bytes)?;
        Ok(bytes.into_inner())
    }
}
