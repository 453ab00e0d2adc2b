//! A sweep in wall-clock time: the loop on its own thread, the record on another, the sequence on this one.

use super::fast::words;
use super::keeper::{self, Keeper};
use super::{Job, News, Signals, Summary};
use crate::drivers;
use crate::run_dir::RunDir;
use crate::sequence::{Event, MeasuredPass, Outcome, Sequence};
use crossbeam_queue::ArrayQueue;
use miette::{IntoDiagnostic, WrapErr};
use realtime::cycle::Command;
use realtime::pacing::{self, Lifeline, LoopParts, LoopReport};
use realtime::ports::Nanos;
use realtime::recorder::Recorder;
use realtime::turn::{Ports, Row};
use ringbuf::HeapRb;
use ringbuf::traits::{Consumer, Split};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

/// Rows that a ring holds: eight seconds at 1 kHz.
const RING: usize = 8192;
/// The loop counts as lost when its heartbeat stands still for this long.
const LOST_AFTER: Duration = Duration::from_millis(2000);
/// Flush of the record.
const FLUSH_EVERY: Duration = Duration::from_millis(50);
/// Sync of the record to the disk.
const SYNC_EVERY: Duration = Duration::from_secs(1);

/// What the sweep sends to the record's thread.
type Note = (Nanos, Vec<Event>, Option<MeasuredPass>);

