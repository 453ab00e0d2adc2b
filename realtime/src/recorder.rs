//! The record of a run: MCAP with JSON messages, which Foxglove, PlotJuggler and the `mcap` tools open.
//!
//! What a reader must know comes first (metadata and attachments), so that a file cut at any byte still tells what it
//! is. Chunks are closed at every [`Recorder::flush`]; a kill loses at most what came after the last one.
//! Time stamps are the wall clock at the start plus loop time, which is monotonic.

mod recover;

use crate::ports::Nanos;
use crate::turn::Row;
use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, Compression, McapError, WriteOptions, Writer};
use serde::Serialize;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::{Seek, Write};

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

/// Writes a record.
pub struct Recorder<W: Write + Seek> {
    writer: Writer<W>,
    preamble: Preamble,
    channels: [u16; 3],
    sequence: [u32; 3],
    text: Vec<u8>,
}

impl<W: Write + Seek> Recorder<W> {
    /// Begins a record and writes its preamble.
    ///
    /// # Errors
    /// Whatever the file says.
    pub fn begin(to: W, preamble: Preamble) -> Result<Self, McapError> {
        let options = WriteOptions::new()
            .compression(Some(Compression::Lz4))
            .chunk_size(Some(64 * 1024))
            .profile("")
            .library("muprime");
        let mut writer = options.create(to)?;
        let mut channels = [0; 3];
        for (channel, topic) in channels.iter_mut().zip([CYCLES, PASSES, EVENTS]) {
            let schema = writer.add_schema(
                &format!("muprime{}", topic.replace('/', ".")),
                "jsonschema",
                b"{\"type\":\"object\"}",
            )?;
            *channel = writer.add_channel(schema, topic, "json", &BTreeMap::new())?;
        }
        let mut recorder =
            Recorder { writer, preamble, channels, sequence: [0; 3], text: Vec::with_capacity(4096) };
        recorder.metadata(HEADER, recorder.preamble.facts.clone())?;
        for (name, text) in recorder.preamble.files.clone() {
            recorder.writer.attach(&Attachment {
                log_time: recorder.preamble.start_unix_ns,
                create_time: recorder.preamble.start_unix_ns,
                name,
                media_type: "text/plain".into(),
                data: Cow::Owned(text.into_bytes()),
            })?;
        }
        recorder.flush()?;
        Ok(recorder)
    }

    fn metadata(&mut self, name: &str, facts: BTreeMap<String, String>) -> Result<(), McapError> {
        self.writer.write_metadata(&Metadata { name: name.into(), metadata: facts })
    }

    fn message(&mut self, kind: usize, at: Nanos, body: &impl Serialize) -> Result<(), McapError> {
        self.text.clear();
        serde_json::to_writer(&mut self.text, body).map_err(std::io::Error::from)?;
        self.sequence[kind] = self.sequence[kind].wrapping_add(1);
        let log_time = self.preamble.start_unix_ns + at.0;
        let header = MessageHeader {
            channel_id: self.channels[kind],
            sequence: self.sequence[kind],
            log_time,
            publish_time: log_time,
        };
        self.writer.write_to_known_channel(&header, &self.text)
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
        self.writer.flush()
    }

    /// Repeats the preamble's facts with `last` words, and ends the file so that any reader opens it.
    ///
    /// # Errors
    /// Whatever the file says.
    pub fn end(mut self, last: BTreeMap<String, String>) -> Result<(), McapError> {
        let mut facts = self.preamble.facts.clone();
        facts.extend(last);
        self.metadata(TRAILER, facts)?;
        self.writer.finish()?;
        Ok(())
    }
}
