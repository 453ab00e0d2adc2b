//! Reading a record that may have been cut anywhere, and making it whole.

use super::{CYCLES, EVENTS, PASSES};
use crate::turn::Row;
use mcap::records::{MessageHeader, Record};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{Attachment, Compression, McapError, WriteOptions, Writer};
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

/// Reads whatever a record still holds, in the order it was written. Never panics, never invents: a chunk whose
/// checksum fails ends the reading.
pub fn read(bytes: &[u8]) -> Contents {
    let mut contents = Contents::default();
    let mut topics: BTreeMap<u16, String> = BTreeMap::new();
    let options = LinearReaderOptions::default()
        .with_validate_chunk_crcs(true)
        .with_prevalidate_chunk_crcs(true)
        .with_record_length_limit(64 << 20);
    let mut reader = LinearReader::new_with_options(options);
    let mut rest = bytes;
    let mut ended = false;
    while let Some(event) = reader.next_event() {
        match event {
            Ok(LinearReadEvent::ReadRequest(wanted)) => {
                let n = wanted.min(rest.len());
                reader.insert(n).copy_from_slice(&rest[..n]);
                reader.notify_read(n);
                rest = &rest[n..];
            }
            Ok(LinearReadEvent::Record { opcode, data }) => match mcap::parse_record(opcode, data) {
                Ok(record) => {
                    ended |= matches!(record, Record::Footer(_));
                    take(&mut contents, &mut topics, record);
                }
                Err(error) => {
                    contents.cut = Some(error.to_string());
                    break;
                }
            },
            Err(error) => {
                contents.cut = Some(error.to_string());
                break;
            }
        }
    }
    if !ended && contents.cut.is_none() {
        contents.cut = Some("the file ends before its footer".into());
    }
    contents
}

fn take(contents: &mut Contents, topics: &mut BTreeMap<u16, String>, record: Record<'_>) {
    match record {
        Record::Channel(channel) => {
            topics.insert(channel.id, channel.topic);
        }
        Record::Message { header, data } => {
            let Some(topic) = topics.get(&header.channel_id) else {
                contents.damaged += 1;
                return;
            };
            if serde_json::from_slice::<serde::de::IgnoredAny>(&data).is_err() {
                contents.damaged += 1;
                return;
            }
            contents.messages.push((topic.clone(), header.log_time, data.into_owned()));
        }
        Record::Metadata(metadata) => contents.metadata.push((metadata.name, metadata.metadata)),
        Record::Attachment { header, data, .. } => contents.files.push((header.name, data.into_owned())),
        _ => {}
    }
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

/// Reads a record and, unless it is whole, writes a whole one of what it still holds.
///
/// # Errors
/// Whatever the writer says.
pub fn recover(bytes: &[u8], to: impl Write + Seek) -> Result<Recovery, McapError> {
    let contents = read(bytes);
    let Some(because) = contents.cut.clone() else {
        return Ok(Recovery::Whole);
    };
    if contents.messages.is_empty() && contents.metadata.is_empty() {
        return Ok(Recovery::Nothing { because });
    }
    rewrite(&contents, to)?;
    Ok(Recovery::Rewritten { messages: contents.messages.len(), damaged: contents.damaged, because })
}

fn rewrite(contents: &Contents, to: impl Write + Seek) -> Result<(), McapError> {
    let options =
        WriteOptions::new().compression(Some(Compression::Lz4)).profile("").library("muprime recover");
    let mut writer: Writer<_> = options.create(to)?;
    for (name, facts) in &contents.metadata {
        writer.write_metadata(&mcap::records::Metadata { name: name.clone(), metadata: facts.clone() })?;
    }
    for (name, data) in &contents.files {
        let attachment = Attachment {
            log_time: 0,
            create_time: 0,
            name: name.clone(),
            media_type: "text/plain".into(),
            data: Cow::Borrowed(data),
        };
        writer.attach(&attachment)?;
    }
    let mut channels: BTreeMap<&str, (u16, u32)> = BTreeMap::new();
    for (topic, log_time, data) in &contents.messages {
        if !channels.contains_key(topic.as_str()) {
            let name = format!("muprime{}", topic.replace('/', "."));
            let schema = writer.add_schema(&name, "jsonschema", b"{\"type\":\"object\"}")?;
            channels.insert(topic, (writer.add_channel(schema, topic, "json", &BTreeMap::new())?, 0));
        }
        let (channel_id, sequence) = channels.get_mut(topic.as_str()).expect("inserted above");
        *sequence += 1;
        let header = MessageHeader {
            channel_id: *channel_id,
            sequence: *sequence,
            log_time: *log_time,
            publish_time: *log_time,
        };
        writer.write_to_known_channel(&header, data)?;
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
        let mut bytes = Cursor::new(Vec::new());
        rewrite(self, &mut bytes)?;
        Ok(bytes.into_inner())
    }
}
