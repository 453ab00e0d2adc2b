//! The steps of a sweep through its passes: a pure state machine over rows, beside the loop, in virtual and
//! wall-clock time. The passes come in the order that `plan/points.rs` gives them. The times of a pass are
//! those of `plan::PassTimes`, and the longest pause is the setup's `pause_max_s`; the times of arming, zero
//! and approach are constants.
//!
//! ```text
//! Arm -> Zero -> [ Approach -> Settle -> Measure (-> Edges) ]* -> Zero -> Over
//!  any -> Over    by a trip, or a stop by request
//!  before a pass: Paused, by request; disarmed, and armed again when it is to go on
//!  before the first, before one whose level of the air is not there, after the last: AtRig (see `at_rig`)
//! ```

mod arming;
mod at_rig;
mod events;
mod passing;

pub use at_rig::Question;
pub use events::{Event, MeasuredPass, Outcome, ZeroLevels, Zeros};

use crate::certificates::temperature::{TemperatureFlag, TemperatureRange};
use crate::exposure_left::Left;
use crate::plan::{PassTimes, Point};
use crate::setup::Guards;
use arming::{Arming, Next};
use at_rig::AtRig;
use models::{Ambient, Condition, FrictionModel, Pass, PassNoise, PeakToPeak};
use passing::Sums;
use realtime::Row;
use realtime::compare::{Agreement, Comparator, PassComparison};
use realtime::cycle::{Command, Marker, Phase};
use realtime::ports::{Nanos, NoData};
use realtime::safety::{ChannelTiming, Limits, Remark, Request, TripCause};
use std::sync::Arc;

/// What a row led to.
#[derive(Debug, Default)]
pub struct Reaction {
    /// For the loop, in this order.
    pub commands: Vec<Command>,
    /// A pass that was finished.
    pub pass: Option<MeasuredPass>,
    /// Events.
    pub events: Vec<Event>,
    /// The end.
    pub outcome: Option<Outcome>,
    /// A quantity of the air (its place in [`crate::ambient::AIR`]) that is to be set, and the level.
    pub set_level: Option<(usize, f64)>,
    /// A question to whoever stands at the rig; its text is among the events.
    pub question: Option<Question>,
}

/// Where the sweep is, and since when; of a zero whether it comes after the passes, of a pause when the rig
/// was last seen off, at rest and lifted off (`quiet`), of edges how many requests were sent.
#[derive(Clone, Copy, Debug, PartialEq)]
enum State {
    Arm,
    AtRig,
    Zero { since: Option<Nanos>, after: bool },
    Paused { since: Nanos, quiet: Nanos },
    Approach { since: Nanos },
    Settle { since: Nanos },
    Measure { since: Nanos },
    Edges { since: Nanos, sent: u32 },
    Over,
}

/// Length of a zero reading.
const ZERO_FOR: Nanos = Nanos(200_000_000);
/// Time that a plate may ring on after the zero began: left out of the zero.
const ZERO_SETTLE: Nanos = Nanos(150_000_000);
/// Time to wait for a start position.
const APPROACH_WITHIN: Nanos = Nanos(20_000_000_000);
/// Longest pause, where a setup does not say.
pub const PAUSE_MAX_S: f64 = 600.0;
/// A paused rig shows itself off, at rest and lifted off, no longer ago than this.
const QUIET_WITHIN: Nanos = Nanos(2_500_000_000);
/// A stage that stands, in m/s, and what a sensor may show with the finger lifted off, in N (as SR-43 has
/// it).
const STANDS_M_S: f64 = 2e-3;
const LIFTED_N: f64 = 0.3;
/// A pass without contact, or with a frozen sensor, is made again so often before the sweep gives up.
const TRIES: u32 = 3;

/// How a start position is approached: velocity in proportion to the way that is left.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Approach {
    /// Cycles from one command to the next.
    every: u64,
    /// Velocity over way, 1/s.
    gain: f64,
}

impl Approach {
    /// Where the loop and the stage are fast: a command every five milliseconds.
    const FASTEST: Approach = Approach { every: 5, gain: 25.0 };

