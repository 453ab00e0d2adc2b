//! Faults of channels, injected between a port and the loop.
//!
//! The vocabulary is that of PX4's failure injection (ok, off, stuck, garbage, wrong, slow, delayed,
//! intermittent), the same in virtual time, on the wire and in a defects file. A few words are added for what
//! only a reading can show; the virtual rig's instruments know PX4's alone. A wrapper
//! is plain data around its port: no heap, no lock, and its random numbers come from a seed.
#![deny(clippy::disallowed_types, clippy::disallowed_methods)]

use crate::ports::{
    Amplifier, AmplifierState, ForceSensor, Forces, Nanos, NoData, Quality, Sample, Stage, StageState,
};
use crate::safety::{DriveCommand, StageCommand};
use serde::{Deserialize, Serialize};

/// What is wrong with a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FaultMode {
    /// Nothing.
    Ok,
    /// Silent: nothing new comes, no command goes through.
    Off,
    /// The values stand still while counters and clocks go on.
    Stuck,
    /// Random values over the whole range, and values that are not numbers.
    Garbage,
    /// Plausible but wrong: values times the strength (default -0.5).
    Wrong,
    /// One sample in `strength` (default 4) comes through.
    Slow,
    /// Later by `strength` seconds (default 0.02).
    Delayed,
    /// Lost with probability `strength` (default 0.3).
    Intermittent,
    /// Declared invalid by the instrument.
    Invalid,
    /// Answers that fail their checks.
    Corrupt,
    /// The link is down and says so.
    Disconnected,
    /// One sample in `strength` (default: only one) times a hundred.
    Spikes,
    /// At the end of the range.
    Saturated,
    /// Every other sample is one that is three samples old, with its old stamp.
    Disordered,
    /// The device's clock jumps by `strength` seconds (default -1).
    ClockJump,
}

impl FaultMode {
    /// The words that PX4 has.
    pub const PX4: [FaultMode; 8] = {
        use FaultMode::*;
        [Ok, Off, Stuck, Garbage, Wrong, Slow, Delayed, Intermittent]
    };

    /// Strength where none is given.
    pub const fn default_strength(self) -> f64 {
        match self {
            FaultMode::Wrong => -0.5,
            FaultMode::Slow => 4.0,
            FaultMode::Delayed => 0.02,
            FaultMode::Intermittent => 0.3,
            FaultMode::Spikes => 1e9,
            FaultMode::ClockJump => -1.0,
            _ => 0.0,
        }
    }

    /// Whether it strikes some samples and leaves others, so that it is decided once for each.
    const fn strikes_samples(self) -> bool {
        matches!(self, Self::Slow | Self::Intermittent | Self::Spikes | Self::Disordered)
    }
}

/// Which channel is at fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FaultTarget {
    /// The lateral force.
    Lateral,
    /// The normal force.
    Normal,
    /// Both forces, as from one instrument.
    Force,
    /// The amplifier's states (not the commands to it).
    Amplifier,
    /// The commands to the amplifier.
    Drive,
    /// The stage's states.
    Stage,
}

/// A fault of a channel during a time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fault {
    /// Which channel.
    pub target: FaultTarget,
    /// What is wrong.
    pub mode: FaultMode,
    /// From this loop time on.
    pub from: Nanos,
    /// Until this one.
    pub until: Nanos,
    /// How much: see [`FaultMode`].
    pub strength: f64,
}

impl Fault {
    const fn acts(&self, now: Nanos) -> bool {
        now.0 >= self.from.0 && now.0 < self.until.0
    }

    /// Whether this is the one in `strength` that it counts.
    fn counts(&self, count: u64) -> bool {
        count.is_multiple_of(self.strength.max(1.0) as u64)
    }
}

/// Faults that one wrapper carries at most.
pub const FAULTS: usize = 4;
/// Samples that a delay line holds.
const LINE: usize = 256;

/// Random numbers from a seed (Steele, Lea, Flood: SplitMix64, OOPSLA 2014).
#[derive(Clone, Copy, Debug)]
struct Dice(u64);

