//! The instruments of a setup, read together as by a run's loop, and judged by what a run needs; and this
//! computer ([`machine`]). Nothing is commanded but the safe set-points with which every link begins and ends.

#![allow(clippy::disallowed_methods, reason = "instruments are read in wall-clock time; no loop runs")]

mod follow;
mod judge;
pub mod machine;
mod ports;

pub use follow::{ChannelReport, Follow};
pub use judge::{Finding, InspectionScope, judge};

use drivers::{HealthReport, InstrumentSetup, InstrumentsSetup, OpenError};
use ports::Opened;
use realtime::cycle::{COMMANDS_PER_CYCLE, Config, CycleState, Inputs, decide};
use realtime::ports::{AmplifierState, Channel, Nanos, NoData, Quality, Sample};
use realtime::safety::{ChannelTiming, Observation, Timing, TripCause};
use realtime::stall_monitor::{StallMonitor, StallReport};
use runs::Setup;
use serde::Serialize;
use std::time::{Duration, Instant};

/// How long the instruments are read: a rule about the load needs two seconds.
const INSPECTION: Duration = Duration::from_millis(3000);
/// What of that the links may take to run evenly.
const SETTLING: Duration = Duration::from_millis(400);

/// What an instrument is to the rig, in the words of the setup.
pub type Role = &'static str;

/// What a link counted in a second, over the whole inspection.
#[derive(Clone, Debug, Default, Serialize)]
pub struct LinkCounts {
    /// Samples a second.
    pub samples_per_s: f64,
    /// Share of the answers that were none: corrupt, refused, or too late.
    pub bad_share: f64,
    /// Of an instrument that sends by itself: share of its samples that never came. A polled one has none.
    pub lost_share: f64,
    /// Whether answers came and none was a new sample.
    pub repeats_only: bool,
    /// Times that the link was made anew.
    pub reconnected: u64,
    /// The latest problem in words; empty where there was none.
    pub last_problem: String,
    /// The fault that it reports, in its profile's words; empty for none.
    pub fault: String,
}

/// One instrument as it was found.
pub struct InstrumentFound {
    /// What it is to the rig.
    pub role: Role,
    /// Its profile's id.
    pub id: String,
    /// Its address.
    pub address: String,
    /// What its link counted, or why there is none.
    pub answers: Result<LinkCounts, OpenError>,
    /// Its channels.
    pub channels: Vec<ChannelReport>,
}

/// Everything that was found.
pub struct Inspection {
    /// Each instrument, in the order of the setup.
    pub found: Vec<InstrumentFound>,
    /// What was seen last of all; of what could not be opened [`NoData::NotFitted`].
    pub seen: Observation,
    /// The rule that most often prevented arming, with the share of cycles in which any did; if all opened.
    pub blocking: Option<(TripCause, f64)>,
    /// Stalls of this computer during the inspection: what the links lost then is not their fault.
    pub stalls: StallReport,
}

/// A state as a sample. Its number stands for the raw counts that it does not have: states are never repeats.
fn of_state(value: f64, taken_at: Nanos, sequence: u32) -> Sample {
    Sample { value, raw: i64::from(sequence), taken_at, sequence, quality: Quality::Good }
}

/// What a channel is and shows: the instrument that it is of, its name, its unit, its timing, what was seen.
type Shown = (Role, &'static str, &'static str, fn(&Timing) -> &ChannelTiming, Channel);

