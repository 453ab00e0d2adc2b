//! Reading a record from its beginning, entry by entry, in memory that does not depend on its length.

use mcap::records::Record;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use std::collections::BTreeMap;
use std::io::Read;

/// Something that a record holds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Entry {
    /// A metadata record.
    Facts {
        /// Its name.
        name: String,
        /// What it says.
        facts: BTreeMap<String, String>,
    },
    /// An attached file.
    File {
        /// Its name.
        name: String,
        /// Its contents.
        bytes: Vec<u8>,
    },
    /// A message.
    Message {
        /// Its topic.
        topic: String,
        /// Log time in ns since 1970.
        log_time: u64,
        /// JSON text.
        text: Vec<u8>,
    },
}

/// Reads whatever a record still holds, in the order it was written. Never panics, never invents: a chunk whose checksum
/// fails ends the reading.
pub struct Reader<R> {
    from: R,
    linear: LinearReader,
    channels: BTreeMap<u16, String>,
    only: Option<&'static str>,
    ended: bool,
    /// Nothing more comes.
    over: bool,
    cut: Option<String>,
    damaged: u64,
}

impl<R: Read> Reader<R> {
    /// A reader at the beginning of a record.
    pub fn new(from: R) -> Self {
        let options = LinearReaderOptions::default()
            .with_validate_chunk_crcs(true)
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(64 << 20);
        Reader {
            from,
            linear: LinearReader::new_with_options(options),
            channels: BTreeMap::new(),
            only: None,
            ended: false,
            over: false,
            cut: None,
            damaged: 0,
        }
    }

    /// Passes over messages of other topics than `topic`, unseen.
    #[must_use]
    pub fn only(mut self, topic: &'static str) -> Self {
        self.only = Some(topic);
        self
    }

    /// Why reading ended before a proper end, if it did; known once there are no more entries.
    pub fn cut(&self) -> Option<&str> {
        self.cut.as_deref()
    }

    /// Messages so far that are no longer what was written (their JSON does not parse): dropped and counted.
    pub fn damaged(&self) -> u64 {
        self.damaged
    }
}

impl<R: Read> Iterator for Reader<R> {
    type Item = Entry;

    fn next(&mut self) -> Option<Entry> {
        while !self.over {
            match self.linear.next_event() {
                None => {
                    self.over = true;
                    if !self.ended {
                        self.cut = Some("the file ends before its footer".into());
                    }
                }
                Some(Ok(LinearReadEvent::ReadRequest(wanted))) => {
                    match self.from.read(self.linear.insert(wanted)) {
                        Ok(n) => self.linear.notify_read(n),
                        Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {
                            self.linear.notify_read(0);
                        }
                        Err(error) => (self.over, self.cut) = (true, Some(error.to_string())),
                    }
                }
                Some(Ok(LinearReadEvent::Record { opcode, data })) => {
                    match mcap::parse_record(opcode, data) {
                        Ok(Record::Footer(_)) => self.ended = true,
                        Ok(record) => {
                            let entry = taken(&mut self.channels, self.only, &mut self.damaged, record);
                            if entry.is_some() {
                                return entry;
                            }
                        }
                        Err(error) => (self.over, self.cut) = (true, Some(error.to_string())),
                    }
                }
                Some(Err(error)) => (self.over, self.cut) = (true, Some(error.to_string())),
            }
        }
        None
    }
}

fn taken(
    channels: &mut BTreeMap<u16, String>,
    only: Option<&str>,
    damaged: &mut u64,
    record: Record<'_>,
) -> Option<Entry> {
    match record {
        Record::Channel(channel) => {
            channels.insert(channel.id, channel.topic);
        }
        Record::Message { header, data } => {
            let topic = channels.get(&header.channel_id);
            if only.is_some_and(|only| topic.is_some_and(|t| t != only)) {
                return None;
            }
            match topic {
                Some(topic) if serde_json::from_slice::<serde::de::IgnoredAny>(&data).is_ok() => {
                    let (topic, log_time) = (topic.clone(), header.log_time);
                    return Some(Entry::Message { topic, log_time, text: data.into_owned() });
                }
                _ => *damaged += 1,
            }
        }
        Record::Metadata(metadata) => {
            return Some(Entry::Facts { name: metadata.name, facts: metadata.metadata });
        }
        Record::Attachment { header, data, .. } => {
            return Some(Entry::File { name: header.name, bytes: data.into_owned() });
        }
        _ => {}
    }
    None
}