impl Dice {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// A value that travels through a faulty line: its count, and what a fault can do to it.
trait Sampled: Copy {
    fn sequence(&self) -> u32;
    fn hold(&mut self, earlier: &Self);
    fn spoil(&mut self, dice: &mut Dice);
    fn scale(&mut self, factor: f64);
    fn saturate(&mut self);
    fn move_clock(&mut self, seconds: f64);
}

fn moved(at: Nanos, seconds: f64) -> Nanos {
    Nanos(at.0.saturating_add_signed((seconds * 1e9) as i64))
}

fn garbage(dice: &mut Dice) -> f64 {
    match dice.bits() % 8 {
        0 => f64::NAN,
        1 => f64::INFINITY,
        2 => f64::from_bits(1),
        _ => (dice.unit() - 0.5) * 400.0,
    }
}

impl Sampled for Sample {
    fn sequence(&self) -> u32 {
        self.sequence
    }
    fn hold(&mut self, earlier: &Self) {
        (self.value, self.raw) = (earlier.value, earlier.raw);
    }
    fn spoil(&mut self, dice: &mut Dice) {
        self.value = garbage(dice);
        self.raw = dice.bits() as i64 >> 40;
    }
    fn scale(&mut self, factor: f64) {
        self.value *= factor;
        self.raw = (self.raw as f64 * factor) as i64;
    }
    fn saturate(&mut self) {
        self.quality = Quality::Saturated;
        self.raw = i64::from(i32::MAX);
    }
    fn move_clock(&mut self, seconds: f64) {
        self.taken_at = moved(self.taken_at, seconds);
    }
}

impl Sampled for AmplifierState {
    fn sequence(&self) -> u32 {
        self.sequence
    }
    fn hold(&mut self, earlier: &Self) {
        if let (Ok(now), Ok(before)) = (&mut self.amplitude, &earlier.amplitude) {
            now.hold(before);
        }
        self.output_on = earlier.output_on;
        self.echoed_amplitude = earlier.echoed_amplitude;
        self.echoed_frequency_hz = earlier.echoed_frequency_hz;
    }
    fn spoil(&mut self, dice: &mut Dice) {
        self.amplitude.iter_mut().for_each(|a| a.value = garbage(dice) * 1e-6);
        self.echoed_frequency_hz = garbage(dice) * 1e3;
        self.output_on = dice.bits() & 1 == 0;
        self.temperature_c.iter_mut().for_each(|t| t.value = garbage(dice));
    }
    fn scale(&mut self, factor: f64) {
        self.amplitude.iter_mut().for_each(|a| a.scale(factor));
    }
    fn saturate(&mut self) {
        self.amplitude.iter_mut().for_each(Sampled::saturate);
    }
    fn move_clock(&mut self, seconds: f64) {
        self.taken_at = moved(self.taken_at, seconds);
    }
}

impl Sampled for StageState {
    fn sequence(&self) -> u32 {
        self.sequence
    }
    fn hold(&mut self, earlier: &Self) {
        (self.position_m, self.velocity_m_s) = (earlier.position_m, earlier.velocity_m_s);
    }
    fn spoil(&mut self, dice: &mut Dice) {
        (self.position_m, self.velocity_m_s) = (garbage(dice) * 1e-2, garbage(dice) * 1e-2);
        self.at_limit = dice.bits() & 1 == 0;
    }
    fn scale(&mut self, factor: f64) {
        self.velocity_m_s *= factor;
    }
    fn saturate(&mut self) {
        self.at_limit = true;
    }
    fn move_clock(&mut self, seconds: f64) {
        self.taken_at = moved(self.taken_at, seconds);
    }
}

/// One line from an instrument, with what is wrong with it.
#[derive(Clone, Copy)]
struct Line<S: Sampled> {
    faults: [Option<Fault>; FAULTS],
    dice: Dice,
    /// The last samples as they came, with their arrival; a ring.
    seen: [Option<(Nanos, S)>; LINE],
    newest: usize,
    count: u64,
    /// What the loop was shown last.
    shown: Option<S>,
    held: Option<S>,
    spiked: bool,
    /// What each fault that strikes some samples made of the newest: a loop that turns faster than the
    /// instrument samples is shown a sample many times, and one that was lost must not come after all.
    struck: [Option<Result<S, NoData>>; FAULTS],
}

impl<S: Sampled> Line<S> {
    fn new(target: [FaultTarget; 2], faults: &[Fault], seed: u64) -> Self {
        let mut mine = faults.iter().filter(|f| target.contains(&f.target)).copied();
        Line {
            faults: std::array::from_fn(|_| mine.next()),
            dice: Dice(seed ^ ((target[0] as u64) << 56)),
            seen: [None; LINE],
            newest: 0,
            count: 0,
            shown: None,
            held: None,
            spiked: false,
            struck: [None; FAULTS],
        }
    }