    /// For a loop and a stage of these periods. A command acts on a position that is as old as the stage's
    /// sample, the time since the last command and a cycle: a gain well beyond one over that would swing
    /// about the goal and never arrive.
    fn at(cycle: Nanos, stage: &ChannelTiming) -> Self {
        let every = (5e-3 / cycle.seconds()).round().max(1.0);
        let old = (every + 1.0) * cycle.seconds() + stage.period.seconds();
        Approach { every: every as u64, gain: (0.7 / old).min(Self::FASTEST.gain) }
    }
}

/// The sweep.
pub struct Sweep {
    points: Vec<Point>,
    next: usize,
    times: PassTimes,
    state: State,
    arming: Arming,
    sums: Sums,
    tries: u32,
    model: Arc<dyn FrictionModel>,
    comparator: Comparator,
    stopping: bool,
    paused: bool,
    departed: bool,
    /// Of the last pass that could be compared, of earlier sessions too.
    last_comparison: Option<PassComparison>,
    approach: Approach,
    started: bool,
    poisson_ratio: f64,
    /// Certificates that are compared with the amplifier's temperature at the start of each pass.
    pub(crate) temperature_ranges: Vec<TemperatureRange>,
    temperature_flags: Vec<TemperatureFlag>,
    /// What was remarked last, and of which pass.
    remarked: Option<(u32, Remark)>,
    /// What the setup states of the air, and what the loop last received of it.
    ambient: Ambient,
    ambient_sent: Ambient,
    at_rig: AtRig,
    has_watchdog: bool,
    /// What is reported at each arming.
    pub(crate) guards: Guards,
    exposure_left: Option<Left>,
    load_commanded: bool,
    frozen_after: u32,
    /// The longest pause.
    pub(crate) pause_max: Nanos,
    /// The stop of a pause is on its way: the trip that shows it ends nothing.
    pausing: bool,
    /// The session of a run that had begun so long before the loop's time zero: passes tell the run's time.
    pub(crate) session: Option<u64>,
    pub(crate) start_s: f64,
}

impl Sweep {
    /// A sweep over `points` (those of a resumed run that are still to be made).
    pub fn new(
        points: Vec<Point>,
        times: PassTimes,
        model: Arc<dyn FrictionModel>,
        tip: &crate::fingertip::Fingertip,
        noise: PassNoise,
    ) -> Self {
        let comparator = Comparator::new(&*model, tip.mu0, noise);
        Sweep {
            points,
            next: 0,
            times,
            state: State::Arm,
            arming: Arming::new(),
            sums: Sums::default(),
            tries: 0,
            model,
            comparator,
            stopping: false,
            paused: false,
            departed: false,
            last_comparison: None,
            approach: Approach::FASTEST,
            started: false,
            poisson_ratio: tip.finger.poisson_ratio,
            temperature_ranges: Vec::new(),
            temperature_flags: Vec::new(),
            remarked: None,
            ambient: Ambient::default(),
            ambient_sent: Ambient::default(),
            at_rig: AtRig::default(),
            has_watchdog: true,
            guards: Guards::default(),
            exposure_left: None,
            load_commanded: true,
            frozen_after: 50,
            pause_max: Nanos::from_seconds(PAUSE_MAX_S),
            pausing: false,
            session: None,
            start_s: 0.0,
        }
    }

    /// The same, with the limits of the rig that is armed: missing guards are reported then.
    pub fn guarded_by(self, limits: &Limits) -> Self {
        Sweep {
            has_watchdog: limits.amplifier_watchdog || limits.supply_watchdog,
            arming: self.arming.guarded_by(limits),
            load_commanded: limits.load_commanded,
            approach: Approach::at(limits.timing.cycle, &limits.timing.stage),
            ..self
        }
    }

    /// The first arming reports what is left to a human finger of the hour.
    pub fn exposure_left(&mut self, left: Left) {
        self.exposure_left = Some(left);
    }

    /// Takes in a pass of an earlier session of the same run: `mu_0` and the evidence go on from there.
    pub fn remember(&mut self, pass: &Pass) {
        if let Some(friction) = pass.friction_force_n() {
            let condition = pass.condition(1.0).within(&self.ambient);
            // A condition outside the model's domain has no comparison, now as then.
            if let Ok(comparison) = self.comparator.pass(&*self.model, &condition, friction) {
                self.last_comparison = Some(comparison);
            }
            self.departed = self.comparator.departed();
        }
    }

