//! A sweep in virtual time: one thread, no clock, the same bytes for the same seed.

use super::keeper::{self, Keeper};
use super::{Job, News, Signals, Summary};
use crate::plan::{Plan, Resolution};
use crate::run_dir::RunDir;
use crate::sequence::{MeasuredPass, Outcome, Sequence};
use crate::setup::Setup;
use miette::{IntoDiagnostic, WrapErr};
use models::prediction::FrictionModel;
use realtime::cycle::{Command, CycleState};
use realtime::ports::Nanos;
use realtime::recorder::Recorder;
use realtime::turn::{Ports, Tick, turn};
use sim::virtual_rig::VirtualRig;
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// A record in virtual time starts at this wall-clock time (2000-01-01), so that equal seeds give equal files.
const EPOCH_UNIX_NS: u64 = 946_684_800_000_000_000;
/// Rows between two flushes of the record: 50 ms at 1 kHz.
const FLUSH_EVERY: u64 = 50;

/// Runs a job in virtual time, which begins at `start_s` s.
pub fn run(
    job: Job,
    dir: RunDir,
    start_s: f64,
    mut sequence: Sequence,
    planned: usize,
    signals: &Signals,
    news: &mut dyn FnMut(News<'_>),
) -> miette::Result<Summary> {
    if job.setup.file.virtual_rig.is_none() {
        miette::bail!(
            help = "leave --fast out, or give the setup a [virtual] section",
            "'{}' is a real rig: it cannot run in virtual time",
            job.setup.file.name
        );
    }
    let rig = VirtualRig::of(job.world()?);
    let mut kept = Keeper::begin(&job, dir, planned, keeper::unix_ns())?;
    let swept = sweep(job, rig, Nanos::from_seconds(start_s), &mut kept, &mut sequence, signals, news);
    let outcome = swept.unwrap_or_else(|why| {
        tracing::error!("the record could not be kept: the sweep was stopped: {why:#}");
        Outcome::RecordLost
    });
    Ok(kept.end(outcome, sequence.departed(), None, 0, BTreeMap::new()))
}

fn sweep(
    job: Job,
    rig: VirtualRig,
    start: Nanos,
    kept: &mut Keeper,
    sequence: &mut Sequence,
    signals: &Signals,
    news: &mut dyn FnMut(News<'_>),
) -> miette::Result<Outcome> {
    let [force, amplifier, stage] = rig.split();
    let force = job.setup.certificates.calibrated(Box::new(force));
    let amplifier = job.setup.certificates.calibrated_amplifier(Box::new(amplifier));
    let mut ports = Ports { force, amplifier, stage: Box::new(stage) };
    let file = kept.new_record()?;
    let disk = file.handle()?;
    let mut recorder = Recorder::begin(file, keeper::preamble(&job, EPOCH_UNIX_NS)?).into_diagnostic()?;
    let config = job.setup.config;
    let mut state = CycleState::default();
    let mut queue: VecDeque<Command> = VecDeque::new();
    let mut number = 0u64;
    let mut next = |queue: &mut VecDeque<Command>| {
        number += 1;
        let now = Nanos(start.0 + number * config.limits.timing.cycle.0);
        let tick = Tick { number, lateness: Nanos(0), now };
        turn(&config, &*job.model, &mut state, &mut ports, &mut || queue.pop_front(), tick)
    };
    let outcome = loop {
        let row = next(&mut queue);
        recorder.row(&row).into_diagnostic()?;
        if signals.stops.swap(0, Ordering::Relaxed) > 0 {
            sequence.stop();
        }
        let reaction = sequence.on_row(&row);
        keeper::record(&mut recorder, row.now, &reaction.events, reaction.pass.as_ref())?;
        kept.keep(&reaction.events, reaction.pass.as_ref(), news)?;
        if reaction.pass.is_some() {
            disk.still_there()?;
            let (done, all) = sequence.progress();
            news(News::Progress(done, all, sequence.remaining_s()));
        }
        queue.extend(reaction.commands);
        if row.cycle.is_multiple_of(FLUSH_EVERY) {
            recorder.flush().into_diagnostic()?;
        }
        if let Some(outcome) = reaction.outcome {
            break outcome;
        }
    };
    // Let the stop reach the rig, so that the record shows the safe state.
    for _ in 0..20 {
        recorder.row(&next(&mut queue)).into_diagnostic()?;
    }
    let last = BTreeMap::from([("outcome".to_string(), words(&outcome)?)]);
    recorder.end(last).into_diagnostic().wrap_err("the record")?;
    disk.sync()?;
    Ok(outcome)
}

/// What a sweep in memory comes to.
#[derive(Clone, Debug)]
pub struct Rehearsal {
    /// The passes.
    pub passes: Vec<MeasuredPass>,
    /// How it ended.
    pub outcome: Outcome,
    /// Whether the model left the measurement.
    pub departed: bool,
    /// Cycles run.
    pub cycles: u64,
}

/// Runs a plan on a world in virtual time and keeps nothing: for statistics, and to see beforehand what a plan shows.
///
/// # Errors
/// A plan that the limits do not allow, or a world that cannot be.
pub fn rehearse(
    setup: &Setup,
    plan: &Plan,
    seed: u64,
    world: &sim::world::WorldConfig,
    model: Arc<dyn FrictionModel>,
) -> miette::Result<Rehearsal> {
    let resolution = Resolution { amplitude_pp_m: 1e-9, frequency_hz: 0.1 };
    let points = plan.points(seed, &setup.config.limits, &resolution)?;
    let mut sequence =
        Sequence::new(points, plan.file.pass, Arc::clone(&model), &setup.tip, setup.file.noise);
    let [force, amplifier, stage] =
        VirtualRig::new(world, seed).map_err(|e| miette::miette!("the virtual rig: {e}"))?.split();
    let mut ports = Ports { force: Box::new(force), amplifier: Box::new(amplifier), stage: Box::new(stage) };
    let config = setup.config;
    let mut state = CycleState::default();
    let mut queue: VecDeque<Command> = VecDeque::new();
    let mut passes = Vec::new();
    for number in 1.. {
        let now = Nanos(number * config.limits.timing.cycle.0);
        let tick = Tick { number, lateness: Nanos(0), now };
        let row = turn(&config, &*model, &mut state, &mut ports, &mut || queue.pop_front(), tick);
        let reaction = sequence.on_row(&row);
        passes.extend(reaction.pass);
        queue.extend(reaction.commands);
        if let Some(outcome) = reaction.outcome {
            let departed = sequence.departed();
            return Ok(Rehearsal { passes, outcome, departed, cycles: number });
        }
    }
    unreachable!("the sequence ends every sweep")
}

/// An outcome as JSON, for the record's last words.
pub fn words(outcome: &Outcome) -> miette::Result<String> {
    serde_json::to_string(outcome).into_diagnostic()
}