    fn back(&self, steps: usize) -> Option<S> {
        self.seen[(self.newest + LINE - steps % LINE) % LINE].map(|(_, s)| s)
    }

    /// The newest sample that had arrived at a time.
    fn arrived_by(&self, at: Nanos) -> Option<S> {
        (0..LINE)
            .filter_map(|i| self.seen[(self.newest + LINE - i) % LINE])
            .find(|(arrival, _)| *arrival <= at)
            .map(|(_, s)| s)
    }

    fn pass(&mut self, came: Result<S, NoData>, now: Nanos) -> Result<S, NoData> {
        let fresh = came.is_ok_and(|s| self.back(0).is_none_or(|b| b.sequence() != s.sequence()));
        if let (true, Ok(sample)) = (fresh, came) {
            self.newest = (self.newest + 1) % LINE;
            self.seen[self.newest] = Some((now, sample));
            self.count += 1;
        }
        let mut out = came;
        let mut touched = false;
        for (which, fault) in self.faults.into_iter().enumerate() {
            if fresh {
                self.struck[which] = None;
            }
            let Some(fault) = fault.filter(|f| f.acts(now)) else { continue };
            if let (Ok(_), Some(made)) = (out, self.struck[which]) {
                out = made;
                touched = true;
            } else if self.apply(&fault, fresh, &mut out, now) {
                self.struck[which] = fault.mode.strikes_samples().then_some(out);
                touched = true;
            }
        }
        if !touched {
            self.held = None;
        }
        self.shown = out.ok().or(self.shown);
        out
    }

    /// Whether the fault changed what the loop sees in this cycle.
    fn apply(&mut self, fault: &Fault, fresh: bool, out: &mut Result<S, NoData>, now: Nanos) -> bool {
        if fault.mode.strikes_samples() && !fresh {
            return false;
        }
        match fault.mode {
            FaultMode::Ok => return false,
            FaultMode::Slow if fault.counts(self.count) => return false,
            FaultMode::Intermittent if self.dice.unit() >= fault.strength => return false,
            FaultMode::Spikes if self.spiked && !fault.counts(self.count) => return false,
            FaultMode::Disordered if self.count.is_multiple_of(2) => return false,
            // Nothing new comes through: the loop is shown what it was shown last.
            FaultMode::Off | FaultMode::Slow | FaultMode::Intermittent => {
                *out = self.shown.ok_or(NoData::NeverRead);
            }
            FaultMode::Stuck => {
                let held = *self.held.get_or_insert(match *out {
                    Ok(sample) => sample,
                    Err(_) => return false,
                });
                out.iter_mut().for_each(|sample| sample.hold(&held));
            }
            FaultMode::Garbage => out.iter_mut().for_each(|sample| sample.spoil(&mut self.dice)),
            FaultMode::Wrong => out.iter_mut().for_each(|sample| sample.scale(fault.strength)),
            FaultMode::Delayed => {
                let then = now.0.checked_sub((fault.strength * 1e9) as u64).map(Nanos);
                *out = then.and_then(|then| self.arrived_by(then)).ok_or(NoData::NeverRead);
            }
            FaultMode::Invalid => *out = Err(NoData::Invalid),
            FaultMode::Corrupt => *out = Err(NoData::Corrupt),
            FaultMode::Disconnected => *out = Err(NoData::Disconnected),
            FaultMode::Spikes => {
                self.spiked = true;
                out.iter_mut().for_each(|sample| sample.scale(100.0));
            }
            FaultMode::Saturated => out.iter_mut().for_each(Sampled::saturate),
            FaultMode::Disordered => *out = self.back(3).ok_or(NoData::NeverRead),
            FaultMode::ClockJump => out.iter_mut().for_each(|sample| sample.move_clock(fault.strength)),
        }
        true
    }
}

/// A force sensor with faults.
pub struct FaultyForce<P> {
    inner: P,
    lateral: Line<Sample>,
    normal: Line<Sample>,
}

impl<P: ForceSensor> FaultyForce<P> {
    /// Wraps a sensor; of `faults` it takes those of the forces, at most [`FAULTS`] an axis.
    pub fn new(inner: P, faults: &[Fault], seed: u64) -> Self {
        let lateral = Line::new([FaultTarget::Lateral, FaultTarget::Force], faults, seed);
        let normal = Line::new([FaultTarget::Normal, FaultTarget::Force], faults, seed.rotate_left(17));
        FaultyForce { inner, lateral, normal }
    }
}

impl<P: ForceSensor> ForceSensor for FaultyForce<P> {
    fn read(&mut self, now: Nanos) -> Forces {
        let came = self.inner.read(now);
        Forces { lateral: self.lateral.pass(came.lateral, now), normal: self.normal.pass(came.normal, now) }
    }
}

/// An amplifier with faults of its states and of the way to it.
pub struct FaultyAmplifier<P> {
    inner: P,
    states: Line<AmplifierState>,
    faults: [Option<Fault>; FAULTS],
    dice: Dice,
    commands: u64,
    /// Commands on their way, with the time at which they arrive.
    under_way: [Option<(Nanos, DriveCommand)>; LINE],
    next: usize,
}

impl<P: Amplifier> FaultyAmplifier<P> {
    /// Wraps an amplifier; of `faults` it takes those of the amplifier and of its drive commands.
    pub fn new(inner: P, faults: &[Fault], seed: u64) -> Self {
        let states =
            Line::new([FaultTarget::Amplifier, FaultTarget::Amplifier], faults, seed.rotate_left(29));
        let drive =
            Line::<StageState>::new([FaultTarget::Drive, FaultTarget::Drive], faults, seed.rotate_left(37));
        FaultyAmplifier {
            inner,
            states,
            faults: drive.faults,
            dice: drive.dice,
            commands: 0,
            under_way: [None; LINE],
            next: 0,
        }
    }

