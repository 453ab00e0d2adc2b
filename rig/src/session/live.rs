//! A sweep in wall-clock time. Four threads, each with one duty: the loop; the record's writer; the sweep, which answers
//! the loop's rows within a millisecond or two; and this one, which makes passes safe on the disk and tells the news.
//! A slow disk so reaches neither the loop nor the stage.

mod claim;
mod follow;
mod writer;

use super::fast::words;
use super::keeper::{self, Keeper};
use super::{Job, News, Signals, Summary, Unfinished};
use crate::run_dir::RunDir;
use crate::sequence::{Event, MeasuredPass, Outcome, Sequence};
pub use claim::RigClaim;
use crossbeam_queue::ArrayQueue;
use miette::{IntoDiagnostic, WrapErr};
use realtime::cycle::Command;
use realtime::pacing::{self, Lifeline, LoopParts};
use realtime::ports::Nanos;
use realtime::turn::{Ports, Row};
use realtime::witness::Witnesses;
use ringbuf::HeapRb;
use ringbuf::traits::Split;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

/// Rows that a ring holds: eight seconds at 1 kHz.
const RING: usize = 8192;

/// What the sweep has to keep and to tell.
struct Note {
    at: Nanos,
    events: Vec<Event>,
    pass: Option<MeasuredPass>,
    /// Passes made, planned, s to go.
    progress: (usize, usize, f64),
}

