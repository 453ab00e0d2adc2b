//! The way from an instrument to its reader: latency, and what can be wrong with it.
//!
//! The vocabulary of faults is that of the wrappers around the loop's ports, which is PX4's: ok, off, stuck,
//! garbage, wrong, slow, delayed, intermittent.

use crate::amplifier::AmplifierStatus;
use crate::noise::Noise;
use crate::sensor::ForceSample;
use realtime::fault::FaultMode;
use realtime::ports::{Nanos, StageState};
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};
use std::collections::VecDeque;

/// Which instrument's channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ChannelName {
    /// The force sensor's samples.
    Force,
    /// The amplifier's states, and the commands to it.
    Amplifier,
    /// The stage's states, and the commands to it.
    Stage,
}

/// Reads one of PX4's words. The others are of readings, not of an instrument's messages.
fn of_a_message<'de, D: Deserializer<'de>>(from: D) -> Result<FaultMode, D::Error> {
    let mode = FaultMode::deserialize(from)?;
    if FaultMode::PX4.contains(&mode) {
        return Ok(mode);
    }
    Err(D::Error::custom(
        "an instrument's channel cannot have this fault; it has one of ok, off, stuck, garbage, wrong, slow, delayed, \
         intermittent",
    ))
}

/// A fault of a channel during a time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ChannelFault {
    /// Which channel.
    pub channel: ChannelName,
    /// What is wrong: one of [`FaultMode::PX4`]. `off` stops commands too.
    #[serde(deserialize_with = "of_a_message")]
    pub fault: FaultMode,
    /// From this time on (s).
    #[serde(default)]
    pub from_s: f64,
    /// Until this time (s); without it: for ever.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub until_s: Option<f64>,
    /// How much: see the fault.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub strength: Option<f64>,
}

impl ChannelFault {
    fn acts(&self, now: Nanos) -> bool {
        let t = now.seconds();
        t >= self.from_s && self.until_s.is_none_or(|until| t < until)
    }

    fn strength(&self) -> f64 {
        self.strength.unwrap_or(self.fault.default_strength())
    }
}

/// What a fault can do to a message.
pub(crate) trait Message: Copy {
    /// Takes over the values of an earlier message, keeping counters and clocks.
    fn hold(&mut self, earlier: &Self);
    /// Random values.
    fn spoil(&mut self, noise: &mut Noise);
    /// Values times a factor.
    fn scale(&mut self, factor: f64);
}

impl Message for ForceSample {
    fn hold(&mut self, earlier: &Self) {
        (self.counts, self.force_n, self.saturated) = (earlier.counts, earlier.force_n, earlier.saturated);
    }
    fn spoil(&mut self, noise: &mut Noise) {
        for axis in 0..2 {
            let bits = noise.bits();
            self.counts[axis] = bits as i32;
            // One message in eight carries bits that are not numbers.
            self.force_n[axis] = if bits >> 61 == 0 { f64::NAN } else { f64::from(bits as i32) * 1e-4 };
        }
    }
    fn scale(&mut self, factor: f64) {
        for axis in 0..2 {
            self.counts[axis] = (f64::from(self.counts[axis]) * factor).round() as i32;
            self.force_n[axis] *= factor;
        }
    }
}

impl Message for AmplifierStatus {
    fn hold(&mut self, earlier: &Self) {
        let (taken_at, sequence) = (self.taken_at, self.sequence);
        *self = Self { taken_at, sequence, ..*earlier };
    }
    fn spoil(&mut self, noise: &mut Noise) {
        let bits = noise.bits();
        self.measured_counts = i64::from(bits as i32);
        self.measured_pp_m = f64::from(bits as i32) * 1e-9;
        self.output_on = bits & 1 == 1;
        self.temperature_c = f64::from((bits >> 40) as u16);
    }
    fn scale(&mut self, factor: f64) {
        self.measured_counts = (self.measured_counts as f64 * factor).round() as i64;
        self.measured_pp_m *= factor;
    }
}

impl Message for StageState {
    fn hold(&mut self, earlier: &Self) {
        (self.position_m, self.velocity_m_s) = (earlier.position_m, earlier.velocity_m_s);
    }
    fn spoil(&mut self, noise: &mut Noise) {
        self.position_m = noise.between(-1e3, 1e3);
        self.velocity_m_s = noise.between(-1e3, 1e3);
    }
    fn scale(&mut self, factor: f64) {
        self.position_m *= factor;
        self.velocity_m_s *= factor;
    }
}

/// A channel: messages go in at their instant and come out after the latency, as its faults let them.
#[derive(Clone, Debug)]
pub(crate) struct Gate<T> {
    latency: Nanos,
    faults: Vec<ChannelFault>,
    queue: VecDeque<(Nanos, T)>,
    latest: Option<T>,
    held: Option<T>,
    offered: u64,
    noise: Noise,
}

