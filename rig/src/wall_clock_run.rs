//! A sweep in wall-clock time. Four threads, each with one duty: the loop; the record's writer; the sweep, which
//! answers the loop's rows within a millisecond or two; and this one, which makes passes safe on the disk and
//! passes updates on: what is printed, published or shown has bounded queues and threads of its own. So a slow
//! disk reaches neither the loop nor the stage, and a reader that takes nothing does not reach this thread.
#![allow(clippy::disallowed_methods, reason = "a sweep in wall-clock time, beside the loop")]

mod writer;

use crate::dead_man_key::DeadManKey;
use crate::emulators::Emulators;
use crate::exposure::{Keeping, Ledger};
use crate::rig_lock::RigLock;
use crate::wall_clock_loop::{Ended, LoopHandle, Parts, WallClockLoop};
use realtime::pacing::{self, Lifeline};
use realtime::stall_monitor::{StallMonitor, StallReport};
use realtime::{Clock, Nanos, Ports, threads};
use runs::ambient::{AmbientControl, OperatorAnswers, SimulatedAir};
use runs::exposure_left::Left;
use runs::job::run_writer::{self, RunWriter};
use runs::job::{Begun, Job, Signals, Snapshot, Snapshots, Summary, Unfinished, Update};
use runs::supervisor::{self, End, Requests};
use runs::{Event, MeasuredPass, Outcome, Sweep};
use sim::wire::SharedPlant;
use std::panic::AssertUnwindSafe;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Instant;
use writer::{Last, RecordedNote, Recording, Written};

