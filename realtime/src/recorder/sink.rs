//! Records of the format, in the order in which they go into a file, with their checksums.

use super::{CHECKSUM, CHUNK, TOPICS, schema, summary};
use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, Compression, McapError, WriteOptions, Writer};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::{Cursor, Read, Seek, Write};

/// Writes into memory, from which whole pieces go to the file.
type Piece = Writer<Cursor<Vec<u8>>>;

/// A new piece; what it begins with, magic and header, belongs only at the beginning of a file.
fn piece() -> Result<Piece, McapError> {
    let options = WriteOptions::new()
        .compression(Some(Compression::Lz4))
        .chunk_size(None)
        .calculate_data_section_crc(false)
        .profile("")
        .library("muprime");
    options.create(Cursor::new(Vec::new()))
}

/// What a piece holds. Its chunk, if it has one, must be finished: a `flush` or a metadata record does that.
fn bytes_of(piece: Piece) -> Vec<u8> {
    piece.into_inner().into_inner()
}

/// Checksum of a metadata record: its name and every fact but the checksum itself, each with its length before it.
pub(super) fn checksum_of(name: &str, facts: &BTreeMap<String, String>) -> String {
    let mut checksum = crc32fast::Hasher::new();
    let others = facts.iter().filter(|(key, _)| *key != CHECKSUM);
    for text in std::iter::once(name).chain(others.flat_map(|(key, value)| [key.as_str(), value])) {
        checksum.update(&(text.len() as u64).to_le_bytes());
        checksum.update(text.as_bytes());
    }
    format!("{:08x}", checksum.finalize())
}

/// A file that is being written.
pub(super) struct Sink<W> {
    to: W,
    /// Of all bytes so far.
    checksum: crc32fast::Hasher,
    /// Length of what every piece begins with.
    head: usize,
    /// Length of what the piece of every chunk begins with: that, and the chunk that names the topics.
    named: usize,
    chunk: Option<Piece>,
    /// Bytes of the messages in the present chunk.
    filled: usize,
}

impl<W: Write> Sink<W> {
    pub fn begin(to: W) -> Result<Self, McapError> {
        let head = bytes_of(piece()?);
        let checksum = crc32fast::Hasher::new();
        let named = bytes_of(open_chunk()?);
        let mut sink = Sink { to, checksum, head: head.len(), named: named.len(), chunk: None, filled: 0 };
        sink.put(&named)?;
        Ok(sink)
    }

    fn put(&mut self, bytes: &[u8]) -> Result<(), McapError> {
        self.checksum.update(bytes);
        Ok(self.to.write_all(bytes)?)
    }

    pub fn facts(&mut self, name: &str, mut facts: BTreeMap<String, String>) -> Result<(), McapError> {
        self.close_chunk()?;
        facts.insert(CHECKSUM.into(), checksum_of(name, &facts));
        let mut piece = piece()?;
        piece.write_metadata(&Metadata { name: name.into(), metadata: facts })?;
        self.put(&bytes_of(piece)[self.head..])
    }

    pub fn attach(&mut self, time_ns: u64, name: &str, bytes: &[u8]) -> Result<(), McapError> {
        self.close_chunk()?;
        let mut piece = piece()?;
        piece.attach(&Attachment {
            log_time: time_ns,
            create_time: time_ns,
            name: name.into(),
            media_type: "text/plain".into(),
            data: Cow::Borrowed(bytes),
        })?;
        self.put(&bytes_of(piece)[self.head..])
    }

    /// A message of the `kind`-th topic.
    pub fn message(&mut self, kind: usize, sequence: u32, at_ns: u64, text: &[u8]) -> Result<(), McapError> {
        let channel_id = kind as u16 + 1;
        let header = MessageHeader { channel_id, sequence, log_time: at_ns, publish_time: at_ns };
        let chunk = match &mut self.chunk {
            Some(chunk) => chunk,
            none => none.insert(open_chunk()?),
        };
        chunk.write_to_known_channel(&header, text)?;
        self.filled += text.len();
        if self.filled > CHUNK { self.close_chunk() } else { Ok(()) }
    }

    /// Puts the present chunk into the file, whole.
    fn close_chunk(&mut self) -> Result<(), McapError> {
        self.filled = 0;
        let Some(mut chunk) = self.chunk.take() else { return Ok(()) };
        chunk.flush()?;
        self.put(&bytes_of(chunk)[self.named..])
    }

    pub fn flush(&mut self) -> Result<(), McapError> {
        self.close_chunk()?;
        Ok(self.to.flush()?)
    }
}

impl<W: Read + Write + Seek> Sink<W> {
    pub fn end(mut self) -> Result<(), McapError> {
        self.close_chunk()?;
        summary::end(&mut self.to, self.checksum.finalize())
    }
}

/// A piece that begins with a chunk of its own for schemas and channels. It goes into the file once, at the beginning: a reader
/// knows the topics from there, or from the index, and no later chunk repeats what is as long as some of its messages.
fn open_chunk() -> Result<Piece, McapError> {
    let mut chunk = piece()?;
    for (kind, topic) in TOPICS.into_iter().enumerate() {
        let schema = chunk.add_schema(&schema::name_of(topic), schema::ENCODING, schema::of(kind))?;
        chunk.add_channel(schema, topic, "json", &BTreeMap::new())?;
    }
    chunk.flush()?;
    Ok(chunk)
}
