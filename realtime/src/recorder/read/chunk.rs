//! The messages of a chunk, none of them before its checksum was found to agree.

use super::{LONGEST, Wanted};
use crate::recorder::TOPICS;
use mcap::records::{ChunkHeader, Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use std::collections::{BTreeMap, VecDeque};
use std::io::Read;

/// A message of a chunk.
pub(super) struct Message {
    /// Place of its topic among [`TOPICS`].
    pub kind: usize,
    pub number: u32,
    pub log_time: u64,
    /// JSON text; `None` where nobody wants it.
    pub text: Option<Vec<u8>>,
}

/// All messages of a chunk with that `header` and those `records`, the whole of it being `body`.
pub(super) fn messages(
    header: &ChunkHeader,
    records: &[u8],
    body: &[u8],
    wanted: Wanted,
) -> Result<VecDeque<Message>, String> {
    if header.uncompressed_crc == 0 {
        return Err("a chunk has no checksum".into());
    }
    if header.compression.is_empty() && !fits(records) {
        return Err("the records of a chunk do not fit into it".into());
    }
    let mut framed = vec![op::CHUNK];
    framed.extend((body.len() as u64).to_le_bytes());
    framed.extend(body);
    let options = LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_skip_end_magic(true)
        .with_prevalidate_chunk_crcs(true)
        .with_record_length_limit(LONGEST as usize);
    let mut linear = LinearReader::new_with_options(options);
    let mut bytes = &framed[..];
    // The number of a channel is its topic's place, unless the chunk says otherwise: the chunk that names them may be damaged.
    let mut kinds: BTreeMap<u16, usize> = (1..).zip(0..TOPICS.len()).collect();
    let mut messages = VecDeque::new();
    while let Some(event) = linear.next_event() {
        match event.map_err(|e| e.to_string())? {
            LinearReadEvent::ReadRequest(length) => {
                let read = bytes.read(linear.insert(length)).map_err(|e| e.to_string())?;
                linear.notify_read(read);
            }
            LinearReadEvent::Record { opcode, data } => {
                match mcap::parse_record(opcode, data).map_err(|e| e.to_string())? {
                    Record::Channel(channel) => {
                        let kind = TOPICS.iter().position(|topic| *topic == channel.topic);
                        let unknown = || format!("no record has the topic '{}'", channel.topic);
                        kinds.insert(channel.id, kind.ok_or_else(unknown)?);
                    }
                    Record::Message { header, data } => {
                        let kind = *kinds.get(&header.channel_id).ok_or("a message is of no channel")?;
                        let give = match wanted {
                            Wanted::All => true,
                            Wanted::Only(topic) => topic == TOPICS[kind],
                            Wanted::None => false,
                        };
                        messages.push_back(Message {
                            kind,
                            number: header.sequence,
                            log_time: header.log_time,
                            text: give.then(|| data.into_owned()),
                        });
                    }
                    Record::Schema { .. } => {}
                    _ => return Err("a chunk holds what no chunk holds".into()),
                }
            }
        }
    }
    Ok(messages)
}

/// Whether the lengths of uncompressed records fill their chunk. The MCAP library (0.26) takes them as they
/// are, and counts below zero where one is too long.
fn fits(mut records: &[u8]) -> bool {
    while let Some((head, rest)) = records.split_first_chunk::<9>() {
        let length = u64::from_le_bytes(head[1..].try_into().expect("eight bytes"));
        let Some(rest) = usize::try_from(length).ok().and_then(|n| rest.get(n..)) else { return false };
        records = rest;
    }
    records.is_empty()
}
