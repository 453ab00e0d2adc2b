//! The record's thread: drains the ring, writes, flushes, syncs.

use crate::sequence::{Event, MeasuredPass};
use crate::session::keeper;
use miette::IntoDiagnostic;
use realtime::ports::Nanos;
use realtime::recorder::{Preamble, Recorder};
use realtime::turn::Row;
use ringbuf::traits::Consumer;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

/// Flush of the record.
const FLUSH_EVERY: Duration = Duration::from_millis(50);
/// Sync of the record to the disk.
const SYNC_EVERY: Duration = Duration::from_secs(1);

/// Events and passes for the record, with their time.
pub(super) type Entry = (Nanos, Vec<Event>, Option<MeasuredPass>);
/// The record's last words.
pub(super) type Last = BTreeMap<String, String>;

/// What became of the record.
#[derive(Debug, Default)]
pub(super) struct Written {
    /// Rows that came after the file could not be written any more.
    pub lost_rows: u64,
    /// Why it could not.
    pub problem: Option<String>,
}

/// Writes until the last words come. A file that cannot be written raises `lost`, and the rest is counted: the rows go
/// on being drained, so that the loop never notices.
pub(super) fn write(
    file: std::fs::File,
    preamble: Preamble,
    mut rows: impl Consumer<Item = Row>,
    entries: &Receiver<Entry>,
    last: &Receiver<Last>,
    lost: &AtomicBool,
) -> Written {
    let mut written = Written::default();
    if let Err(problem) = record(file, preamble, &mut rows, entries, last) {
        lost.store(true, Ordering::Relaxed);
        written.problem = Some(format!("{problem:#}"));
        loop {
            written.lost_rows += rows.pop_iter().count() as u64;
            match last.recv_timeout(Duration::from_millis(20)) {
                Err(RecvTimeoutError::Timeout) => {}
                Ok(_) | Err(RecvTimeoutError::Disconnected) => break,
            }
        }
        written.lost_rows += rows.pop_iter().count() as u64;
    }
    written
}

fn record(
    file: std::fs::File,
    preamble: Preamble,
    rows: &mut impl Consumer<Item = Row>,
    entries: &Receiver<Entry>,
    last: &Receiver<Last>,
) -> miette::Result<()> {
    let disk = file.try_clone().into_diagnostic()?;
    let mut recorder = Recorder::begin(file, preamble).into_diagnostic()?;
    let (mut flushed, mut synced) = (Instant::now(), Instant::now());
    let last = loop {
        let mut idle = true;
        while let Some(row) = rows.try_pop() {
            recorder.row(&row).into_diagnostic()?;
            idle = false;
        }
        while let Ok((at, events, pass)) = entries.try_recv() {
            keeper::record(&mut recorder, at, &events, pass.as_ref())?;
            idle = false;
        }
        if flushed.elapsed() >= FLUSH_EVERY {
            recorder.flush().into_diagnostic()?;
            flushed = Instant::now();
        }
        if synced.elapsed() >= SYNC_EVERY {
            disk.sync_data().into_diagnostic()?;
            synced = Instant::now();
        }
        if idle {
            match last.recv_timeout(Duration::from_millis(5)) {
                Ok(last) => break last,
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break BTreeMap::new(),
            }
        }
    };
    while let Some(row) = rows.try_pop() {
        recorder.row(&row).into_diagnostic()?;
    }
    recorder.end(last).into_diagnostic()?;
    disk.sync_all().into_diagnostic()
}
