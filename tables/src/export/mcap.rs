//! A run's record as viewers plot it at once: MCAP with the flat [`topics`].
//!
//! `/force/..`, `/friction/..`, `/drive/..`, `/stage/..`, `/loop/..`, `/safety/..` and `/sweep/..` follow the cycles: what is measured
//! has a message a cycle, what holds from one change to the next (set-points, echoes, flags) one before and one at each change;
//! `/pass/COLUMN` one a pass, for every column of the point table and of the comparison that holds numbers; `/event` holds the
//! events as they are in the record. The record itself keeps everything that a cycle saw, nested: it is what a replay reads.

use super::facts::Facts;
use super::topics::{self, SIGNALS, Signal};
use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, Compression, WriteOptions, Writer};
use miette::{Context, IntoDiagnostic};
use realtime::Row;
use realtime::recorder::{EVENTS, Entry, HEADER, PASSES, Reader};
use runs::files::{FLAT_MCAP, replaceable, write_in_pieces};
use runs::run_dir::records_in;
use runs::{MeasuredPass, RunData};
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{BufReader, BufWriter, Write as _};
use std::path::Path;

/// Writes the records of all sessions of the run in `folder` to `to`, entry by entry: memory stays the same however long they are.
/// Returns how many passes they hold.
///
/// # Errors
/// Whatever the file system or the format's library says; another file, a pipe or a device is at that place.
/// Nothing is left behind then.
pub fn write(folder: &Path, run: &RunData, facts: &Facts, to: &Path) -> miette::Result<usize> {
    replaceable(to, FLAT_MCAP)?;
    write_in_pieces(to, |file| {
        let mut flat = Flat::begin(BufWriter::new(file), run, facts).into_diagnostic()?;
        for path in records_in(folder)? {
            let file = File::open(&path).into_diagnostic()?;
            flat.record(BufReader::new(file)).wrap_err_with(|| path.display().to_string())?;
        }
        let passes = flat.points.len();
        flat.end().into_diagnostic()?.flush().into_diagnostic().map(|()| passes)
    })
}

/// The file that is being written.
struct Flat {
    to: Writer<BufWriter<File>>,
    signals: Vec<(Signal, Topic, Held)>,
    passes: Vec<Topic>,
    /// Points whose pass was written.
    points: BTreeSet<u64>,
    events: Topic,
    text: Vec<u8>,
}

/// A quantity that holds from one change to the next. The last cycle before a change is written too, so that
/// a line from message to message is the step that it was.
#[derive(Default)]
struct Held {
    value: Option<Option<f64>>,
    /// The last cycle that had this value, where it was not written.
    unwritten: Option<(u64, f64)>,
}

impl Held {
    /// Whether a cycle's value is another than the one before it.
    fn changes(&mut self, at: u64, value: Option<f64>) -> bool {
        let changes = self.value != Some(value);
        if !changes {
            self.unwritten = value.map(|value| (at, value));
        }
        self.value = Some(value);
        changes
    }
}

/// A topic of the file: its channel, and how many messages it has.
struct Topic {
    channel: u16,
    written: u32,
}

impl Flat {
    fn begin(to: BufWriter<File>, run: &RunData, facts: &Facts) -> mcap::McapResult<Self> {
        let options = WriteOptions::new().compression(Some(Compression::Lz4)).library("muprime");
        let mut to = options.create(to)?;
        to.write_metadata(&Metadata { name: HEADER.into(), metadata: facts.clone() })?;
        let start = facts.get("start_unix_ns").and_then(|ns| ns.parse().ok()).unwrap_or(0);
        for (name, bytes) in &run.files {
            to.attach(&Attachment {
                log_time: start,
                create_time: start,
                name: name.clone(),
                media_type: "text/plain".into(),
                data: Cow::Borrowed(bytes),
            })?;
        }
        let mut all = |topics: Vec<topics::Topic>| {
            topics.iter().map(|one| Topic::add(&mut to, one)).collect::<Result<Vec<_>, _>>()
        };
        let of_cycles = all(topics::of_cycles())?;
        let passes = all(topics::of_passes())?;
        let events = Topic::add(&mut to, &topics::of_events())?;
        let signals =
            SIGNALS.into_iter().zip(of_cycles).map(|(signal, topic)| (signal, topic, Held::default()));
        let signals = signals.collect();
        Ok(Flat { to, signals, passes, points: BTreeSet::new(), events, text: Vec::with_capacity(64) })
    }

    /// One session's record.
    fn record(&mut self, from: BufReader<File>) -> miette::Result<()> {
        for entry in Reader::new(from) {
            let Entry::Message { topic, log_time, text, .. } = entry else { continue };
            match topic {
                EVENTS => self.events.put(&mut self.to, log_time, &text).into_diagnostic()?,
                PASSES => self.pass(log_time, &serde_json::from_slice(&text).into_diagnostic()?)?,
                _ => self.row(log_time, &serde_json::from_slice(&text).into_diagnostic()?)?,
            }
        }
        for (_, topic, held) in &mut self.signals {
            if let Some((at, value)) = std::mem::take(held).unwritten {
                topic.value(&mut self.to, at, Some(value), &mut self.text).into_diagnostic()?;
            }
        }
        Ok(())
    }

    fn row(&mut self, log_time: u64, row: &Row) -> miette::Result<()> {
        let Flat { to, signals, text, .. } = self;
        for (signal, topic, held) in signals {
            let value = (signal.of)(row);
            if !signal.holds {
                topic.value(to, log_time, value, text).into_diagnostic()?;
            } else if held.changes(log_time, value) {
                if let Some((at, before)) = held.unwritten.take() {
                    topic.value(to, at, Some(before), text).into_diagnostic()?;
                }
                topic.value(to, log_time, value, text).into_diagnostic()?;
            }
        }
        Ok(())
    }

    fn pass(&mut self, log_time: u64, pass: &MeasuredPass) -> miette::Result<()> {
        self.points.insert(pass.pass.point);
        for (value, topic) in topics::of_pass(pass).into_iter().zip(&mut self.passes) {
            topic.value(&mut self.to, log_time, value, &mut self.text).into_diagnostic()?;
        }
        Ok(())
    }

    fn end(mut self) -> mcap::McapResult<BufWriter<File>> {
        self.to.finish()?;
        Ok(self.to.into_inner())
    }
}

impl Topic {
    fn add(to: &mut Writer<BufWriter<File>>, topic: &topics::Topic) -> mcap::McapResult<Self> {
        let schema = to.add_schema(&topic.schema_name(), "jsonschema", topic.schema().as_bytes())?;
        Ok(Topic { channel: to.add_channel(schema, &topic.name, "json", &BTreeMap::new())?, written: 0 })
    }

    fn put(&mut self, to: &mut Writer<BufWriter<File>>, log_time: u64, text: &[u8]) -> mcap::McapResult<()> {
        self.written = self.written.wrapping_add(1);
        let (channel_id, sequence) = (self.channel, self.written);
        let header = MessageHeader { channel_id, sequence, log_time, publish_time: log_time };
        to.write_to_known_channel(&header, text)
    }

    /// A value, where there is one that JSON has a word for.
    fn value(
        &mut self,
        to: &mut Writer<BufWriter<File>>,
        log_time: u64,
        value: Option<f64>,
        text: &mut Vec<u8>,
    ) -> mcap::McapResult<()> {
        text.clear();
        topics::message(value, text).map_or(Ok(()), |()| self.put(to, log_time, text))
    }
}
