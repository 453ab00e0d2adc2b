//! The record of a run: MCAP with JSON messages, which Foxglove, PlotJuggler and the `mcap` tools open.
//!
//! What a reader must know comes first (metadata and attachments), so that a file cut at any byte still tells what it
//! is. Chunks are closed at every [`Recorder::flush`]; a kill loses at most what came after the last one.
//! Time stamps are the wall clock at the start plus loop time, which is monotonic.
//!
//! Memory stays the same however long a run lasts. Every chunk is made by a writer of its own and tells its own channels;
//! what a reader needs to find its way is put together when the file ends, from the file.

mod read;
mod recover;
mod summary;

use crate::ports::Nanos;
use crate::turn::Row;
use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, Compression, McapError, WriteOptions, Writer};
use serde::Serialize;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::{Cursor, Read, Seek, Write};

pub use read::{Entry, Reader};
pub use recover::{Contents, Recovery, read, recover};

/// Topic of the rows, one a cycle.
pub const CYCLES: &str = "/cycle";
/// Topic of the passes, one a steady point.
pub const PASSES: &str = "/pass";
/// Topic of events: trips, arming, zeros, signals, gaps.
pub const EVENTS: &str = "/event";
/// Name of the metadata record that comes first.
pub const HEADER: &str = "muprime.run";
/// Name of the metadata record that comes last.
pub const TRAILER: &str = "muprime.end";

/// What goes into a record before anything else.
#[derive(Clone, Debug, Default)]
pub struct Preamble {
    /// Wall clock at loop time zero, in ns since 1970.
    pub start_unix_ns: u64,
    /// Versions, seed, hashes, names.
    pub facts: BTreeMap<String, String>,
    /// Files by name: setup, plan, rig.toml, certificates, model.
    pub files: Vec<(String, String)>,
}

/// The topics; the number of a topic's schema and channel is its place here, from 1.
const TOPICS: [&str; 3] = [CYCLES, PASSES, EVENTS];
/// How the schemas are written.
const ENCODING: &str = "jsonschema";
/// All of them: any object.
const SCHEMA: &[u8] = b"{\"type\":\"object\"}";
/// A chunk is closed once its messages are longer than this, in bytes.
const CHUNK: usize = 64 * 1024;

fn schema_name(topic: &str) -> String {
    format!("muprime{}", topic.replace('/', "."))
}

/// Writes into memory, from which whole pieces go to the file.
type Piece = Writer<Cursor<Vec<u8>>>;

/// A new piece; `head` bytes of it, magic and header, belong only at the beginning of a file.
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

/// Writes a record.
pub struct Recorder<W> {
    to: W,
    preamble: Preamble,
    /// Length of what every piece begins with.
    head: usize,
    chunk: Option<Piece>,
    /// Bytes of the messages in the present chunk.
    filled: usize,
    sequence: [u32; 3],
    text: Vec<u8>,
}

impl<W: Write> Recorder<W> {
    /// Begins a record at the beginning of an empty file, and writes its preamble.
    ///
    /// # Errors
    /// Whatever the file says.
    pub fn begin(mut to: W, preamble: Preamble) -> Result<Self, McapError> {
        let head = bytes_of(piece()?).len();
        let mut first = piece()?;
        first.write_metadata(&Metadata { name: HEADER.into(), metadata: preamble.facts.clone() })?;
        for (name, text) in &preamble.files {
            first.attach(&Attachment {
                log_time: preamble.start_unix_ns,
                create_time: preamble.start_unix_ns,
                name: name.clone(),
                media_type: "text/plain".into(),
                data: Cow::Borrowed(text.as_bytes()),
            })?;
        }
        to.write_all(&bytes_of(first))?;
        to.flush()?;
        let text = Vec::with_capacity(4096);
        Ok(Recorder { to, preamble, head, chunk: None, filled: 0, sequence: [0; 3], text })
    }

    fn open_chunk() -> Result<Piece, McapError> {
        let mut chunk = piece()?;
        for topic in TOPICS {
            let schema = chunk.add_schema(&schema_name(topic), ENCODING, SCHEMA)?;
            chunk.add_channel(schema, topic, "json", &BTreeMap::new())?;
        }
        Ok(chunk)
    }

    fn message(&mut self, kind: usize, at: Nanos, body: &impl Serialize) -> Result<(), McapError> {
        self.text.clear();
        serde_json::to_writer(&mut self.text, body).map_err(std::io::Error::from)?;
        self.sequence[kind] = self.sequence[kind].wrapping_add(1);
        let log_time = self.preamble.start_unix_ns + at.0;
        let header = MessageHeader {
            channel_id: kind as u16 + 1,
            sequence: self.sequence[kind],
            log_time,
            publish_time: log_time,
        };
        if self.chunk.is_none() {
            self.chunk = Some(Self::open_chunk()?);
        }
        let Some(chunk) = &mut self.chunk else { unreachable!("opened above") };
        chunk.write_to_known_channel(&header, &self.text)?;
        self.filled += self.text.len();
        if self.filled > CHUNK { self.close_chunk() } else { Ok(()) }
    }

    /// Puts the present chunk into the file, whole.
    fn close_chunk(&mut self) -> Result<(), McapError> {
        self.filled = 0;
        let Some(mut chunk) = self.chunk.take() else { return Ok(()) };
        chunk.flush()?;
        Ok(self.to.write_all(&bytes_of(chunk)[self.head..])?)
    }

    /// Writes a row.
    ///
    /// # Errors
    /// Whatever the file says.
    pub fn row(&mut self, row: &Row) -> Result<(), McapError> {
        self.message(0, row.now, row)
    }

    /// Writes a pass.
    ///
    /// # Errors
    /// Whatever the file says.
    pub fn pass(&mut self, at: Nanos, pass: &impl Serialize) -> Result<(), McapError> {
        self.message(1, at, pass)
    }

    /// Writes an event.
    ///
    /// # Errors
    /// Whatever the file says.
    pub fn event(&mut self, at: Nanos, event: &impl Serialize) -> Result<(), McapError> {
        self.message(2, at, event)
    }

    /// Closes the present chunk and hands everything to the file.
    ///
    /// # Errors
    /// Whatever the file says.
    pub fn flush(&mut self) -> Result<(), McapError> {
        self.close_chunk()?;
        Ok(self.to.flush()?)
    }
}

impl<W: Read + Write + Seek> Recorder<W> {
    /// Repeats the preamble's facts with `last` words, and ends the file so that any reader opens it.
    ///
    /// # Errors
    /// Whatever the file says.
    pub fn end(mut self, last: BTreeMap<String, String>) -> Result<(), McapError> {
        self.close_chunk()?;
        let mut facts = self.preamble.facts.clone();
        facts.extend(last);
        let mut trailer = piece()?;
        trailer.write_metadata(&Metadata { name: TRAILER.into(), metadata: facts })?;
        self.to.write_all(&bytes_of(trailer)[self.head..])?;
        summary::end(&mut self.to)
    }
}