/// Runs a job: in wall-clock time over its instruments, or in virtual time where the job says so. In
/// wall-clock time `update` must wait for nothing: whoever keeps the passes calls it.
///
/// # Errors
/// Whatever prevents it before anything was commanded (a refusal), or a fault of this program.
pub fn run(mut job: Job, signals: &Signals, update: &mut dyn FnMut(Update<'_>)) -> miette::Result<Summary> {
    // The loop's thread is in no span: nothing there formats. Threads that write log lines of the session
    // enter it.
    let _session = tracing::warn_span!("session", run = %job.out.display()).entered();
    if job.fast {
        return job.run_in_virtual_time(signals, update);
    }
    let begun = job.begin()?;
    if begun.is_complete() {
        return begun.finish(&job);
    }
    over_instruments(job, begun, signals, update)
}

/// Runs a job in wall-clock time: connects, starts loop and recorder, follows the sweep, switches off, ends
/// the record. What is dropped last comes first: the terminal's key, the lock of the rig, the emulators.
fn over_instruments(
    mut job: Job,
    begun: Begun,
    signals: &Signals,
    update: &mut dyn FnMut(Update<'_>),
) -> miette::Result<Summary> {
    let Begun { dir, mut sweep, planned, answers, .. } = begun;
    let key = if job.setup.hand_at_key() { Some(DeadManKey::open()?) } else { None };
    let _rig_lock = RigLock::take(&job.setup)?;
    let ledger = Ledger::open(&job.setup, &job.notes)?;
    if let Some(ledger) = &ledger {
        job.setup.config.exposed = ledger.exposed();
        sweep.exposure_left(Left::of(&job.setup.config.limits, &job.setup.config.exposed));
    }
    let epoch = Instant::now();
    let simulated = job.setup.file.virtual_rig.is_some();
    let clock = if simulated { Clock::holdable(epoch) } else { Clock::from(epoch) };
    let (origin_ns, start_unix_ns) = (pacing::monotonic_ns(), run_writer::unix_ns());
    let (_emulators, ambient_control, rig) = connect(&job, &sweep, answers, &clock)?;
    let mut writer = RunWriter::begin(&job, dir, planned)?;
    let file = writer.new_record()?;
    let preamble = run_writer::preamble(&job, start_unix_ns)?;

    let lost = Arc::new(AtomicBool::new(false));
    let monitor = StallMonitor::start(origin_ns).map_err(fault)?;
    let ports = job.setup.certificates.applied(Ports::new(rig.force, rig.amplifier, rig.stage));
    let (rig, handle, rows) = WallClockLoop::start(Parts {
        config: job.setup.config,
        model: Arc::clone(&job.model),
        ports: Ports { supply: rig.supply, contacts: rig.contacts, ..ports },
        links: rig.links,
        pacing: job.setup.file.pace.pacing(),
        origin_ns,
    })
    .map_err(fault)?;
    let keeping = ledger.map(|ledger| ledger.keep(rig.life(), handle.stopper()));
    let keeping = keeping.transpose().map_err(fault)?;
    let held = key.map(|key| key.hold(handle.sender())).transpose().map_err(fault)?;
    let recording = Recording::start(file, preamble, rows, &lost, &clock).map_err(fault)?;

    let (note_in, notes) = channel();
    let mut unsaved = None;
    let mut save = |update: &mut dyn FnMut(Update<'_>)| {
        pass_on(&notes, &mut writer, &lost, &recording.entries, &mut unsaved, update);
    };
    let mut snapshots = Snapshots::of(start_unix_ns, job.setup.config.limits.timing.cycle);
    let (life, stop, session) = (rig.life(), handle.stopper(), tracing::Span::current());
    let (following_sweep, asks) = (&mut sweep, asks(signals, &lost, keeping.as_ref()));
    let (outcome, panicked) = std::thread::scope(|scope| {
        let follow = move || {
            let _session = session.enter();
            follow(note_in, &life, &mut snapshots, asks, ambient_control, following_sweep, handle)
        };
        let following = std::thread::Builder::new().name("sweep".into()).spawn_scoped(scope, follow);
        // The receiver of the updates is foreign code, and may panic where its terminal is gone. Then the rig
        // is stopped before anything else, the measurements are stored, and the panic continues with the rig
        // off.
        let finished = std::panic::catch_unwind(AssertUnwindSafe(|| save(update)));
        if finished.is_err() {
            stop();
            lost.store(true, Ordering::Relaxed);
            save(&mut |_| {});
        }
        let outcome = following.map_err(|why| fault(threads::refused(why)));
        let panicked = |_| fault("the sweep's thread panicked");
        (outcome.and_then(|following| following.join().map_err(panicked)), finished.err())
    });

    // Whatever ended it: off first.
    let ended = rig.end();
    let off_reported = std::panic::catch_unwind(AssertUnwindSafe(|| update(Update::Off(&ended.off))));
    let panicked = panicked.or(off_reported.err());
    drop(held);
    if let Some(keeping) = keeping {
        keeping.end(ended.off.read_back);
    }
    let (stalls, held_back) = (monitor.finish(), clock.held_back());
    let written = recording.end(last_words(&outcome, &stalls, &ended).map_err(fault)?);
    let Ended { report, links, off } = ended;
    if let Some(panic) = panicked {
        tracing::error!("{}", off.words());
        std::panic::resume_unwind(panic);
    }
    let stuck = || fault("the loop's thread is stuck inside a driver");
    let ended = outcome.and_then(|outcome| Ok((outcome, written?, report.ok_or_else(stuck)?)));
    let (outcome, written, report) = ended.map_err(|fault| fault.wrap_err(off.words()))?;
    if let Some(what) = &report.panicked {
        tracing::error!(what, "a port panicked in the loop: the rig was stopped");
    }
    let outcome = as_recorded(outcome, &written, unsaved);
    let record_lost = written.lost_rows + report.ring_drops;
    let agreement = sweep.agreement(outcome == Outcome::Complete);
    Ok(writer.end(outcome, agreement, Some((report, stalls, held_back)), record_lost, links, off))
}

/// What the record ends with, by name, as JSON.
fn last_words(
    outcome: &miette::Result<Outcome>,
    stalls: &StallReport,
    of: &Ended,
) -> serde_json::Result<Last> {
    let last = [
        ("loop", serde_json::to_string(&of.report)),
        ("stalls", serde_json::to_string(stalls)),
        ("links", serde_json::to_string(&of.links)),
        ("off", serde_json::to_string(&of.off)),
    ];
    let ended = outcome.iter().map(|outcome| ("outcome", serde_json::to_string(outcome)));
    ended.chain(last).map(|(name, text)| Ok((name.to_string(), text?))).collect()
}

/// The outcome, `RecordLost` where the last rows did not reach the file; logs why the record was lost.
fn as_recorded(outcome: Outcome, written: &Written, unsaved: Option<miette::Report>) -> Outcome {
    for why in written.problem.iter().cloned().chain(unsaved.map(|e| format!("{e:#}"))) {
        tracing::error!(why, "the record could not be saved: the sweep was stopped");
    }
    let lost = written.problem.is_some() && outcome == Outcome::Complete;
    if lost { Outcome::RecordLost } else { outcome }
}

/// A virtual rig's instruments as they are served, what is beside the rig, and its ports.
type Connected = (Option<(Emulators, SharedPlant)>, AmbientControl, drivers::Rig);

/// Serves the virtual rig where the setup has one, and opens the instruments.
fn connect(job: &Job, sweep: &Sweep, answers: OperatorAnswers, clock: &Clock) -> miette::Result<Connected> {
    let mut instruments = job.setup.instruments();
    let mut emulators = None;
    if job.setup.file.virtual_rig.is_some() {
        // The real places are put into the setup's.
        let plant = SharedPlant::new(sim::wire::world::WorldPlant::new(job.world()?), clock.clone());
        let served = crate::emulators::serve(&mut instruments, &plant, false);
        emulators = Some((served?, plant));
    }
    let air = emulators.as_ref().map(|(_, plant)| SimulatedAir::Served(plant.clone()));
    let ambient_control = AmbientControl::open(sweep, instruments.chamber.as_ref(), air, answers)?;
    let rig = drivers::open(&instruments, clock.clone()).map_err(|e| {
        miette::miette!(help = "check address, wiring and power; 'muprime doctor --setup' says more", "{e}")
    })?;
    Ok((emulators, ambient_control, rig))
}

/// What the sweep has to keep and to tell.
struct Note {
    at: Nanos,
    events: Vec<Event>,
    pass: Option<MeasuredPass>,
    /// Passes made, planned, s to go.
    progress: (usize, usize, f64),
    /// The cycle, if it is to be shown.
    state: Option<Snapshot>,
}

/// The requests to the sweep. A request to stop counts once; so does the loss of the record or the ledger.
fn asks(signals: &Signals, lost: &AtomicBool, keeping: Option<&Keeping>) -> impl FnMut() -> Requests {
    let (mut stops, mut knows) = (0, false);
    let mut ends = move || {
        let requested = signals.stops.load(Ordering::Relaxed);
        if requested > stops {
            stops = requested;
            return Some(End::Requested);
        }
        let unsaved = keeping.is_some_and(|keeping| !keeping.holds());
        let end = match lost.load(Ordering::Relaxed) {
            true => Some(End::NotSaved),
            false => unsaved.then_some(End::ExposureNotSaved),
        };
        let end = end.filter(|_| !knows);
        knows |= end.is_some();
        end
    };
    move || Requests { end: ends(), pause: signals.paused.load(Ordering::Relaxed) }
}

/// Answers the loop's rows until the sweep ends. The last argument is dropped first: the notes end after loop
/// and the rig's side.
fn follow(
    notes: Sender<Note>,
    life: &Lifeline,
    snapshots: &mut Snapshots,
    mut asks: impl FnMut() -> Requests,
    mut ambient_control: AmbientControl,
    sweep: &mut Sweep,
    mut handle: LoopHandle,
) -> Outcome {
    supervisor::sweep(&mut handle, sweep, &mut asks, &mut |row, sweep, reaction| {
        ambient_control.serve(row.now, sweep, &reaction);
        let state = snapshots.take(row).map(|state| Snapshot { driven: Some(life.driven()), ..state });
        if state.is_some() || !reaction.events.is_empty() || reaction.pass.is_some() {
            let (done, all) = sweep.progress();
            let progress = (done, all, sweep.remaining_s());
            let (events, pass) = (reaction.events, reaction.pass);
            // The other end lives as long as this one: it reads until this end is dropped.
            let _ = notes.send(Note { at: row.now, events, pass, progress, state });
        }
    })
}

/// Passes notes on until the sweep ends: to the disk, to whoever watches, and into the record. `unsaved`
/// takes why the first pass that could not be stored was not.
fn pass_on(
    notes: &Receiver<Note>,
    writer: &mut RunWriter,
    lost: &AtomicBool,
    entries: &Sender<RecordedNote>,
    unsaved: &mut Option<miette::Report>,
    update: &mut dyn FnMut(Update<'_>),
) {
    for note in notes {
        // Passes that come until the sweep has stopped are stored if possible.
        if let Err(why) = writer.save(&note.events, note.pass.as_ref(), update) {
            lost.store(true, Ordering::Relaxed);
            unsaved.get_or_insert(why);
        }
        if note.pass.is_some() {
            let (done, all, left_s) = note.progress;
            update(Update::Progress(done, all, left_s));
        }
        if let Some(snapshot) = &note.state {
            update(Update::State(snapshot));
        }
        if note.pass.is_some() || !note.events.is_empty() {
            let _ = entries.send((note.at, note.events, note.pass));
        }
    }
}

/// A fault after the loop had begun: no refusal, the rig was touched.
fn fault(why: impl std::fmt::Display) -> miette::Report {
    miette::miette!("{why}").wrap_err(Unfinished::Internal)
}