/// Longest queue: messages beyond it push the oldest out, delivered late rather than never.
const QUEUE: usize = 4096;

impl<T: Message> Gate<T> {
    pub(crate) fn new(channel: ChannelName, latency_s: f64, faults: &[ChannelFault], noise: Noise) -> Self {
        let own = |fault: &&ChannelFault| fault.channel == channel && fault.fault != FaultMode::Ok;
        Self {
            latency: Nanos::from_seconds(latency_s),
            faults: faults.iter().filter(own).copied().collect(),
            queue: VecDeque::with_capacity(QUEUE),
            latest: None,
            held: None,
            offered: 0,
            noise,
        }
    }

    /// A message leaves the instrument.
    pub(crate) fn offer(&mut self, mut message: T, now: Nanos) {
        self.offered += 1;
        let mut due = now.plus(self.latency);
        let mut stuck = false;
        for fault in self.faults.iter().filter(|fault| fault.acts(now)) {
            let strength = fault.strength();
            match fault.fault {
                FaultMode::Off => return,
                FaultMode::Stuck => {
                    stuck = true;
                    message.hold(&*self.held.get_or_insert(message));
                }
                FaultMode::Garbage => message.spoil(&mut self.noise),
                FaultMode::Wrong => message.scale(strength),
                FaultMode::Slow if !self.offered.is_multiple_of((strength.max(1.0)) as u64) => return,
                FaultMode::Delayed => due = due.plus(Nanos::from_seconds(strength)),
                FaultMode::Intermittent if self.noise.chance(strength) => return,
                // Those of readings only: no defects file can ask for them here.
                _ => {}
            }
        }
        if !stuck {
            self.held = Some(message);
        }
        if self.queue.len() == QUEUE {
            self.latest = self.queue.pop_front().map(|(_, m)| m);
        }
        self.queue.push_back((due, message));
    }

    /// The latest message that has arrived.
    pub(crate) fn latest(&mut self, now: Nanos) -> Option<T> {
        while self.queue.front().is_some_and(|(due, _)| *due <= now) {
            self.latest = self.queue.pop_front().map(|(_, message)| message);
        }
        self.latest
    }

    /// Whether commands get through.
    pub(crate) fn open(&self, now: Nanos) -> bool {
        !self.faults.iter().any(|f| f.fault == FaultMode::Off && f.acts(now))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(i: u32) -> StageState {
        StageState {
            position_m: f64::from(i),
            velocity_m_s: 1.0,
            at_limit: false,
            fault: false,
            taken_at: Nanos(u64::from(i) * 1_000_000),
            sequence: i,
        }
    }

    /// Sequence, position at each millisecond with one fault from 0.1 s on.
    fn run(fault: FaultMode) -> Vec<Option<(u32, f64)>> {
        let fault = ChannelFault {
            channel: ChannelName::Stage,
            fault,
            from_s: 0.1,
            until_s: Some(0.3),
            strength: None,
        };
        let mut gate = Gate::new(ChannelName::Stage, 0.002, &[fault], Noise::new(3, "test"));
        (0..400)
            .map(|i| {
                let now = Nanos(i * 1_000_000);
                gate.offer(message(i as u32), now);
                gate.latest(now).map(|m| (m.sequence, m.position_m))
            })
            .collect()
    }

    #[test]
    fn each_fault_does_what_its_name_says_and_ends() {
        let ok = run(FaultMode::Ok);
        assert_eq!(ok[1], None);
        assert_eq!(ok[200], Some((198, 198.0)), "2 ms of latency");
        assert_eq!(run(FaultMode::Off)[250], Some((99, 99.0)));
        assert_eq!(run(FaultMode::Stuck)[250], Some((248, 99.0)));
        assert_eq!(run(FaultMode::Wrong)[250], Some((248, -124.0)));
        assert_eq!(run(FaultMode::Delayed)[250], Some((228, 228.0)));
        let slow = run(FaultMode::Slow);
        assert_eq!(slow[110..290].windows(2).filter(|w| w[0] != w[1]).count(), 45);
        let lossy = run(FaultMode::Intermittent);
        let fresh = lossy[110..290].windows(2).filter(|w| w[0] != w[1]).count();
        assert!((100..150).contains(&fresh), "{fresh} of 179 at 30 % loss");
        assert!(run(FaultMode::Garbage)[250].unwrap().1 != 248.0);
        for mode in [FaultMode::Off, FaultMode::Stuck, FaultMode::Garbage, FaultMode::Wrong, FaultMode::Slow]
        {
            assert_eq!(run(mode)[399], Some((397, 397.0)), "{mode:?} ends");
        }
    }
}
