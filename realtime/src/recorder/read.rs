//! Reading a record from its beginning, entry by entry, in memory that does not depend on its length.

use mcap::records::{Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use std::collections::BTreeMap;
use std::io::{Cursor, Read};

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
    /// The chunk that is being read.
    chunk: Option<Box<Chunk>>,
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
        let options = LinearReaderOptions::default().with_emit_chunks(true).with_record_length_limit(LONGEST);
        Reader {
            from,
            linear: LinearReader::new_with_options(options),
            chunk: None,
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
            let inside = self.chunk.is_some();
            let (linear, from): (_, &mut dyn Read) = match &mut self.chunk {
                Some(chunk) => (&mut chunk.linear, &mut chunk.bytes),
                None => (&mut self.linear, &mut self.from),
            };
            let step = match linear.next_event() {
                None => Step::End,
                Some(Ok(LinearReadEvent::ReadRequest(wanted))) => match some(from, linear.insert(wanted)) {
                    Ok(n) => {
                        linear.notify_read(n);
                        Step::On
                    }
                    Err(error) => Step::Wrong(error.to_string()),
                },
                Some(Ok(LinearReadEvent::Record { opcode: op::ATTACHMENT, data })) if !ends(data) => {
                    Step::Wrong("an attachment is shorter than its own head".into())
                }
                Some(Ok(LinearReadEvent::Record { opcode, data })) => {
                    match mcap::parse_record(opcode, data) {
                        // A chunk within a chunk is nothing that is written.
                        Ok(Record::Chunk { header, data: records }) if !inside => {
                            if header.compression.is_empty() && !fits(&records) {
                                Step::Wrong("the records of a chunk do not fit into it".into())
                            } else {
                                Step::Chunk(Box::new(Chunk::of(opcode, data)))
                            }
                        }
                        Ok(Record::Footer(_)) if !inside => Step::Footer,
                        Ok(record) => taken(&mut self.channels, self.only, &mut self.damaged, record)
                            .map_or(Step::On, Step::Found),
                        Err(error) => Step::Wrong(error.to_string()),
                    }
                }
                Some(Err(error)) => Step::Wrong(error.to_string()),
            };
            match step {
                Step::On => {}
                Step::Found(entry) => return Some(entry),
                Step::Chunk(chunk) => self.chunk = Some(chunk),
                Step::Footer => self.ended = true,
                Step::End if inside => self.chunk = None,
                Step::End => {
                    self.over = true;
                    if !self.ended {
                        self.cut = Some("the file ends before its footer".into());
                    }
                }
                Step::Wrong(why) => (self.over, self.cut) = (true, Some(why)),
            }
        }
        None
    }
}

/// What reading on led to.
enum Step {
    On,
    Found(Entry),
    Chunk(Box<Chunk>),
    Footer,
    End,
    Wrong(String),
}

/// Reads what there is, whatever signals come.
fn some(from: &mut dyn Read, into: &mut [u8]) -> std::io::Result<usize> {
    loop {
        match from.read(into) {
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
            other => return other,
        }
    }
}

/// Longest record that is read, in bytes.
const LONGEST: usize = 64 << 20;

/// A chunk, read as a file of one record.
struct Chunk {
    linear: LinearReader,
    bytes: Cursor<Vec<u8>>,
}

impl Chunk {
    fn of(opcode: u8, body: &[u8]) -> Self {
        let mut bytes = vec![opcode];
        bytes.extend((body.len() as u64).to_le_bytes());
        bytes.extend(body);
        let options = LinearReaderOptions::default()
            .with_skip_start_magic(true)
            .with_skip_end_magic(true)
            .with_validate_chunk_crcs(true)
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(LONGEST);
        Chunk { linear: LinearReader::new_with_options(options), bytes: Cursor::new(bytes) }
    }
}

/// Whether the lengths of uncompressed records fill their chunk. The MCAP library (0.26) takes them as they are, and counts
/// below zero where one is too long.
fn fits(mut records: &[u8]) -> bool {
    while let Some((head, rest)) = records.split_first_chunk::<9>() {
        let length =
            u64::from_le_bytes([head[1], head[2], head[3], head[4], head[5], head[6], head[7], head[8]]);
        let Some(rest) = usize::try_from(length).ok().and_then(|n| rest.get(n..)) else { return false };
        records = rest;
    }
    records.is_empty()
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

/// Whether an attachment has room for its length and its checksum behind its times, its name and its kind. The MCAP library
/// (0.26) takes that for granted.
fn ends(attachment: &[u8]) -> bool {
    let after_text = |at: usize| {
        let length = attachment.get(at..)?.first_chunk::<4>()?;
        (at + 4).checked_add(u32::from_le_bytes(*length) as usize)
    };
    let head = after_text(16).and_then(after_text);
    head.and_then(|head| head.checked_add(8 + 4)).is_some_and(|least| least <= attachment.len())
}

#[cfg(test)]
mod tests {
    use super::*;
    use mcap::{WriteOptions, records::MessageHeader};

    /// An uncompressed chunk, with its checksum or without, and where its message's length stands.
    fn uncompressed(checksum: bool) -> (Vec<u8>, usize) {
        let options = WriteOptions::new().compression(None).calculate_chunk_crcs(checksum);
        let mut writer = options.create(Cursor::new(Vec::new())).unwrap();
        let channel = writer.add_channel(0, "/cycle", "json", &BTreeMap::new()).unwrap();
        let header = MessageHeader { channel_id: channel, sequence: 1, log_time: 2, publish_time: 2 };
        writer.write_to_known_channel(&header, b"{\"a\":1}").unwrap();
        writer.finish().unwrap();
        let bytes = writer.into_inner().into_inner();
        let body = bytes.windows(7).position(|w| w == b"{\"a\":1}").unwrap();
        // Opcode and length, then 22 bytes of header.
        (bytes, body - 30)
    }

    fn read(bytes: &[u8]) -> (usize, Option<String>) {
        let mut reader = Reader::new(bytes);
        let messages = reader.by_ref().filter(|e| matches!(e, Entry::Message { .. })).count();
        (messages, reader.cut().map(str::to_string))
    }

    /// Found by coverage-guided fuzzing.
    #[test]
    fn a_record_that_is_longer_than_its_chunk_ends_the_reading() {
        for checksum in [true, false] {
            let (mut bytes, length) = uncompressed(checksum);
            assert_eq!(read(&bytes), (1, None));
            bytes[length] += 1;
            let (messages, cut) = read(&bytes);
            assert_eq!((messages, cut.unwrap().contains("do not fit")), (0, true));
        }
    }

    /// Found by coverage-guided fuzzing.
    #[test]
    fn an_attachment_that_is_shorter_than_its_head_ends_the_reading() {
        let attachment = |length: usize| {
            // Times, an empty name, an empty kind, no data, no checksum.
            let head = [&[op::ATTACHMENT][..], &(length as u64).to_le_bytes()].concat();
            [mcap::MAGIC, &head, &vec![0; length]].concat()
        };
        let empty = Entry::File { name: String::new(), bytes: Vec::new() };
        assert_eq!(Reader::new(&attachment(36)[..]).next(), Some(empty));
        for length in 0..36 {
            let bytes = attachment(length);
            let mut reader = Reader::new(&bytes[..]);
            assert_eq!(reader.next(), None, "{length}");
            assert!(reader.cut().is_some_and(|why| why.contains("shorter than its own head")), "{length}");
        }
    }
}