fn channels(seen: &Observation) -> [Shown; 9] {
    let (f, a, s, c) = (&seen.forces, seen.amplifier, seen.stage, seen.contacts);
    let output = a.map(|a| of_state(f64::from(a.output_on), a.taken_at, a.sequence));
    let position = s.map(|s| of_state(s.position_m, s.taken_at, s.sequence));
    let velocity = s.map(|s| of_state(s.velocity_m_s, s.taken_at, s.sequence));
    let closed = seen.supply.map(|s| of_state(f64::from(!s.cut), s.taken_at, s.sequence));
    let fitted = [c.emergency_stop, c.interlock, c.dead_man];
    let fitted = fitted.into_iter().find(|c| *c != Err(NoData::NotFitted));
    let fitted = fitted.unwrap_or(Err(NoData::NotFitted));
    let contacts = fitted.map(|c| of_state(f64::from(c.closed), c.taken_at, c.sequence));
    [
        ("force", "lateral", "N", |t| &t.lateral, f.lateral),
        ("force", "normal", "N", |t| &t.normal, f.normal),
        ("amplifier", "output", "1", |t| &t.amplifier, output),
        ("amplifier", "amplitude", "m", |t| &t.amplifier, a.and_then(|a| a.amplitude)),
        ("amplifier", "temperature", "degC", |t| &t.amplifier, a.and_then(|a| a.temperature_c)),
        ("stage", "position", "m", |t| &t.stage, position),
        ("stage", "velocity", "m/s", |t| &t.stage, velocity),
        ("supply_relay", "closed", "1", |t| &t.supply, closed),
        ("safety_inputs", "contacts", "1", |t| &t.contacts, contacts),
    ]
}

/// The channels of one instrument, as they were followed; each is reported once.
fn reports(
    followed: &mut [Follow; 9],
    of: &Opened<'_>,
    last: &Observation,
    timing: &Timing,
    seconds: f64,
) -> Vec<ChannelReport> {
    let fitted =
        |c: fn(&AmplifierState) -> Channel| last.amplifier.is_ok_and(|a| c(&a) != Err(NoData::NotFitted));
    let is_there = |name: &str| match name {
        "lateral" => of.axes.0,
        "normal" => of.axes.1,
        "amplitude" => fitted(|a| a.amplitude),
        "temperature" => fitted(|a| a.temperature_c),
        _ => true,
    };
    let own = followed.iter_mut().zip(channels(last));
    let own = own.filter(|(_, (role, name, ..))| *role == of.role && is_there(name));
    own.map(|(follow, (_, name, unit, timing_of, _))| {
        std::mem::take(follow).report(name, unit, timing_of(timing), seconds)
    })
    .collect()
}

impl Inspection {
    /// Whether a relay is fitted in the amplifier's supply and reads open.
    fn supply_is_open(&self) -> bool {
        self.seen.supply.is_ok_and(|supply| supply.cut)
    }
}

/// The rules of the loop over what is seen, without a hand at the dead-man device and without a relay that
/// nobody closes: those are judged apart.
struct Rules {
    config: Config,
    state: CycleState,
    cycles: u32,
    blocked: Vec<(TripCause, u32)>,
}

impl Rules {
    fn of(setup: &Setup, relay: bool) -> Self {
        let mut config = setup.config;
        config.limits.human_contact = false;
        config.limits.supply_required = false;
        config.limits.amplifier_watchdog |= relay;
        Rules { config, state: CycleState::default(), cycles: 0, blocked: Vec::new() }
    }

    fn step(&mut self, seen: &Observation, now: Nanos, counts: bool) {
        let mut judged = Observation { supply: Err(NoData::NotFitted), ..*seen };
        judged.contacts.dead_man = Err(NoData::NotFitted);
        // An amplifier without supply has no fault of its own.
        let open = seen.supply.is_ok_and(|supply| supply.cut);
        if let (true, Ok(amplifier)) = (open, &mut judged.amplifier) {
            amplifier.fault = false;
        }
        let inputs = Inputs { commands: [None; COMMANDS_PER_CYCLE], seen: judged };
        let blocking = decide(&self.config, &mut self.state, &inputs, now).blocking.filter(|_| counts);
        self.cycles += u32::from(counts);
        let explained = |cause: &TripCause| open && cause.may_be_an_open_supply();
        let Some(cause) = blocking.filter(|cause| !explained(cause)) else { return };
        match self.blocked.iter_mut().find(|(c, _)| *c == cause) {
            Some((_, n)) => *n += 1,
            None => self.blocked.push((cause, 1)),
        }
    }