    fn deliver(&mut self, now: Nanos) {
        // From the oldest on: what is due together arrives in the order in which it was sent.
        for i in 0..LINE {
            let slot = &mut self.under_way[(self.next + i) % LINE];
            if let Some((_, command)) = slot.take_if(|(due, _)| *due <= now) {
                self.inner.command(command, now);
            }
        }
    }
}

impl<P: Amplifier> Amplifier for FaultyAmplifier<P> {
    fn command(&mut self, command: DriveCommand, now: Nanos) {
        self.commands += 1;
        self.deliver(now);
        for fault in self.faults.into_iter().flatten().filter(|f| f.acts(now)) {
            match fault.mode {
                FaultMode::Off | FaultMode::Disconnected | FaultMode::Corrupt => return,
                FaultMode::Intermittent if self.dice.unit() < fault.strength => return,
                FaultMode::Slow if !fault.counts(self.commands) => return,
                FaultMode::Delayed => {
                    self.under_way[self.next] =
                        Some((now.plus(Nanos::from_seconds(fault.strength)), command));
                    self.next = (self.next + 1) % LINE;
                    return;
                }
                _ => {}
            }
        }
        self.inner.command(command, now);
    }

    fn state(&mut self, now: Nanos) -> Result<AmplifierState, NoData> {
        self.deliver(now);
        self.states.pass(self.inner.state(now), now)
    }
}

/// A stage with faults of its states.
pub struct FaultyStage<P> {
    inner: P,
    states: Line<StageState>,
}

impl<P: Stage> FaultyStage<P> {
    /// Wraps a stage; of `faults` it takes those of the stage.
    pub fn new(inner: P, faults: &[Fault], seed: u64) -> Self {
        FaultyStage {
            inner,
            states: Line::new([FaultTarget::Stage, FaultTarget::Stage], faults, seed.rotate_left(41)),
        }
    }
}

impl<P: Stage> Stage for FaultyStage<P> {
    fn command(&mut self, command: StageCommand, now: Nanos) {
        self.inner.command(command, now);
    }

    fn state(&mut self, now: Nanos) -> Result<StageState, NoData> {
        self.states.pass(self.inner.state(now), now)
    }
}

#[cfg(test)]
mod tests;
