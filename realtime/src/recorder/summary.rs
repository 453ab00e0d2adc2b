//! The end of a record: the indexes by which an ordinary reader finds its way, and the footer.
//!
//! They are read back from the file, a few thousand at a time: in memory they would grow with the run.
//! Format: MCAP specification 0, "Summary section" (<https://mcap.dev/spec>).

use super::{TOPICS, schema};
use binrw::{BinRead, BinWrite};
use mcap::records::{
    AttachmentIndex, Channel, ChunkHeader, ChunkIndex, DataEnd, Footer, MetadataIndex, Record, SchemaHeader,
    Statistics, SummaryOffset, op,
};
use mcap::{MAGIC, McapError};
use std::collections::BTreeMap;
use std::io::{BufReader, Cursor, Read, Seek, SeekFrom, Write};

/// Bytes of index entries that are held before they are written.
const HELD: usize = 256 * 1024;
/// Length of an opcode and the length that follows it.
const HEAD: u64 = 9;

/// Appends a record to `to`.
fn put(opcode: u8, record: impl for<'a> BinWrite<Args<'a> = ()>, more: &[u8], to: &mut Vec<u8>) {
    let mut body = Cursor::new(Vec::new());
    record.write_le(&mut body).expect("memory takes every record");
    let body = body.into_inner();
    to.push(opcode);
    to.extend(((body.len() + more.len()) as u64).to_le_bytes());
    to.extend([&body, more].concat());
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
    fn chunk(&mut self, file: &mut (impl Read + Seek), length: u64) -> Result<u64, McapError> {
        let head = ChunkHeader::read_le(file)?;
        let taken = 40 + head.compression.len() as u64;
        self.chunk = Some(ChunkIndex {
            message_start_time: head.message_start_time,
            message_end_time: head.message_end_time,
            chunk_start_offset: self.at,
            chunk_length: length,
            message_index_offsets: BTreeMap::new(),
            message_index_length: 0,
            compression: head.compression,
            compressed_size: head.compressed_size,
            uncompressed_size: head.uncompressed_size,
        });
        self.counts.chunk_count += 1;
        Ok(taken)
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
        let offset = self.at;
        match record {
            Record::Attachment { header, data, .. } => {
                self.counts.attachment_count += 1;
                let index = AttachmentIndex {
                    offset,
                    length,
                    log_time: header.log_time,
                    create_time: header.create_time,
                    data_size: data.len() as u64,
                    name: header.name,
                    media_type: header.media_type,
                };
                put(op::ATTACHMENT_INDEX, index, &[], &mut self.others[0]);
            }
            Record::Metadata(metadata) => {
                self.counts.metadata_count += 1;
                let index = MetadataIndex { offset, length, name: metadata.name };
                put(op::METADATA_INDEX, index, &[], &mut self.others[1]);
            }
            _ => {}
        }
    }

    fn close(&mut self, held: &mut Vec<u8>) {
        if let Some(chunk) = self.chunk.take() {
            put(op::CHUNK_INDEX, chunk, &[], held);
        }
    }
}

/// What is written of the summary, with its checksum and where its groups are.
struct SummarySection<'a, F> {
    file: &'a mut F,
    start: u64,
    at: u64,
    checksum: crc32fast::Hasher,
    offsets: Vec<u8>,
}

impl<F: Read + Write + Seek> SummarySection<'_, F> {
    fn write(&mut self, bytes: &[u8]) -> Result<(), McapError> {
        self.file.seek(SeekFrom::Start(self.at))?;
        self.file.write_all(bytes)?;
        self.checksum.update(bytes);
        self.at += bytes.len() as u64;
        Ok(())
    }

    /// Notes that everything since `from` is of one kind.
    fn group(&mut self, group_opcode: u8, group_start: u64) {
        if self.at > group_start {
            let group = SummaryOffset { group_opcode, group_start, group_length: self.at - group_start };
            put(op::SUMMARY_OFFSET, group, &[], &mut self.offsets);
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
    put(op::DATA_END, DataEnd { data_section_crc: data_crc }, &[], &mut mark);
    file.write_all(&mark)?;
    let start = end + mark.len() as u64;
    let checksum = crc32fast::Hasher::new();
    let mut summary = SummarySection { file, start, at: start, checksum, offsets: Vec::new() };
    let (mut schemas, mut channels) = (Vec::new(), Vec::new());
    for (kind, topic) in TOPICS.into_iter().enumerate() {
        let id = kind as u16 + 1;
        let (name, encoding) = (schema::name_of(topic).to_string(), schema::ENCODING.to_string());
        let data = schema::of(kind);
        let sized = [&(data.len() as u32).to_le_bytes(), data].concat();
        put(op::SCHEMA, SchemaHeader { id, name, encoding }, &sized, &mut schemas);
        let (message_encoding, metadata) = ("json".to_string(), BTreeMap::new());
        let channel = Channel { id, schema_id: id, topic: topic.to_string(), message_encoding, metadata };
        put(op::CHANNEL, channel, &[], &mut channels);
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
    let topics = TOPICS.len();
    let counts = Statistics { schema_count: topics as u16, channel_count: topics as u32, ..counts };
    put(op::STATISTICS, counts, &[], &mut statistics);
    summary.write_group(op::STATISTICS, &statistics)?;
    footer(summary)
}

fn footer<F: Read + Write + Seek>(mut summary: SummarySection<'_, F>) -> Result<(), McapError> {
    let offsets_start = summary.at;
    let offsets = std::mem::take(&mut summary.offsets);
    summary.write(&offsets)?;
    // The checksum covers the footer up to itself.
    let mut footer = Vec::new();
    let (summary_start, summary_offset_start) = (summary.start, offsets_start);
    put(op::FOOTER, Footer { summary_start, summary_offset_start, summary_crc: 0 }, &[], &mut footer);
    footer.truncate(footer.len() - 4);
    summary.write(&footer)?;
    let checksum = summary.checksum.clone().finalize();
    summary.file.write_all(&checksum.to_le_bytes())?;
    summary.file.write_all(MAGIC)?;
    Ok(summary.file.flush()?)
}