    /// Passes made and to be made.
    pub fn progress(&self) -> (usize, usize) {
        (self.next, self.points.len())
    }

    /// Number of the point whose pass is under way; none between passes.
    pub fn pass_under_way(&self) -> Option<u32> {
        let stages = matches!(
            self.state,
            State::Approach { .. } | State::Settle { .. } | State::Measure { .. } | State::Edges { .. }
        );
        self.points.get(self.next).filter(|_| stages).map(|point| point.number)
    }

    /// Time that the rest should take in s, by the plan.
    pub fn remaining_s(&self) -> f64 {
        let each =
            |p: &Point| self.times.sliding_s(p.edges, p.condition.speed_m_s).iter().sum::<f64>() + 0.15;
        self.points[self.next..].iter().map(each).sum()
    }

    /// Asks for a stop: the rig goes to its safe state with the next row.
    pub fn stop(&mut self) {
        self.stopping = true;
    }

    /// Has the sweep rest before the next pass, without drive and lifted off, or go on. A pass that slides
    /// already is made first.
    pub fn pause(&mut self, paused: bool) {
        self.paused = paused;
    }

    /// What the passes say of the model, for a sweep that came to its end or did not.
    pub fn agreement(&self, complete: bool) -> Agreement {
        Agreement::of(self.last_comparison.as_ref(), complete)
    }

    /// Takes a row.
    pub fn on_row(&mut self, row: &Row) -> Reaction {
        let mut out = Reaction::default();
        if self.state == State::Over {
            return out;
        }
        let stopped = row.tripped.is_some_and(|trip| trip.cause == TripCause::Stopped);
        if stopped && std::mem::take(&mut self.pausing) {
            return out;
        }
        // The stop before a person comes to the rig is the sweep's own.
        let own = stopped && self.state == State::AtRig && self.at_rig.disarmed;
        if let Some(trip) = row.tripped.filter(|_| !own && (stopped || self.state != State::Arm)) {
            out.events.push(Event::Tripped(trip));
            self.finish(&mut out, if stopped { Outcome::Stopped } else { Outcome::Tripped(trip) });
            return out;
        }
        if self.stopping {
            (self.stopping, self.pausing) = (false, false);
            out.events.push(Event::StopRequested);
            out.commands.push(Command::Stop);
            if !row.armed {
                self.finish(&mut out, Outcome::Stopped);
            }
            return out;
        }
        match self.state {
            State::Arm => self.arm(row, &mut out),
            State::Zero { since, after } => self.zero(row, since, after, &mut out),
            State::Paused { since, quiet } => self.rest(row, since, quiet, &mut out),
            State::AtRig => self.wait_at_rig(row, &mut out),
            State::Approach { .. } if self.paused => self.begin_next(row, &mut out),
            State::Approach { since } => self.approach(row, since, &mut out),
            State::Settle { since } => self.settle(row, since, &mut out),
            State::Measure { since } => self.measure(row, since, &mut out),
            State::Edges { since, sent } => self.edges(row, since, sent, &mut out),
            State::Over => {}
        }
        out
    }

    fn finish(&mut self, out: &mut Reaction, outcome: Outcome) {
        self.state = State::Over;
        out.outcome = Some(outcome);
    }

    /// Arming is one act: a reset once nothing stands in the way, and the proof of the second channel after
    /// it.
    fn arm(&mut self, row: &Row, out: &mut Reaction) {
        if self.first_steps(row, out) {
            return;
        }
        match self.arming.row(row) {
            Next::Wait => {}
            Next::Ask(event) => {
                out.events.extend(event);
                out.commands.push(Command::Reset);
            }
            Next::Again(event) => out.events.push(event),
            Next::Armed => self.armed(row, out),
            Next::GiveUp(outcome) => {
                if let Outcome::Tripped(trip) = outcome {
                    out.events.push(Event::Tripped(trip));
                }
                self.finish(out, outcome);
            }
        }
    }

