//! The end of a record: the indexes by which an ordinary reader finds its way, and the footer.
//!
//! They are read back from the file, a few thousand at a time: in memory they would grow with the run.
//! Format: MCAP specification 0, "Summary section" (<https://mcap.dev/spec>).

use super::{TOPICS, schema};
use mcap::records::{ChunkIndex, Record, Statistics, op};
use mcap::{MAGIC, McapError};
use std::collections::BTreeMap;
use std::io::{BufReader, Read, Seek, SeekFrom, Write};

/// Bytes of index entries that are held before they are written.
const HELD: usize = 256 * 1024;
/// Length of an opcode and the length that follows it.
const HEAD: u64 = 9;

/// Bytes in the order of the format: little-endian, lengths before contents.
#[derive(Default)]
struct Bytes(Vec<u8>);

impl Bytes {
    fn u16(mut self, value: u16) -> Self {
        self.0.extend(value.to_le_bytes());
        self
    }
    fn u32(mut self, value: u32) -> Self {
        self.0.extend(value.to_le_bytes());
        self
    }
    fn u64(mut self, value: u64) -> Self {
        self.0.extend(value.to_le_bytes());
        self
    }
    fn text(mut self, value: &[u8]) -> Self {
        self = self.u32(value.len() as u32);
        self.0.extend(value);
        self
    }
    fn map(mut self, of: &BTreeMap<u16, u64>) -> Self {
        self = self.u32(10 * of.len() as u32);
        of.iter().fold(self, |bytes, (key, value)| bytes.u16(*key).u64(*value))
    }
    /// Appends these bytes to `to` as a record.
    fn record(self, opcode: u8, to: &mut Vec<u8>) {
        to.push(opcode);
        to.extend((self.0.len() as u64).to_le_bytes());
        to.extend(self.0);
    }
}

/// The file from its beginning up to its data's end, record by record.
struct Walk {
    at: u64,
    end: u64,
    counts: Statistics,
    chunk: Option<ChunkIndex>,
    /// Index entries of attachments and of metadata: a handful.
    others: [Vec<u8>; 2],
}

impl Walk {
    /// Reads on until the index entries fill `held`, or to the data's end. False: it is reached.
    fn on(&mut self, file: &mut (impl Read + Seek), held: &mut Vec<u8>) -> Result<bool, McapError> {
        file.seek(SeekFrom::Start(self.at))?;
        let mut file = BufReader::with_capacity(4096, file);
        while self.at < self.end && held.len() < HELD {
            let mut head = [0; HEAD as usize];
            file.read_exact(&mut head)?;
            let body = u64::from_le_bytes(head[1..].try_into().expect("eight bytes"));
            let length = HEAD + body;
            let read = match head[0] {
                op::CHUNK => {
                    self.close(held);
                    self.chunk(&mut file, length)?
                }
                op::MESSAGE_INDEX => self.message_index(&mut file, length)?,
                op::ATTACHMENT | op::METADATA => {
                    let mut data = vec![0; body as usize];
                    file.read_exact(&mut data)?;
                    self.other(mcap::parse_record(head[0], &data)?, length);
                    body
                }
                _ => 0,
            };
            // Within the buffer where it can be: most records are longer than it, and are skipped.
            file.seek_relative((body - read) as i64)?;
            self.at += length;
        }
        let more = self.at < self.end;
        if !more {
            self.close(held);
        }
        Ok(more)
    }

    /// Reads a chunk's head; returns how many bytes that took.
    fn chunk(&mut self, file: &mut impl Read, length: u64) -> Result<u64, McapError> {
        // First and last log time, uncompressed size, its checksum, length of the compression's name.
        let mut head = [0; 32];
        file.read_exact(&mut head)?;
        let number = |at: usize| u64::from_le_bytes(head[at..at + 8].try_into().expect("eight bytes"));
        let name = u32::from_le_bytes(head[28..].try_into().expect("four bytes"));
        let mut compression = vec![0; name as usize];
        file.read_exact(&mut compression)?;
        let compression = String::from_utf8_lossy(&compression).into_owned();
        let mut compressed = [0; 8];
        file.read_exact(&mut compressed)?;
        self.chunk = Some(ChunkIndex {
            message_start_time: number(0),
            message_end_time: number(8),
            chunk_start_offset: self.at,
            chunk_length: length,
            message_index_offsets: BTreeMap::new(),
            message_index_length: 0,
            compression,
            compressed_size: u64::from_le_bytes(compressed),
            uncompressed_size: number(16),
        });
        self.counts.chunk_count += 1;
        Ok(40 + u64::from(name))
    }

    /// Reads of which channel an index of messages is, and how many it lists; returns how many bytes that took.
    fn message_index(&mut self, file: &mut impl Read, length: u64) -> Result<u64, McapError> {
        let mut head = [0; 6];
        file.read_exact(&mut head)?;
        let channel = u16::from_le_bytes([head[0], head[1]]);
        let bytes = u32::from_le_bytes(head[2..].try_into().expect("four bytes"));
        if let Some(chunk) = &mut self.chunk {
            chunk.message_index_offsets.insert(channel, self.at);
            chunk.message_index_length += length;
            let counts = &mut self.counts;
            if counts.message_count == 0 {
                counts.message_start_time = chunk.message_start_time;
            }
            counts.message_start_time = counts.message_start_time.min(chunk.message_start_time);
            counts.message_end_time = counts.message_end_time.max(chunk.message_end_time);
            // Each entry: log time and offset.
            let count = u64::from(bytes / 16);
            counts.message_count += count;
            *counts.channel_message_counts.entry(channel).or_default() += count;
        }
        Ok(6)
    }

