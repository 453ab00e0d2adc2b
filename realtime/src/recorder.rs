//! The record of a run: MCAP with JSON messages, which Foxglove, PlotJuggler and the `mcap` tools open.
//!
//! What a reader must know comes first (metadata and attachments), so that a file cut at any byte still tells
//! what it is. Chunks are closed at every [`Recorder::flush`]; a kill loses at most what came after the last
//! one. Time stamps are the wall clock at the start plus loop time, which is monotonic. Errors of the writer are those of its file.
//!
//! Every byte is under a checksum: a chunk's messages under the chunk's, an attachment under its own, a metadata record under
//! one that stands among its facts ([`CHECKSUM`]), and all of the data and all of the index under those that the format puts at
//! the end. Messages are numbered, and the last words say how many there were: so a reader knows what is missing.
//!
//! Memory stays the same however long a run lasts. Every chunk is made by a writer of its own and tells its
//! own channels; what a reader needs to find its way is put together when the file ends, from the file.

mod integrity;
mod read;
mod recover;
mod schema;
mod sink;
mod summary;

use crate::{Nanos, Row};
use mcap::McapError;
use serde::Serialize;
use sink::Sink;
use std::collections::BTreeMap;
use std::io::{Read, Seek, Write};

pub use integrity::{DamagedStretch, Gap, Integrity};
pub use read::{Entry, Reader};
pub use recover::{Recovery, inspect, recover};

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
/// Name of the metadata record that 'recover' adds: what it had found.
pub const RECOVERED: &str = "muprime.recovered";
/// Name of the fact, in every metadata record, that holds the CRC-32 of the others in hexadecimal digits.
pub const CHECKSUM: &str = "crc32";

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
/// Facts of the last words: how many messages of each topic were written.
const WRITTEN: [&str; 3] = ["cycles_written", "passes_written", "events_written"];
/// A chunk is closed once its messages are longer than this, in bytes.
const CHUNK: usize = 64 * 1024;

/// Writes a record.
pub struct Recorder<W> {
    sink: Sink<W>,
    preamble: Preamble,
    written: [u32; 3],
    text: Vec<u8>,
}

impl<W: Write> Recorder<W> {
    /// Begins a record at the beginning of an empty file, and writes its preamble.
    pub fn begin(to: W, preamble: Preamble) -> Result<Self, McapError> {
        let mut sink = Sink::begin(to)?;
        sink.facts(HEADER, preamble.facts.clone())?;
        for (name, text) in &preamble.files {
            sink.attach(preamble.start_unix_ns, name, text.as_bytes())?;
        }
        sink.flush()?;
        Ok(Recorder { sink, preamble, written: [0; 3], text: Vec::with_capacity(4096) })
    }

    fn message(&mut self, kind: usize, at: Nanos, body: &impl Serialize) -> Result<(), McapError> {
        self.text.clear();
        serde_json::to_writer(&mut self.text, body).map_err(std::io::Error::from)?;
        self.written[kind] = self.written[kind].wrapping_add(1);
        self.sink.message(kind, self.written[kind], self.preamble.start_unix_ns + at.0, &self.text)
    }

    /// Writes a row.
    pub fn row(&mut self, row: &Row) -> Result<(), McapError> {
        self.message(0, row.now, row)
    }

    /// Writes a pass.
    pub fn pass(&mut self, at: Nanos, pass: &impl Serialize) -> Result<(), McapError> {
        self.message(1, at, pass)
    }

    /// Writes an event.
    pub fn event(&mut self, at: Nanos, event: &impl Serialize) -> Result<(), McapError> {
        self.message(2, at, event)
    }

    /// Closes the present chunk and hands everything to the file.
    pub fn flush(&mut self) -> Result<(), McapError> {
        self.sink.flush()
    }
}

impl<W: Read + Write + Seek> Recorder<W> {
    /// Repeats the preamble's facts with `last` words and the counts of messages, and ends the file so that
    /// any reader opens it.
    pub fn end(mut self, last: BTreeMap<String, String>) -> Result<(), McapError> {
        let mut facts = self.preamble.facts.clone();
        facts.extend(last);
        facts.extend(WRITTEN.iter().zip(self.written).map(|(name, n)| (name.to_string(), n.to_string())));
        self.sink.facts(TRAILER, facts)?;
        self.sink.end()
    }
}