    /// Armed: says what guards are missing, and reads the zeros.
    fn armed(&mut self, row: &Row, out: &mut Reaction) {
        let seen = &row.inputs.seen;
        out.events.push(Event::Armed);
        // A virtual rig has no mains that a person could cut.
        if seen.supply == Err(NoData::NotFitted) && !self.at_rig.simulated {
            out.events.push(Event::NoSecondChannel);
        }
        if !self.has_watchdog {
            out.events.push(Event::NoWatchdog);
        }
        out.events.extend(self.exposure_left.take().map(Event::ExposureLeft));
        if self.guards.nobody_touches_the_plate {
            out.events.push(Event::NobodyTouches);
        }
        if !self.guards.not_wired.is_empty() {
            out.events.push(Event::NotWired { contacts: self.guards.not_wired.clone() });
        }
        if seen.amplifier.is_ok_and(|a| a.temperature_c == Err(NoData::NotFitted)) {
            let certificates = self.temperature_ranges.iter().map(|range| range.certificate.clone());
            out.events.extend(certificates.map(|certificate| Event::TemperatureUnwatched { certificate }));
        }
        self.read_zero(false, out);
    }

    /// Lifted off and without drive the zeros are read, before the passes or after them.
    fn read_zero(&mut self, after: bool, out: &mut Reaction) {
        // A pass that a pause or a person cut short is no part of them.
        self.sums = Sums::default();
        out.commands.push(Command::Set(Request::default(), self.marker(Phase::Zero)));
        self.state = State::Zero { since: None, after };
    }

    fn zero(&mut self, row: &Row, since: Option<Nanos>, after: bool, out: &mut Reaction) {
        let since = since.unwrap_or(row.now);
        self.state = State::Zero { since: Some(since), after };
        if row.marker.phase != Phase::Zero || row.now.since(since) < ZERO_SETTLE {
            return;
        }
        self.take(row);
        if row.now.since(since) < Nanos(ZERO_SETTLE.0 + ZERO_FOR.0) {
            return;
        }
        out.events.push(Event::Zeros {
            lateral_n: self.sums.lateral.mean(),
            normal_n: self.sums.normal.mean(),
            after,
            smallest_load_n: self.points.iter().map(|p| p.condition.normal_force_n).reduce(f64::min),
        });
        if after {
            if !self.last_steps(row, out) {
                out.commands.push(Command::Stop);
                self.finish(out, Outcome::Complete);
            }
        } else {
            self.begin_next(row, out);
        }
    }

    fn marker(&self, phase: Phase) -> Marker {
        Marker { point: self.points.get(self.next).map_or(u32::MAX, |p| p.number), phase }
    }

    /// The command of a pass while it slides: a target is rendered up to the amplitude of the pass.
    fn slide(&self, c: &Condition, phase: Phase) -> Command {
        let command = if self.renders(c) { Command::Render } else { Command::Set };
        command(sliding(c), self.marker(phase))
    }

    /// Whether a pass at this condition renders a target.
    fn renders(&self, c: &Condition) -> bool {
        c.amplitude > PeakToPeak::ZERO && self.model.target().is_some()
    }

    fn begin_next(&mut self, row: &Row, out: &mut Reaction) {
        if self.next == self.points.len() {
            return self.read_zero(true, out);
        }
        if self.paused {
            out.events.push(Event::Paused { point: self.points[self.next].number });
            out.commands.push(Command::Set(Request::default(), self.marker(Phase::Idle)));
            out.commands.push(Command::Stop);
            self.pausing = true;
            self.state = State::Paused { since: row.now, quiet: row.now };
            return;
        }
        if self.waits_at_rig(row, out) {
            return;
        }
        self.sums = Sums::default();
        let ambient = self.at_rig.air(&self.ambient, row.now);
        if ambient != self.ambient_sent {
            self.ambient_sent = ambient;
            out.commands.push(Command::Ambient(ambient));
        }
        self.state = State::Approach { since: row.now };
        self.approach(row, row.now, out);
    }

