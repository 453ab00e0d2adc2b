//! The record's thread: drains the ring, writes, flushes, syncs.

use super::fault;
use miette::IntoDiagnostic;
use realtime::clock::{Clock, Participant};
use realtime::recorder::{Preamble, Recorder};
use realtime::{Nanos, Row, threads};
use ringbuf::HeapCons;
use ringbuf::traits::Consumer;
use runs::files::GuardedFile;
use runs::job::run_writer;
use runs::{Event, MeasuredPass};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

const FLUSH_EVERY: Duration = Duration::from_millis(50);
/// Sync of the record to the disk.
const SYNC_EVERY: Duration = Duration::from_secs(1);
/// How far a held clock may pass what is written: a small part of the ring.
const SLACK: Nanos = Nanos(1_000_000_000);

/// Events and passes for the record, with their time.
pub(super) type RecordedNote = (Nanos, Vec<Event>, Option<MeasuredPass>);
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

/// The record's thread, and the channels into it.
pub(super) struct Recording {
    pub entries: Sender<RecordedNote>,
    last: Sender<Last>,
    thread: JoinHandle<Written>,
}

impl Recording {
    /// Starts the thread, which raises `lost` where the record cannot be written.
    pub fn start(
        file: GuardedFile,
        preamble: Preamble,
        rows: HeapCons<Row>,
        lost: &Arc<AtomicBool>,
        clock: &Clock,
    ) -> std::io::Result<Self> {
        let (entries, entries_out) = channel();
        let (last, last_out) = channel();
        let lost = RaisedByPanic(Arc::clone(lost));
        let clock = clock.join(SLACK);
        let write = move || write(file, preamble, rows, &entries_out, &last_out, &lost.0, &clock);
        let thread = threads::spawn("recorder", write)?;
        Ok(Recording { entries, last, thread })
    }

    /// Hands the last words over, and waits until they are written.
    pub fn end(self, last: Last) -> miette::Result<Written> {
        drop(self.entries);
        let _ = self.last.send(last);
        // A writer that cannot write waits for the other end of this channel to go.
        drop(self.last);
        self.thread.join().map_err(|_| fault("the recorder's thread panicked"))
    }
}

/// Raises a flag where the thread that holds it panics.
struct RaisedByPanic(Arc<AtomicBool>);

impl Drop for RaisedByPanic {
    fn drop(&mut self) {
        self.0.fetch_or(std::thread::panicking(), Ordering::Relaxed);
    }
}

/// Writes until the last words come. A file that cannot be written, or that was removed, raises `lost`, and the rest is counted:
/// the rows go on being drained, so that the loop never notices. It ends with the last words, whatever becomes of the file.
fn write(
    file: GuardedFile,
    preamble: Preamble,
    mut rows: impl Consumer<Item = Row>,
    entries: &Receiver<RecordedNote>,
    last: &Receiver<Last>,
    lost: &AtomicBool,
    clock: &Participant,
) -> Written {
    let mut written = Written::default();
    let mut ended = false;
    if let Err(problem) = record(file, preamble, &mut rows, entries, last, &mut ended, clock) {
        lost.store(true, Ordering::Relaxed);
        written.problem = Some(format!("{problem:#}"));
        // The last words come once: where they have, none are waited for.
        while !ended {
            clock.promise(clock.now());
            written.lost_rows += rows.pop_iter().count() as u64;
            ended = !matches!(last.recv_timeout(Duration::from_millis(20)), Err(RecvTimeoutError::Timeout));
        }
        written.lost_rows += rows.pop_iter().count() as u64;
    }
    written
}

fn record(
    file: GuardedFile,
    preamble: Preamble,
    rows: &mut impl Consumer<Item = Row>,
    entries: &Receiver<RecordedNote>,
    last: &Receiver<Last>,
    ended: &mut bool,
    clock: &Participant,
) -> miette::Result<()> {
    let disk = file.handle()?;
    let mut recorder = Recorder::begin(file, preamble).into_diagnostic()?;
    let (mut flushed, mut synced) = (Instant::now(), Instant::now());
    let last = loop {
        clock.promise(clock.now());
        let mut idle = true;
        while let Some(row) = rows.try_pop() {
            recorder.row(&row).into_diagnostic()?;
            idle = false;
        }
        while let Ok((at, events, pass)) = entries.try_recv() {
            run_writer::record(&mut recorder, at, &events, pass.as_ref())?;
            idle = false;
        }
        if flushed.elapsed() >= FLUSH_EVERY {
            recorder.flush().into_diagnostic()?;
            flushed = Instant::now();
        }
        if synced.elapsed() >= SYNC_EVERY {
            disk.sync()?;
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
    *ended = true;
    while let Some(row) = rows.try_pop() {
        recorder.row(&row).into_diagnostic()?;
    }
    recorder.end(last).into_diagnostic()?;
    disk.sync()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ringbuf::traits::Split;

    /// A record that takes everything and cannot be ended: its index is made from what is read back, and it cannot be read.
    #[test]
    fn a_record_that_cannot_be_ended_is_said_and_nobody_waits_for_ever() {
        let path = std::env::temp_dir().join(format!("muprime-writer-{}.mcap", std::process::id()));
        let mut options = std::fs::OpenOptions::new();
        let file = GuardedFile::open(&path, options.create_new(true).write(true)).unwrap();
        let (_rows_in, rows) = ringbuf::HeapRb::<Row>::new(8).split();
        let (_entries_in, entries) = channel::<RecordedNote>();
        let (last_in, last) = channel::<Last>();
        let (done_in, done) = channel();
        std::thread::spawn(move || {
            let (lost, clock) = (AtomicBool::new(false), Clock::from(Instant::now()).join(SLACK));
            let written = write(file, Preamble::default(), rows, &entries, &last, &lost, &clock);
            let _ = done_in.send((written.problem, lost.into_inner()));
        });
        // Held until the writer is done, as the sweep's thread does.
        last_in.send(Last::new()).unwrap();
        let (problem, lost) = done.recv_timeout(Duration::from_secs(20)).expect("the writer ends");
        assert!(lost && problem.is_some());
        drop(last_in);
        std::fs::remove_file(path).unwrap();
    }
}
