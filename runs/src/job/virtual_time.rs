//! A sweep in virtual time: one thread, no clock, the same bytes for the same seed.

use super::force_counts::ForceCounts;
use super::run_writer::{self, RunWriter};
use super::telemetry::Snapshots;
use super::{Begun, Job, Signals, Summary, Update};
use crate::ambient::{AmbientControl, SimulatedAir};
use crate::files::GuardedFile;
use crate::supervisor::{self, End, OffReport, Requests, VirtualLoop};
use crate::sweep::{Outcome, Reaction, Sweep};
use miette::{IntoDiagnostic, WrapErr};
use realtime::ports::{ForceSensor, Nanos};
use realtime::recorder::Recorder;
use realtime::{Ports, Row};
use sim::virtual_rig::{SharedRig, VirtualRig};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// A record in virtual time starts at this wall-clock time (2000-01-01), so that equal seeds give equal files.
const EPOCH_UNIX_NS: u64 = 946_684_800_000_000_000;
/// Rows between two flushes of the record: 50 ms at 1 kHz.
const FLUSH_EVERY: u64 = 50;

/// Runs a job in virtual time.
pub fn run(
    job: Job,
    begun: Begun,
    signals: &Signals,
    update: &mut dyn FnMut(Update<'_>),
) -> miette::Result<Summary> {
    let Begun { dir, mut sweep, planned, start_s, answers } = begun;
    if job.setup.file.virtual_rig.is_none() {
        miette::bail!(
            help = "leave --fast out, or give the setup a [virtual] section",
            "'{}' is a real rig: it cannot run in virtual time",
            job.setup.file.name
        );
    }
    let world = VirtualRig { world: job.world()? }.split();
    let air = SimulatedAir::Virtual(world[0].clone());
    let mut ambient_control = AmbientControl::open(&sweep, None, Some(air), answers)?;
    let ports = ports_of(&job, world)?;
    let preamble = run_writer::preamble(&job, EPOCH_UNIX_NS)?;
    let mut writer = RunWriter::begin(&job, dir, planned)?;
    let rig =
        VirtualLoop::new(job.setup.config, Arc::clone(&job.model), ports).from(Nanos::from_seconds(start_s));
    let record = writer.new_record().and_then(|file| {
        let disk = file.handle()?;
        Ok((Recorder::begin(file, preamble).into_diagnostic()?, disk))
    });
    let (swept, off) = match record {
        Ok(record) => {
            run_sweep(rig, record, &mut writer, (&mut sweep, &mut ambient_control), signals, update)
        }
        // Before the first row nothing has been driven.
        Err(why) => (Err(why), OffReport::off()),
    };
    let outcome = swept.unwrap_or_else(|why| {
        tracing::error!("the record could not be saved: the sweep was stopped: {why:#}");
        Outcome::RecordLost
    });
    let agreement = sweep.agreement(outcome == Outcome::Complete);
    Ok(writer.end(outcome, agreement, None, 0, BTreeMap::new(), off))
}

/// What the loop of a job has to do with: the virtual rig, through the setup's certificates.
fn ports_of(job: &Job, [force, amplifier, stage]: [SharedRig; 3]) -> miette::Result<Ports> {
    let mut force: Box<dyn ForceSensor> = Box::new(force);
    if job.setup.certificates.force.is_some() {
        force = Box::new(ForceCounts::new(force, &job.setup.file).into_diagnostic()?);
    }
    let ports = Ports::new(force, Box::new(amplifier), Box::new(stage.clone()));
    let mut ports = job.setup.certificates.applied(ports);
    if job.setup.file.supply_relay.is_some() {
        ports.supply = Box::new(stage.clone());
    }
    if job.setup.file.safety_inputs.is_some() {
        ports.contacts = Box::new(stage);
    }
    Ok(ports)
}

/// Sweeps, and ends the record; says what became of the output too.
fn run_sweep(
    mut rig: VirtualLoop,
    (mut recorder, disk): (Recorder<GuardedFile>, GuardedFile),
    writer: &mut RunWriter,
    (sweep, ambient_control): (&mut Sweep, &mut AmbientControl),
    signals: &Signals,
    update: &mut dyn FnMut(Update<'_>),
) -> (miette::Result<Outcome>, OffReport) {
    // A failure to save ends the sweep.
    let unsaved = RefCell::new(None);
    let (mut knows, mut stops) = (false, 0);
    let mut ask = || {
        // In virtual time there is nothing to wait for: a pause would only fill the record.
        let ends = |end| Requests { end, pause: false };
        if !knows && unsaved.borrow().is_some() {
            knows = true;
            return ends(Some(End::NotSaved));
        }
        // Counted, not taken: a campaign looks at it after the session.
        let before = std::mem::replace(&mut stops, signals.stops.load(Ordering::Relaxed));
        ends((stops > before).then_some(End::Requested))
    };
    let mut snapshots = Snapshots::of(EPOCH_UNIX_NS, rig.period());
    let mut save = |row: &Row, sweep: &Sweep, reaction: Reaction| -> miette::Result<()> {
        recorder.row(row).into_diagnostic()?;
        if let Some(snapshot) = snapshots.take(row) {
            update(Update::State(&snapshot));
        }
        run_writer::record(&mut recorder, row.now, &reaction.events, reaction.pass.as_ref())?;
        writer.save(&reaction.events, reaction.pass.as_ref(), update)?;
        if reaction.pass.is_some() {
            disk.still_there()?;
            let (done, all) = sweep.progress();
            update(Update::Progress(done, all, sweep.remaining_s()));
        }
        if row.cycle.is_multiple_of(FLUSH_EVERY) {
            recorder.flush().into_diagnostic()?;
        }
        Ok(())
    };
    let outcome = supervisor::sweep(&mut rig, sweep, &mut ask, &mut |row, sweep, reaction| {
        ambient_control.serve(row.now, sweep, &reaction);
        if unsaved.borrow().is_none() {
            *unsaved.borrow_mut() = save(row, sweep, reaction).err();
        }
    });
    // The stop reaches the rig, so that the record shows the safe state; saved or not, off comes first.
    let mut recorded = Ok(());
    let off = rig.end(&mut |row| {
        if recorded.is_ok() {
            recorded = recorder.row(row);
        }
    });
    let ended = || {
        unsaved.into_inner().map_or(Ok(()), Err)?;
        recorded.into_diagnostic()?;
        let last = BTreeMap::from([("outcome".to_string(), outcome_json(&outcome)?)]);
        recorder.end(last).into_diagnostic().wrap_err("the record")?;
        disk.sync()?;
        Ok(outcome)
    };
    (ended(), off)
}

/// An outcome as JSON, for the record's last words.
pub fn outcome_json(outcome: &Outcome) -> miette::Result<String> {
    serde_json::to_string(outcome).into_diagnostic()
}