    /// Waits until it is to go on, not armed. It goes on by arming: the second channel is proved again, and a
    /// hand at the dead-man device must let go and grip again.
    fn rest(&mut self, row: &Row, since: Nanos, quiet: Nanos, out: &mut Reaction) {
        let loud = self.loud(row);
        let quiet = if loud.is_none() { row.now } else { quiet };
        self.state = State::Paused { since, quiet };
        if let Some(cause) = loud.filter(|_| row.now.since(quiet) > QUIET_WITHIN) {
            out.events.push(Event::PauseNotQuiet { cause });
            self.finish(out, Outcome::WouldNotArm { blocking: Some(cause) });
        } else if row.now.since(since) > self.pause_max {
            out.events.push(Event::PauseTooLong { bound: self.pause_max.seconds() });
            self.finish(out, Outcome::Stopped);
        } else if !self.paused && !row.armed {
            out.events.push(Event::Resumed);
            self.arming = self.arming.afresh(false);
            self.state = State::Arm;
        }
    }

    /// The rule that a paused rig breaks: it is not seen off, at rest and lifted off. Weights that load the
    /// finger are not lifted.
    fn loud(&self, row: &Row) -> Option<TripCause> {
        let normal = row.inputs.seen.forces.normal.as_ref();
        let loaded = self.load_commanded && normal.map_or(true, |reading| reading.value.abs() > LIFTED_N);
        awake(row).or(loaded.then_some(TripCause::LoadImplausible))
    }

    fn approach(&mut self, row: &Row, since: Nanos, out: &mut Reaction) {
        let point = self.points[self.next];
        let c = &point.condition;
        let Ok(stage) = row.inputs.seen.stage else { return };
        // It slides half a stroke on either side of its position.
        let stroke = c.speed_m_s * self.times.sliding_s(point.edges, c.speed_m_s)[0] * 1.05;
        let start = c.position_m - c.direction.sign() * (0.5 * stroke);
        let away = start - stage.position_m;
        // Close enough: within 0.2 mm of the start, on either side.
        if away.abs() < 2e-4 {
            out.commands.push(self.slide(c, Phase::Settle));
            self.state = State::Settle { since: row.now };
            return;
        }
        if row.now.since(since) > APPROACH_WITHIN {
            let (point, found_m) = (point.number, stage.position_m);
            out.commands.push(Command::Stop);
            return self.finish(out, Outcome::StartNotReached { point, wanted_m: start, found_m });
        }
        // Slow down towards the goal: the stage has its own acceleration, the way here is a first-order
        // approach.
        let fast = self.times.approach_speed_m_s;
        let velocity = (away * self.approach.gain).clamp(-fast, fast);
        let velocity = if velocity.abs() < 2e-3 { 2e-3 * away.signum() } else { velocity };
        let request = Request { velocity_m_s: velocity, ..Request::default() };
        // Only changes go to the loop, and not more often than it can matter.
        if !self.started || row.cycle.is_multiple_of(self.approach.every) {
            self.started = true;
            out.commands.push(Command::Set(request, self.marker(Phase::Approach)));
        }
    }

    fn settle(&mut self, row: &Row, since: Nanos, out: &mut Reaction) {
        if row.now.since(since) < Nanos::from_seconds(self.times.settle_s) {
            return;
        }
        let c = self.points[self.next].condition;
        out.commands.push(self.slide(&c, Phase::Measure));
        self.sums = Sums::default();
        self.at_rig.over = Default::default();
        self.check_temperature(row, out);
        self.state = State::Measure { since: row.now };
    }
}

/// The request of a pass while it slides.
fn sliding(c: &Condition) -> Request {
    Request {
        amplitude: c.amplitude,
        frequency_hz: if c.amplitude > PeakToPeak::ZERO { c.frequency_hz } else { 0.0 },
        velocity_m_s: c.direction.sign() * c.speed_m_s,
        normal_force_n: c.normal_force_n,
    }
}

/// The rule that a rig breaks which is not seen off and at rest.
fn awake(row: &Row) -> Option<TripCause> {
    let seen = &row.inputs.seen;
    let (Ok(amplifier), Ok(stage)) = (&seen.amplifier, &seen.stage) else {
        return Some(if seen.stage.is_ok() { TripCause::AmplifierStale } else { TripCause::StageStale });
    };
    let moves = stage.velocity_m_s.abs() > STANDS_M_S;
    if amplifier.output_on {
        Some(TripCause::RefusesOff)
    } else {
        moves.then_some(TripCause::StageNotFollowing)
    }
}

#[cfg(test)]
mod tests;