/// Runs a job in wall-clock time.
pub fn run(
    job: Job,
    dir: RunDir,
    mut sequence: Sequence,
    planned: usize,
    signals: &Signals,
    news: &mut dyn FnMut(News<'_>),
) -> miette::Result<Summary> {
    let _claim = RigClaim::take(&job.setup)?;
    let epoch = Instant::now();
    let origin_ns = pacing::monotonic_ns();
    let start_unix_ns = keeper::unix_ns();
    let mut instruments = job.setup.instruments();
    let _embedded = match &job.setup.file.virtual_rig {
        Some(_) => Some(embed(&job, &mut instruments, epoch)?),
        None => None,
    };
    let rig = drivers::open(&instruments, epoch).map_err(|e| {
        miette::miette!(help = "check address, wiring and power; 'muprime doctor --setup' says more", "{e}")
    })?;
    let mut kept = Keeper::begin(&job, dir, planned, start_unix_ns)?;
    let file = kept.new_record()?;
    let preamble = keeper::preamble(&job, start_unix_ns)?;

    let (row_in, row_out) = HeapRb::<Row>::new(RING).split();
    let (watch_in, mut watch) = HeapRb::<Row>::new(RING).split();
    let commands = Arc::new(ArrayQueue::new(64));
    let life = Arc::new(Lifeline::default());
    let lost = Arc::new(AtomicBool::new(false));
    let parts = LoopParts {
        config: job.setup.config,
        model: Arc::clone(&job.model),
        ports: Ports {
            force: job.setup.certificates.calibrated(rig.force),
            amplifier: job.setup.certificates.calibrated_amplifier(rig.amplifier),
            stage: rig.stage,
        },
        commands: Arc::clone(&commands),
        rows: row_in,
        watch: watch_in,
        life: Arc::clone(&life),
        origin_ns,
    };
    let priority = (job.setup.file.pace.priority > 0).then_some(job.setup.file.pace.priority);

    let (to_writer, notes) = channel();
    let (last_in, last_out) = channel();
    let writing = {
        let lost = Arc::clone(&lost);
        let write = move || writer::write(file, preamble, row_out, &notes, &last_out, &lost);
        std::thread::Builder::new().name("recorder".into()).spawn(write).into_diagnostic()?
    };
    let looping = std::thread::Builder::new()
        .name("loop".into())
        .spawn(move || pacing::run(parts, priority))
        .into_diagnostic()?;
    let witnesses = Witnesses::start(origin_ns).into_diagnostic().wrap_err(Unfinished::Internal)?;

    let (note_in, note_out) = channel::<Note>();
    let strands = follow::Strands { commands: &commands, life: &life, signals, lost: &lost, notes: note_in };
    let mut unkept = None;
    let outcome = std::thread::scope(|scope| {
        let following = scope.spawn(|| follow::follow(&mut sequence, &mut watch, strands));
        for note in note_out {
            if unkept.is_none() {
                unkept = kept.keep(&note.events, note.pass.as_ref(), news).err();
                lost.fetch_or(unkept.is_some(), Ordering::Relaxed);
            }
            if note.pass.is_some() {
                let (done, all, left_s) = note.progress;
                news(News::Progress(done, all, left_s));
            }
            let _ = to_writer.send((note.at, note.events, note.pass));
        }
        following.join()
    });
    // Whatever ended it: the stop goes out, and a few more cycles carry it to the amplifier.
    let _ = commands.force_push(Command::Stop);
    let beat = life.heartbeat.load(Ordering::Relaxed);
    let waited = Instant::now();
    while life.heartbeat.load(Ordering::Relaxed) < beat + 20 && waited.elapsed() < Duration::from_millis(500)
    {
        std::thread::sleep(Duration::from_millis(1));
    }
    life.end.store(true, Ordering::Relaxed);
    let stalls = witnesses.finish();
    drop(to_writer);
    // A loop that is stuck inside a driver cannot be joined: its instruments' own watchdogs have dropped the drive.
    let stuck = Instant::now();
    while !looping.is_finished() && stuck.elapsed() < Duration::from_secs(2) {
        std::thread::sleep(Duration::from_millis(1));
    }
    if !looping.is_finished() {
        return Err(fault("the loop's thread is stuck inside a driver"));
    }
    let report = looping.join().map_err(|_| fault("the loop's thread panicked"))?;
    let links: BTreeMap<String, serde_json::Value> = rig
        .links
        .health()
        .map(|(name, health)| (name.to_string(), serde_json::to_value(health).unwrap_or_default()))
        .collect();
    drop(rig.links);
    let outcome = outcome.map_err(|_| fault("the sweep's thread panicked"))?;
    let mut last = BTreeMap::new();
    last.insert("outcome".to_string(), words(&outcome)?);
    last.insert("loop".to_string(), serde_json::to_string(&report).into_diagnostic()?);
    last.insert("stalls".to_string(), serde_json::to_string(&stalls).into_diagnostic()?);
    last.insert("links".to_string(), serde_json::to_string(&links).into_diagnostic()?);
    let _ = last_in.send(last);
    if let Some(what) = &report.panicked {
        tracing::error!(what, "a port panicked in the loop: the drive was switched off");
    }
    let written = writing.join().map_err(|_| fault("the recorder's thread panicked"))?;
    for why in written.problem.iter().cloned().chain(unkept.map(|e| format!("{e:#}"))) {
        tracing::error!(why, "the record could not be kept: the sweep was stopped");
    }
    // A file that failed only while the last rows went into it: the sweep was over, but it is not recorded.
    let unrecorded = written.problem.is_some() && outcome == Outcome::Complete;
    let outcome = if unrecorded { Outcome::RecordLost } else { outcome };
    let record_lost = written.lost_rows + report.ring_drops;
    let agreement = sequence.agreement(outcome == Outcome::Complete);
    Ok(kept.end(outcome, agreement, Some((report, stalls)), record_lost, links))
}

/// A fault of this program, after the rig was touched.
fn fault(what: &'static str) -> miette::Report {
    miette::miette!("{what}").wrap_err(Unfinished::Internal)
}

/// Serves the virtual rig where the setup looks for its instruments, and puts the real places there.
fn embed(
    job: &Job,
    instruments: &mut drivers::InstrumentsSetup,
    epoch: Instant,
) -> miette::Result<crate::embed::Embedded> {
    let plant = sim::wire::SharedPlant::new(sim::wire::world::WorldPlant::new(job.world()?), epoch);
    crate::embed::embed(instruments, &plant, false).map_err(|problem| miette::miette!("{problem}"))
}
