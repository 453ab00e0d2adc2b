//! A sweep in wall-clock time. Four threads, each with one duty: the loop; the record's writer; the sweep, which answers
//! the loop's rows within a millisecond or two; and this one, which makes passes safe on the disk and hands the news on:
//! what is printed, published or shown has bounded queues and threads of its own. A slow disk so reaches neither the loop nor the
//! stage, and a reader that takes nothing does not reach this thread.
#![allow(clippy::disallowed_methods, reason = "a sweep in wall-clock time, beside the loop")]

mod writer;

use crate::dead_man_key::DeadManKey;
use crate::exposure::Ledger;
use crate::rig_lock::RigClaim;
use crate::wall_loop::{Ended, Parts, WallLoop};
use miette::{IntoDiagnostic, WrapErr};
use realtime::clock::Clock;
use realtime::pacing;
use realtime::ports::Nanos;
use realtime::stall_monitor::StallMonitor;
use realtime::turn::Ports;
use runs::ambient::{Bench, World};
use runs::exposure_left::Left;
use runs::sequence::{Event, MeasuredPass, Outcome};
use runs::session::keeper::{self, Keeper};
use runs::session::{Begun, Job, Signals, Snapshot, Snapshots, Summary, Unfinished, Update, words};
use runs::supervisor::{self, End, Requests};
use std::collections::BTreeMap;
use std::panic::AssertUnwindSafe;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::time::Instant;

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