    /// The rule that most often prevented arming, with the share of cycles in which any did.
    fn worst(&self) -> Option<(TripCause, f64)> {
        let all: u32 = self.blocked.iter().map(|(_, n)| n).sum();
        let (cause, _) = self.blocked.iter().max_by_key(|(_, n)| *n)?;
        Some((*cause, f64::from(all) / f64::from(self.cycles.max(1))))
    }
}

/// Reads every instrument that can be opened; one that fails keeps none of the others from being read.
pub fn inspect(setup: &Setup, instruments: &InstrumentsSetup) -> Inspection {
    let epoch = Instant::now();
    let (all, mut ports) = ports::open(setup, instruments, epoch);
    let monitor = StallMonitor::start(realtime::pacing::monotonic_ns());
    let mut rules = Rules::of(setup, ports.supply.is_some());
    let mut followed = <[Follow; 9]>::default();
    let counted = || -> Vec<HealthReport> { all.iter().map(Opened::health).collect() };
    let (opened, cycle) = (Instant::now(), Duration::from_nanos(setup.config.limits.timing.cycle.0));
    let (mut before, mut last, mut deadline) = (None, None, opened);
    while opened.elapsed() < INSPECTION {
        deadline = (deadline + cycle).max(Instant::now());
        std::thread::sleep(deadline.saturating_duration_since(Instant::now()));
        let now = Nanos(u64::try_from(epoch.elapsed().as_nanos()).unwrap_or(u64::MAX));
        let seen = ports.read(now);
        rules.step(&seen, now, opened.elapsed() > INSPECTION / 2);
        if opened.elapsed() > SETTLING {
            before.get_or_insert_with(|| (counted(), Instant::now()));
            followed.iter_mut().zip(channels(&seen)).for_each(|(follow, (.., seen))| follow.take(seen, now));
            last = Some(seen);
        }
    }
    // Without threads for the monitor nothing is known of stalls, and none is claimed.
    let stalls = monitor.map(StallMonitor::finish).unwrap_or_default();
    let after = counted();
    let (before, began) = before.unwrap_or_else(|| (after.clone(), opened));
    let seconds = began.elapsed().as_secs_f64();
    let whole = all.iter().all(|o| o.link.is_ok());
    let last = last.unwrap_or_else(|| ports.read(Nanos(0)));
    let found = all.into_iter().zip(before.iter().zip(&after)).map(|(o, (before, after))| InstrumentFound {
        role: o.role,
        id: o.instrument.profile.clone(),
        address: o.instrument.address.clone(),
        channels: match &o.link {
            Ok(_) => reports(&mut followed, &o, &last, &setup.config.limits.timing, seconds),
            Err(_) => Vec::new(),
        },
        answers: o.link.map(|_link| answers(o.instrument, [before, after], seconds)),
    });
    Inspection { found: found.collect(), seen: last, blocking: rules.worst().filter(|_| whole), stalls }
}

fn answers(instrument: &InstrumentSetup, [before, after]: [&HealthReport; 2], seconds: f64) -> LinkCounts {
    let bad = |h: &HealthReport| h.corrupt_frames + h.timeouts + h.exceptions;
    let (samples, repeats) = (after.samples - before.samples, after.repeats - before.repeats);
    let wrong = bad(after) - bad(before);
    let unasked = instrument
        .description()
        .is_ok_and(|p| p.description.poll.is_empty() && p.description.query.is_empty());
    let lost = if unasked { after.lost_samples - before.lost_samples } else { 0 };
    let share = |n: u64, of: u64| if of == 0 { 0.0 } else { n as f64 / of as f64 };
    LinkCounts {
        samples_per_s: samples as f64 / seconds,
        bad_share: share(wrong, wrong + samples + repeats),
        lost_share: share(lost, lost + samples),
        repeats_only: samples == 0 && repeats > 0,
        reconnected: after.connections - before.connections,
        last_problem: after.last_problem.clone(),
        fault: after.fault.clone(),
    }
}