/// Runs a job in wall-clock time.
pub fn run(
    job: Job,
    dir: RunDir,
    mut sequence: Sequence,
    planned: usize,
    signals: &Signals,
    news: &mut dyn FnMut(News<'_>),
) -> miette::Result<Summary> {
    let _claim = RigClaim::take(&job)?;
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
    let parts = LoopParts {
        config: job.setup.config,
        model: Arc::clone(&job.model),
        ports: Ports {
            force: job.setup.certificates.calibrated(rig.force),
            amplifier: rig.amplifier,
            stage: rig.stage,
        },
        commands: Arc::clone(&commands),
        rows: row_in,
        watch: watch_in,
        life: Arc::clone(&life),
        origin_ns,
    };
    let priority = (job.setup.file.pace.priority > 0).then_some(job.setup.file.pace.priority);

    let (note, notes) = channel::<Note>();
    let (last_in, last_out) = channel::<BTreeMap<String, String>>();
    let writer = std::thread::Builder::new()
        .name("recorder".into())
        .spawn(move || write_record(file, preamble, row_out, &notes, &last_out))
        .into_diagnostic()?;
    let looping = std::thread::Builder::new()
        .name("loop".into())
        .spawn(move || pacing::run(parts, priority))
        .into_diagnostic()?;

    let outcome = follow(&mut sequence, &mut watch, &commands, &life, signals, &mut kept, &note, news);
    // Whatever ended it: the stop goes out, and a few more cycles carry it to the amplifier.
    let _ = commands.push(Command::Stop);
    let beat = life.heartbeat.load(Ordering::Relaxed);
    let waited = Instant::now();
    while life.heartbeat.load(Ordering::Relaxed) < beat + 20 && waited.elapsed() < Duration::from_millis(500)
    {
        std::thread::sleep(Duration::from_millis(1));
    }
    life.end.store(true, Ordering::Relaxed);
    let report = looping.join().map_err(|_| miette::miette!("the loop's thread panicked"))?;
    drop(note);
    let links: BTreeMap<String, serde_json::Value> = rig
        .links
        .health()
        .map(|(name, health)| (name.to_string(), serde_json::to_value(health).unwrap_or_default()))
        .collect();
    drop(rig.links);
    let outcome = outcome?;
    let loop_json = serde_json::to_string(&report).into_diagnostic()?;
    let mut last =
        BTreeMap::from([("outcome".to_string(), words(&outcome)?), ("loop".to_string(), loop_json)]);
    last.insert("links".to_string(), serde_json::to_string(&links).into_diagnostic()?);
    let _ = last_in.send(last);
    let lost = writer
        .join()
        .map_err(|_| miette::miette!("the recorder's thread panicked"))?
        .wrap_err("the record")?;
    end(kept, outcome, sequence.departed(), report, lost, links)
}

fn end(
    kept: Keeper,
    outcome: Outcome,
    departed: bool,
    report: LoopReport,
    lost: u64,
    links: BTreeMap<String, serde_json::Value>,
) -> miette::Result<Summary> {
    let lost = lost + report.ring_drops;
    kept.end(outcome, departed, Some(report), lost, links)
}

/// Feeds the sequence with rows until it ends.
#[allow(clippy::too_many_arguments)] // the strands of a run come together here and nowhere else
fn follow(
    sequence: &mut Sequence,
    watch: &mut impl Consumer<Item = Row>,
    commands: &ArrayQueue<Command>,
    life: &Lifeline,
    signals: &Signals,
    kept: &mut Keeper,
    note: &Sender<Note>,
    news: &mut dyn FnMut(News<'_>),
) -> miette::Result<Outcome> {
    let mut heard = Instant::now();
    let mut stops = 0;
    loop {
        let asked = signals.stops.load(Ordering::Relaxed);
        if asked > stops {
            stops = asked;
            // Safe state first: the command goes out before anything else is looked at.
            let _ = commands.push(Command::Stop);
            sequence.stop();
        }
        let Some(row) = watch.try_pop() else {
            if heard.elapsed() > LOST_AFTER {
                let _ = life.heartbeat.load(Ordering::Relaxed);
                return Ok(Outcome::LoopLost);
            }
            std::thread::sleep(Duration::from_micros(500));
            continue;
        };
        heard = Instant::now();
        let reaction = sequence.on_row(&row);
        for command in &reaction.commands {
            // The queue holds many times what one row asks for; a full one means that the loop is gone.
            if commands.push(*command).is_err() {
                return Ok(Outcome::LoopLost);
            }
        }
        kept.keep(&reaction, news)?;
        if reaction.pass.is_some() {
            let (done, all) = sequence.progress();
            news(News::Progress(done, all, sequence.remaining_s()));
        }
        if !reaction.events.is_empty() || reaction.pass.is_some() {
            let _ = note.send((row.now, reaction.events, reaction.pass));
        }
        if let Some(outcome) = reaction.outcome {
            return Ok(outcome);
        }
    }
}

/// The record's thread: drains the ring, writes, flushes, syncs. Returns how many rows it could not write.
fn write_record(
    file: std::fs::File,
    preamble: realtime::recorder::Preamble,
    mut rows: impl Consumer<Item = Row>,
    notes: &Receiver<Note>,
    last: &Receiver<BTreeMap<String, String>>,
) -> miette::Result<u64> {
    let disk = file.try_clone().into_diagnostic()?;
    let mut recorder = Recorder::begin(std::io::BufWriter::new(file), preamble).into_diagnostic()?;
    let (mut flushed, mut synced) = (Instant::now(), Instant::now());
    let last = loop {
        let mut idle = true;
        while let Some(row) = rows.try_pop() {
            recorder.row(&row).into_diagnostic()?;
            idle = false;
        }
        while let Ok((at, events, pass)) = notes.try_recv() {
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
                Err(std::sync::mpsc::RecvTimeoutError::Timeout) => {}
                Err(std::sync::mpsc::RecvTimeoutError::Disconnected) => break BTreeMap::new(),
            }
        }
    };
    while let Some(row) = rows.try_pop() {
        recorder.row(&row).into_diagnostic()?;
    }
    recorder.end(last).into_diagnostic()?;
    disk.sync_all().into_diagnostic()?;
    Ok(0)
}

/// Serves the virtual rig where the setup looks for its instruments, and puts the real places there.
fn embed(
    job: &Job,
    instruments: &mut drivers::InstrumentsSetup,
    epoch: Instant,
) -> miette::Result<drivers::embed::Embedded> {
    let plant = sim::wire::SharedPlant::new(sim::wire::world::WorldPlant::new(job.world()?), epoch);
    drivers::embed::embed(instruments, &plant, false).map_err(|problem| miette::miette!("{problem}"))
}

/// Whether an embedded rig is at a place that only this process knows: a free port, a terminal of its own.
fn belongs_to_this_process(address: &str) -> bool {
    address.ends_with(":0") || address.ends_with("pty")
}

/// One controller a rig: a lock named after the amplifier's address, taken before anything is opened.
struct RigClaim(Option<std::path::PathBuf>);

impl RigClaim {
    fn take(job: &Job) -> miette::Result<Self> {
        // An embedded rig on a free port belongs to this process by construction.
        if job.setup.file.virtual_rig.is_some() && belongs_to_this_process(&job.setup.file.amplifier.address)
        {
            return Ok(RigClaim(None));
        }
        let name: String = job
            .setup
            .file
            .amplifier
            .address
            .chars()
            .map(|c| if c.is_ascii_alphanumeric() { c } else { '-' })
            .collect();
        let lock = std::env::temp_dir().join(format!("muprime-rig-{name}.lock"));
        crate::run_dir::claim(&lock)?;
        Ok(RigClaim(Some(lock)))
    }
}

impl Drop for RigClaim {
    fn drop(&mut self) {
        if let Some(lock) = &self.0 {
            let _ = std::fs::remove_file(lock);
        }
    }
}