/// Runs a job: in wall-clock time over its instruments, or in virtual time where the job says so. In wall-clock time `update` must
/// wait for nothing: whoever keeps the passes calls it.
///
/// # Errors
/// Whatever prevents it before anything was commanded (a refusal), or a fault of this program.
pub fn run(job: Job, signals: &Signals, update: &mut dyn FnMut(Update<'_>)) -> miette::Result<Summary> {
    let mut job = job;
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

/// Runs a job in wall-clock time.
fn over_instruments(
    mut job: Job,
    begun: Begun,
    signals: &Signals,
    news: &mut dyn FnMut(Update<'_>),
) -> miette::Result<Summary> {
    let Begun { dir, mut sequence, planned, answers, .. } = begun;
    let key = if job.setup.hand_at_key() { Some(DeadManKey::open()?) } else { None };
    let _claim = RigClaim::take(&job.setup)?;
    let ledger = Ledger::open(&job.setup, &job.notes)?;
    if let Some(ledger) = &ledger {
        job.setup.config.exposed = ledger.exposed();
        sequence.exposure_left(Left::of(&job.setup.config.limits, &job.setup.config.exposed));
    }
    let epoch = Instant::now();
    let simulated = job.setup.file.virtual_rig.is_some();
    let clock = if simulated { Clock::holdable(epoch) } else { Clock::from(epoch) };
    let origin_ns = pacing::monotonic_ns();
    let start_unix_ns = keeper::unix_ns();
    let mut instruments = job.setup.instruments();
    let embedded = simulated.then(|| embed(&job, &mut instruments, clock.clone())).transpose()?;
    let air = embedded.as_ref().map(|(_, plant)| World::Served(plant.clone()));
    let mut bench = Bench::open(&sequence, instruments.chamber.as_ref(), air, answers)?;
    let rig = drivers::open(&instruments, clock.clone()).map_err(|e| {
        miette::miette!(help = "check address, wiring and power; 'muprime doctor --setup' says more", "{e}")
    })?;
    let mut keeper = Keeper::begin(&job, dir, planned)?;
    let file = keeper.new_record()?;
    let preamble = keeper::preamble(&job, start_unix_ns)?;

    let lost = Arc::new(AtomicBool::new(false));
    let monitor = StallMonitor::start(origin_ns).into_diagnostic().wrap_err(Unfinished::Internal)?;
    let ports = job.setup.certificates.applied(Ports::new(rig.force, rig.amplifier, rig.stage));
    let (rig, mut handle, row_out) = WallLoop::start(Parts {
        config: job.setup.config,
        model: Arc::clone(&job.model),
        ports: ports.with_supply(rig.supply).with_contacts(rig.contacts),
        links: rig.links,
        pacing: job.setup.file.pace.pacing(),
        origin_ns,
    })
    .wrap_err(Unfinished::Internal)?;
    let keeping = match ledger {
        None => None,
        Some(ledger) => Some(ledger.keep(rig.life(), handle.stopper()).into_diagnostic()?),
    };
    let held = key.map(|key| key.hold(handle.sender())).transpose().into_diagnostic()?;
    let (to_writer, notes) = channel();
    let (last_in, last_out) = channel();
    let writing = {
        let lost = RaisedByPanic(Arc::clone(&lost));
        let clock = clock.join(writer::SLACK);
        let write = move || writer::write(file, preamble, row_out, &notes, &last_out, &lost.0, &clock);
        std::thread::Builder::new().name("recorder".into()).spawn(write).into_diagnostic()?
    };

    let (note_in, note_out) = channel::<Note>();
    let mut unkept = None;
    let (life, period) = (rig.life(), job.setup.config.limits.timing.cycle);
    let (outcome, panicked) = std::thread::scope(|scope| {
        let (following_sequence, lost, stop) = (&mut sequence, &*lost, handle.stopper());
        let keeping = keeping.as_ref();
        let session = tracing::Span::current();
        let following = scope.spawn(move || {
            let _session = session.enter();
            let (mut stops, mut knows) = (0, false);
            let mut ends = || {
                let requested = signals.stops.load(Ordering::Relaxed);
                if requested > stops {
                    stops = requested;
                    return Some(End::Requested);
                }
                let unkept = keeping.is_some_and(|keeping| !keeping.holds());
                let end = match lost.load(Ordering::Relaxed) {
                    true => Some(End::NotKept),
                    false => unkept.then_some(End::ExposureNotKept),
                };
                let end = end.filter(|_| !knows);
                knows |= end.is_some();
                end
            };
            let mut ask = || Requests { end: ends(), pause: signals.paused.load(Ordering::Relaxed) };
            let mut snapshots = Snapshots::of(start_unix_ns, period);
            supervisor::sweep(&mut handle, following_sequence, &mut ask, &mut |row, sequence, reaction| {
                bench.serve(row.now, sequence, &reaction);
                let state =
                    snapshots.take(row).map(|state| Snapshot { driven: Some(life.driven()), ..state });
                if state.is_some() || !reaction.events.is_empty() || reaction.pass.is_some() {
                    let (done, all) = sequence.progress();
                    let progress = (done, all, sequence.remaining_s());
                    let (events, pass) = (reaction.events, reaction.pass);
                    // The other end lives as long as this one: it reads until this end is dropped.
                    let _ = note_in.send(Note { at: row.now, events, pass, progress, state });
                }
            })
        });
        let mut keep = |notes: &Receiver<Note>, news: &mut dyn FnMut(Update<'_>)| {
            for note in notes {
                // Passes that come until the sweep has stopped are stored if possible.
                if let Err(why) = keeper.keep(&note.events, note.pass.as_ref(), news) {
                    lost.store(true, Ordering::Relaxed);
                    unkept.get_or_insert(why);
                }
                if note.pass.is_some() {
                    let (done, all, left_s) = note.progress;
                    news(Update::Progress(done, all, left_s));
                }
                if let Some(snapshot) = &note.state {
                    news(Update::State(snapshot));
                }
                if note.pass.is_some() || !note.events.is_empty() {
                    let _ = to_writer.send((note.at, note.events, note.pass));
                }
            }
        };
        // The receiver of the updates is foreign code, and may panic where its terminal is gone. Then the rig
        // is stopped before anything else, the measurements are stored, and the panic continues with the rig
        // off.
        let finished = std::panic::catch_unwind(AssertUnwindSafe(|| keep(&note_out, news)));
        if finished.is_err() {
            stop();
            lost.store(true, Ordering::Relaxed);
            keep(&note_out, &mut |_| {});
        }
        (following.join(), finished.err())
    });
    // Whatever ended it: off first.
    let Ended { report, links, off } = rig.end();
    let said_off = std::panic::catch_unwind(AssertUnwindSafe(|| news(Update::Off(&off))));
    let panicked = panicked.or(said_off.err());
    drop(held);
    if let Some(keeping) = keeping {
        keeping.end(off.read_back);
    }
    let stalls = monitor.finish();
    let held = clock.held_back();
    drop(to_writer);
    let outcome = outcome.map_err(|_| fault("the sweep's thread panicked"));
    let mut last = BTreeMap::new();
    if let Ok(outcome) = &outcome {
        last.insert("outcome".to_string(), words(outcome)?);
    }
    last.insert("loop".to_string(), serde_json::to_string(&report).into_diagnostic()?);
    last.insert("stalls".to_string(), serde_json::to_string(&stalls).into_diagnostic()?);
    last.insert("links".to_string(), serde_json::to_string(&links).into_diagnostic()?);
    last.insert("off".to_string(), serde_json::to_string(&off).into_diagnostic()?);
    let _ = last_in.send(last);
    // A writer that cannot write waits for the other end of this channel to go.
    drop(last_in);
    let written = writing.join().map_err(|_| fault("the recorder's thread panicked"));
    if let Some(panic) = panicked {
        tracing::error!("{}", off.words());
        std::panic::resume_unwind(panic);
    }
    let ended = outcome.and_then(|outcome| Ok((outcome, written?, report)));
    let (outcome, written, report) = match ended {
        Ok((outcome, written, Some(report))) => (outcome, written, report),
        Ok((.., None)) => {
            return Err(fault("the loop's thread is stuck inside a driver").wrap_err(off.words()));
        }
        Err(fault) => return Err(fault.wrap_err(off.words())),
    };
    if let Some(what) = &report.panicked {
        tracing::error!(what, "a port panicked in the loop: the rig was stopped");
    }
    for why in written.problem.iter().cloned().chain(unkept.map(|e| format!("{e:#}"))) {
        tracing::error!(why, "the record could not be saved: the sweep was stopped");
    }
    // A file that failed only while the last rows went into it: the sweep was over, but it is not recorded.
    let unrecorded = written.problem.is_some() && outcome == Outcome::Complete;
    let outcome = if unrecorded { Outcome::RecordLost } else { outcome };
    let record_lost = written.lost_rows + report.ring_drops;
    let agreement = sequence.agreement(outcome == Outcome::Complete);
    Ok(keeper.end(outcome, agreement, Some((report, stalls, held)), record_lost, links, off))
}

/// Raises a flag where the thread that holds it panics.
struct RaisedByPanic(Arc<AtomicBool>);

impl Drop for RaisedByPanic {
    fn drop(&mut self) {
        self.0.fetch_or(std::thread::panicking(), Ordering::Relaxed);
    }
}

/// A fault of this program, after the rig was touched.
fn fault(what: &'static str) -> miette::Report {
    miette::miette!("{what}").wrap_err(Unfinished::Internal)
}

/// Serves the virtual rig where the setup looks for its instruments, and puts the real places there.
fn embed(
    job: &Job,
    instruments: &mut drivers::InstrumentsSetup,
    clock: Clock,
) -> miette::Result<(crate::emulators::Embedded, sim::wire::SharedPlant)> {
    let plant = sim::wire::SharedPlant::new(sim::wire::world::WorldPlant::new(job.world()?), clock);
    let embedded = crate::emulators::embed(instruments, &plant, false);
    Ok((embedded.map_err(|problem| miette::miette!("{problem}"))?, plant))
}