    fn other(&mut self, record: Record<'_>, length: u64) {
        let place = Bytes::default().u64(self.at).u64(length);
        match record {
            Record::Attachment { header, data, .. } => {
                self.counts.attachment_count += 1;
                place
                    .u64(header.log_time)
                    .u64(header.create_time)
                    .u64(data.len() as u64)
                    .text(header.name.as_bytes())
                    .text(header.media_type.as_bytes())
                    .record(op::ATTACHMENT_INDEX, &mut self.others[0]);
            }
            Record::Metadata(metadata) => {
                self.counts.metadata_count += 1;
                place.text(metadata.name.as_bytes()).record(op::METADATA_INDEX, &mut self.others[1]);
            }
            _ => {}
        }
    }

    fn close(&mut self, held: &mut Vec<u8>) {
        let Some(chunk) = self.chunk.take() else { return };
        Bytes::default()
            .u64(chunk.message_start_time)
            .u64(chunk.message_end_time)
            .u64(chunk.chunk_start_offset)
            .u64(chunk.chunk_length)
            .map(&chunk.message_index_offsets)
            .u64(chunk.message_index_length)
            .text(chunk.compression.as_bytes())
            .u64(chunk.compressed_size)
            .u64(chunk.uncompressed_size)
            .record(op::CHUNK_INDEX, held);
    }
}

/// What is written of the summary, with its checksum and where its groups are.
struct Summary<'a, F> {
    file: &'a mut F,
    start: u64,
    at: u64,
    checksum: crc32fast::Hasher,
    offsets: Vec<u8>,
}

impl<F: Read + Write + Seek> Summary<'_, F> {
    fn write(&mut self, bytes: &[u8]) -> Result<(), McapError> {
        self.file.seek(SeekFrom::Start(self.at))?;
        self.file.write_all(bytes)?;
        self.checksum.update(bytes);
        self.at += bytes.len() as u64;
        Ok(())
    }

    /// Notes that everything since `from` is of one kind.
    fn group(&mut self, opcode: u8, from: u64) {
        if self.at > from {
            let group = Bytes(vec![opcode]).u64(from).u64(self.at - from);
            group.record(op::SUMMARY_OFFSET, &mut self.offsets);
        }
    }

    fn write_group(&mut self, opcode: u8, bytes: &[u8]) -> Result<(), McapError> {
        let from = self.at;
        self.write(bytes)?;
        self.group(opcode, from);
        Ok(())
    }
}

/// Ends a file whose data, of that checksum, is complete: mark of its end, summary, footer.
pub(super) fn end(file: &mut (impl Read + Write + Seek), data_crc: u32) -> Result<(), McapError> {
    let end = file.seek(SeekFrom::End(0))?;
    let mut mark = Vec::new();
    Bytes::default().u32(data_crc).record(op::DATA_END, &mut mark);
    file.write_all(&mark)?;
    let start = end + mark.len() as u64;
    let checksum = crc32fast::Hasher::new();
    let mut summary = Summary { file, start, at: start, checksum, offsets: Vec::new() };
    let (mut schemas, mut channels) = (Vec::new(), Vec::new());
    for (kind, topic) in TOPICS.into_iter().enumerate() {
        let id = kind as u16 + 1;
        Bytes::default()
            .u16(id)
            .text(schema::name_of(topic).as_bytes())
            .text(schema::ENCODING.as_bytes())
            .text(schema::of(kind))
            .record(op::SCHEMA, &mut schemas);
        let channel = Bytes::default().u16(id).u16(id).text(topic.as_bytes()).text(b"json");
        channel.u32(0).record(op::CHANNEL, &mut channels);
    }
    summary.write_group(op::SCHEMA, &schemas)?;
    summary.write_group(op::CHANNEL, &channels)?;

    let at = MAGIC.len() as u64;
    let mut walk = Walk { at, end, counts: Statistics::default(), chunk: None, others: Default::default() };
    let from = summary.at;
    let mut held = Vec::with_capacity(HELD + 1024);
    loop {
        held.clear();
        let more = walk.on(summary.file, &mut held)?;
        summary.write(&held)?;
        if !more {
            break;
        }
    }
    summary.group(op::CHUNK_INDEX, from);
    let Walk { counts, others: [attachments, metadata], .. } = walk;
    summary.write_group(op::ATTACHMENT_INDEX, &attachments)?;
    summary.write_group(op::METADATA_INDEX, &metadata)?;
    let mut statistics = Vec::new();
    Bytes::default()
        .u64(counts.message_count)
        .u16(TOPICS.len() as u16)
        .u32(TOPICS.len() as u32)
        .u32(counts.attachment_count)
        .u32(counts.metadata_count)
        .u32(counts.chunk_count)
        .u64(counts.message_start_time)
        .u64(counts.message_end_time)
        .map(&counts.channel_message_counts)
        .record(op::STATISTICS, &mut statistics);
    summary.write_group(op::STATISTICS, &statistics)?;
    footer(summary)
}

fn footer<F: Read + Write + Seek>(mut summary: Summary<'_, F>) -> Result<(), McapError> {
    let offsets_start = summary.at;
    let offsets = std::mem::take(&mut summary.offsets);
    summary.write(&offsets)?;
    // The checksum covers the footer up to itself.
    let mut footer = Vec::new();
    Bytes::default().u64(summary.start).u64(offsets_start).u32(0).record(op::FOOTER, &mut footer);
    footer.truncate(footer.len() - 4);
    summary.write(&footer)?;
    let checksum = summary.checksum.clone().finalize();
    summary.file.write_all(&checksum.to_le_bytes())?;
    summary.file.write_all(MAGIC)?;
    Ok(summary.file.flush()?)
}
