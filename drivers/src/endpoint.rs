//! The wire's side of a driver, whatever the wire: frames become samples, commands become set-points.
//!
//! A transport hands over each frame with the time of its arrival, and asks what is due to be sent.
//! Everything that decides whether a number may become a force stands here, once for all transports.

mod orders;
mod view;

use super::health::Health;
use super::mailbox::Mailbox;
use super::ports::{self, AmplifierPort, ContactsPort, ForcePort, SetPoint, StagePort, States, SupplyPort};
use super::setup::{AxisSetup, CONTACTS, InstrumentSetup, SetupError};
use super::timebase::{Counter, CounterStep, DeviceClock};
use instruments::schema::{Severity, Stamp};
use instruments::{FrameId, Profile, SetId, SignalId, Values};
use models::PeakToPeak;
pub use orders::Due;
use orders::Orders;
use realtime::ports::{
    AmplifierState, Contacts, Forces, Nanos, NoData, SafetyContact, Sample, StageState, SupplyState,
};
use ringbuf::HeapProd;
use ringbuf::traits::Producer;
use std::sync::Arc;
use view::View;

/// An alarm that came unasked shows as a fault for this long after the last: instruments repeat theirs
/// some ten times a second.
const ALARM_HOLDS: Nanos = Nanos(1_500_000_000);

/// A plate that is seen to vibrate by more than this, peak-to-peak in m, is not off, whatever its amplifier
/// says of its output: ten times what the plate sensors of the bundled profiles are uncertain by, and a tenth
/// of what reduces friction.
const OFF_AMPLITUDE_PP_M: f64 = 0.1e-6;
/// A stage that is seen to move slower than this, in m/s, stands: the slowest sweep slides ten times faster.
const AT_REST_M_S: f64 = 0.5e-3;

/// A frame that must not become a sample.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum BadFrame {
    /// It failed a check.
    #[error("{0}")]
    Corrupt(String),
    /// The instrument is another than the profile says.
    #[error("{0}")]
    WrongInstrument(String),
}

/// One axis of force out of one signal.
#[derive(Debug, Clone)]
struct Axis {
    signal: SignalId,
    gain: f64,
    offset_n: f64,
}

/// The signals of an amplifier, by the names that profiles use for them.
#[derive(Debug, Clone)]
struct AmplifierSignals {
    echo_amplitude: SignalId,
    echo_frequency: SignalId,
    output_on: SignalId,
    amplitude: Option<SignalId>,
    temperature: Option<SignalId>,
    watchdog_tripped: Option<SignalId>,
    fault: Option<SignalId>,
}

#[derive(Debug, Clone)]
struct StageSignals {
    position: SignalId,
    velocity: SignalId,
    at_limit: Option<SignalId>,
    fault: Option<SignalId>,
}

enum Part {
    Force { lateral: Option<Axis>, normal: Option<Axis>, last: Forces, ring: HeapProd<Forces> },
    Amplifier { signals: AmplifierSignals, states: States<AmplifierState> },
    Stage { signals: StageSignals, states: States<StageState>, dead_weight_n: Option<f64> },
    Supply { closed: SignalId, states: States<SupplyState> },
    Contacts(ContactsLink),
}

/// Safety contacts by their signals: emergency stop, interlock, dead-man.
struct ContactsLink {
    signals: [Option<SignalId>; 3],
    last: Contacts,
    ring: HeapProd<Contacts>,
}

impl ContactsLink {
    /// The contacts that a profile has and that are wired, and their port.
    fn of(profile: &Profile, setup: &InstrumentSetup) -> Result<(Self, ContactsPort), SetupError> {
        if let Some(wired) = &setup.wired
            && let Some(unknown) = wired
                .iter()
                .find(|name| !CONTACTS.contains(&name.as_str()) || profile.signal(name.as_str()).is_none())
        {
            return Err(SetupError::NoContact(unknown.clone()));
        }
        let signals = CONTACTS.map(|name| profile.signal(name).filter(|_| setup.is_wired(name)));
        if signals.iter().all(Option::is_none) {
            return Err(SetupError::NoContacts);
        }
        let (ring, port) = ports::sensor(Contacts::missing(NoData::NeverRead));
        Ok((Self { signals, last: Contacts::missing(NoData::NotFitted), ring }, port))
    }

    /// Takes what a frame says of them. `None` where it says nothing; else whether the loop's ring was full.
    fn take(&mut self, view: &View<'_>) -> Option<bool> {
        let contact = [&mut self.last.emergency_stop, &mut self.last.interlock, &mut self.last.dead_man];
        let mut touched = false;
        for (signal, contact) in self.signals.iter().zip(contact) {
            if let Some(signal) = signal.filter(|signal| view.holds(*signal)) {
                *contact = view.channel(signal).map(|reading| SafetyContact {
                    closed: reading.value != 0.0,
                    taken_at: reading.taken_at,
                    sequence: reading.sequence,
                });
                touched = true;
            }
        }
        touched.then(|| self.ring.try_push(self.last).is_err())
    }

    fn lost(&mut self, reason: NoData) {
        let contact = [&mut self.last.emergency_stop, &mut self.last.interlock, &mut self.last.dead_man];
        for (signal, contact) in self.signals.iter().zip(contact) {
            *contact = Err(if signal.is_some() { reason } else { NoData::NotFitted });
        }
        let _ = self.ring.try_push(self.last);
    }
}

/// The clock and the counter of one frame.
struct FrameTime {
    clock: Option<(SignalId, DeviceClock)>,
    counter: Option<(SignalId, Counter)>,
    counted: u32,
}

/// When and as which a frame's sample counts.
#[derive(Debug, Clone, Copy)]
struct SampleMark {
    taken_at: Nanos,
    arrived: Nanos,
    sequence: u32,
}

/// One instrument, seen from its wire.
pub struct Endpoint {
    profile: Profile,
    values: Values,
    seen: Vec<bool>,
    times: Vec<FrameTime>,
    part: Part,
    orders: Orders,
    alarm_until: Nanos,
    /// The fault that stops the rig and that it reports now, by its place in the profile.
    fault: Option<usize>,
    /// Which of the profile's faults hold now.
    holds: Vec<bool>,
    arrived: Nanos,
    /// What a sensor shows is not handed on yet: it is not set up.
    held: bool,
    health: Arc<Health>,
}

impl Endpoint {
    /// A force instrument, its port, and which axes it gives (lateral, normal).
    ///
    /// # Errors
    /// Where the setup names a signal that the profile does not have, or the instrument gives no axis.
    #[allow(clippy::type_complexity)]
    pub fn force(
        profile: Profile,
        setup: &InstrumentSetup,
    ) -> Result<(Self, (ForcePort, (bool, bool))), SetupError> {
        let axis = |wanted: &Option<AxisSetup>, name: &'static str| match wanted {
            Some(axis) => {
                let signal = need(&profile, &axis.signal)?;
                if !(axis.gain.is_finite() && axis.gain != 0.0 && axis.offset_n.is_finite()) {
                    return Err(SetupError::Gain(name));
                }
                Ok(Some(Axis { signal, gain: axis.gain, offset_n: axis.offset_n }))
            }
            // An axis that the setup leaves out is fitted only where the profile calls it so.
            None => Ok(profile.signal(name).map(|signal| Axis { signal, gain: 1.0, offset_n: 0.0 })),
        };
        let (lateral, normal) = (axis(&setup.lateral, "lateral")?, axis(&setup.normal, "normal")?);
        if lateral.is_none() && normal.is_none() {
            return Err(SetupError::NoAxis { known: signals(&profile) });
        }
        if let (Some(one), Some(other)) = (&lateral, &normal)
            && one.signal.0 == other.signal.0
        {
            return Err(SetupError::OneSignal(
                setup.normal.as_ref().map_or("normal".into(), |a| a.signal.clone()),
            ));
        }
        let axes = (lateral.is_some(), normal.is_some());
        let (ring, port) = ports::sensor(Forces::missing(NoData::NeverRead));
        let part = Part::Force { lateral, normal, last: Forces::missing(NoData::NotFitted), ring };
        Ok((Self::new(profile, part, Mailbox::default()), (port, axes)))
    }

    /// An amplifier and its port.
    ///
    /// # Errors
    /// Where the profile lacks a signal or set-point that an amplifier must have.
    pub fn amplifier(
        mut profile: Profile,
        setup: &InstrumentSetup,
    ) -> Result<(Self, AmplifierPort), SetupError> {
        let positive = |gain: f64, key| {
            if gain.is_finite() && gain > 0.0 { Ok(gain) } else { Err(SetupError::NotPositive(key)) }
        };
        if let Some(gain) = setup.amplitude_m_per_unit {
            positive(gain, "amplitude_m_per_unit")?;
            profile.set_si("amplitude", gain);
            profile.set_si("echo_amplitude", gain);
        }
        if let Some(gain) = setup.measured_m_per_unit {
            profile.set_measured_si("amplitude", positive(gain, "measured_m_per_unit")?);
        }
        let signals = AmplifierSignals {
            echo_amplitude: need(&profile, "echo_amplitude")?,
            echo_frequency: need(&profile, "echo_frequency")?,
            output_on: need(&profile, "output_on")?,
            amplitude: profile.signal("amplitude"),
            temperature: profile.signal("temperature"),
            watchdog_tripped: profile.signal("watchdog_tripped"),
            fault: profile.signal("fault"),
        };
        for set in ["amplitude", "frequency", "enable"] {
            need_set(&profile, set)?;
        }
        let (states, commands, port) = ports::port();
        Ok((Self::new(profile, Part::Amplifier { signals, states }, commands), port))
    }

    /// A stage and its port.
    ///
    /// # Errors
    /// Where the profile lacks a signal or set-point that a stage must have.
    pub fn stage(profile: Profile, setup: &InstrumentSetup) -> Result<(Self, StagePort), SetupError> {
        let signals = StageSignals {
            position: need(&profile, "position")?,
            velocity: need(&profile, "velocity")?,
            at_limit: profile.signal("at_limit"),
            fault: profile.signal("fault"),
        };
        need_set(&profile, "velocity")?;
        let dead_weight_n = setup.dead_weight_n;
        if profile.set("load").is_none() && dead_weight_n.is_none() {
            return Err(SetupError::NoLoad);
        }
        let (states, commands, port) = ports::port();
        Ok((Self::new(profile, Part::Stage { signals, states, dead_weight_n }, commands), port))
    }

    /// A switch in the amplifier's supply, and its port.
    ///
    /// # Errors
    /// Where the profile lacks the signal that reads the switch back, the set-point, or its safe value.
    pub fn supply(profile: Profile) -> Result<(Self, SupplyPort), SetupError> {
        let closed = need(&profile, "closed")?;
        need_set(&profile, "closed")?;
        let (states, commands, port) = ports::port();
        let endpoint = Self::new(profile, Part::Supply { closed, states }, commands);
        if endpoint.safe_set_points().is_empty() {
            return Err(SetupError::NoSafeValue);
        }
        Ok((endpoint, port))
    }

    /// An instrument that reads safety contacts, and its port.
    ///
    /// # Errors
    /// Where the profile has none of their signals.
    pub fn contacts(profile: Profile, setup: &InstrumentSetup) -> Result<(Self, ContactsPort), SetupError> {
        let (link, port) = ContactsLink::of(&profile, setup)?;
        Ok((Self::new(profile, Part::Contacts(link), Mailbox::default()), port))
    }

    fn new(profile: Profile, part: Part, commands: Mailbox<SetPoint>) -> Self {
        let stamped = profile.description.time.stamp == Stamp::Device;
        let times = profile.frames().iter().map(|frame| FrameTime {
            clock: frame.device_time.filter(|_| stamped).map(|signal| {
                let (counts, si) = profile.turn(signal);
                (signal, DeviceClock::new(counts * si))
            }),
            counter: frame.sequence.map(|signal| (signal, Counter::new(profile.turn(signal).0 as u64))),
            counted: 0,
        });
        let times: Vec<FrameTime> = times.collect();
        let seen = vec![false; times.len()];
        let values = profile.values();
        Self {
            values,
            seen,
            times,
            part,
            orders: Orders::of(commands),
            alarm_until: Nanos(0),
            fault: None,
            holds: vec![false; profile.description.fault.len()],
            arrived: Nanos(0),
            held: false,
            health: Arc::default(),
            profile,
        }
    }

    /// The instrument's profile.
    pub fn profile(&self) -> &Profile {
        &self.profile
    }

    /// The counters, for whoever wants to look.
    pub fn health(&self) -> Arc<Health> {
        Arc::clone(&self.health)
    }

    /// The latest value of a signal in its unit; NaN where there was none.
    pub fn value(&self, signal: SignalId) -> f64 {
        self.values.get(signal)
    }

    /// Holds back what a sensor shows from the loop until it is set up: another range or filter may still be
    /// active, and its numbers do not count.
    pub fn hold(&mut self, held: bool) {
        self.held = held;
    }

    /// Takes a frame that arrived, whole and checked by its transport, and hands its sample to the loop.
    ///
    /// # Errors
    /// A frame of the wrong length, or an instrument that is not what the profile says; no sample then.
    pub fn frame(&mut self, frame: FrameId, bytes: &[u8], arrived: Nanos) -> Result<(), BadFrame> {
        self.profile.decode(frame, bytes, &mut self.values).map_err(|error| {
            self.health.count(&self.health.corrupt_frames);
            BadFrame::Corrupt(error.to_string())
        })?;
        self.seen[frame.0] = true;
        self.arrived = arrived;
        let all_seen = self.seen.iter().all(|&seen| seen);
        if all_seen && let Some(broken) = self.profile.broken_signature(&self.values) {
            self.health.count(&self.health.corrupt_frames);
            let signature = &self.profile.description.signature[broken];
            let shown = self.profile.shown(signature.when.as_ref(), &self.values);
            return Err(BadFrame::WrongInstrument(format!("{}: {shown} does not hold", signature.text)));
        }
        for (index, held) in self.holds.iter_mut().enumerate().filter(|_| all_seen) {
            let holds = self.profile.fault_holds(index, &self.values);
            if holds && !*held {
                self.health.reported(&self.profile.description.fault[index].text);
            }
            *held = holds;
        }
        let faults = self.holds.iter().zip(&self.profile.description.fault);
        let fault = faults.into_iter().position(|(holds, fault)| *holds && fault.severity == Severity::Stop);
        if fault != self.fault {
            self.fault = fault;
            let fault = fault.map(|index| &self.profile.description.fault[index]);
            self.health.fault(fault.map_or_else(String::new, |fault| {
                format!("{}: {}", fault.text, self.profile.shown(fault.when.as_ref(), &self.values))
            }));
        }
        let Some(mark) = self.mark(frame, arrived) else { return Ok(()) };
        self.publish(frame, bytes, mark);
        Ok(())
    }

    /// When and as which the frame's sample counts; `None` where it is no new sample.
    fn mark(&mut self, frame: FrameId, arrived: Nanos) -> Option<SampleMark> {
        let (time, health) = (&mut self.times[frame.0], &self.health);
        if let Some((signal, counter)) = &mut time.counter {
            let count = self.values.get(*signal).max(0.0) as u64;
            match counter.step(count) {
                CounterStep::New { lost } => {
                    health.lost_samples.fetch_add(lost, std::sync::atomic::Ordering::Relaxed);
                }
                old @ (CounterStep::Same | CounterStep::Old) => {
                    health.count(if old == CounterStep::Same {
                        &health.repeats
                    } else {
                        &health.out_of_order
                    });
                    return None;
                }
                CounterStep::Reset => health.count(&health.clock_resets),
            }
            {
                time.counted = count as u32;
            }
        } else {
            time.counted = time.counted.wrapping_add(1);
        }
        let mut taken_at = arrived;
        if let Some((signal, clock)) = &mut time.clock {
            let signal_s = self.profile.si(*signal, &self.values);
            let (taken, reset) = clock.taken_at(signal_s, arrived);
            taken_at = taken;
            if reset {
                health.count(&health.clock_resets);
            }
        }
        let latency = Nanos::from_seconds(self.profile.description.time.latency_ms * 1e-3);
        Some(SampleMark { taken_at: taken_at.since(latency), arrived, sequence: time.counted })
    }

    fn publish(&mut self, frame: FrameId, bytes: &[u8], mark: SampleMark) {
        let alarmed = mark.arrived < self.alarm_until;
        let view = View { profile: &self.profile, values: &self.values, bytes, frame, mark };
        let full = match &mut self.part {
            Part::Force { .. } if self.held => return,
            Part::Force { lateral, normal, last, ring } => {
                let mut touched = false;
                for (axis, force) in [(lateral, &mut last.lateral), (normal, &mut last.normal)] {
                    if let Some(axis) = axis.as_ref().filter(|axis| view.holds(axis.signal)) {
                        *force = view.channel(axis.signal).map(|reading| Sample {
                            value: axis.gain * reading.value - axis.offset_n,
                            ..reading
                        });
                        touched = true;
                    }
                }
                touched && ring.try_push(*last).is_err()
            }
            Part::Amplifier { signals, states } if view.holds(signals.output_on) => {
                let state = AmplifierState {
                    amplitude: view.optional(signals.amplitude),
                    echoed_amplitude: PeakToPeak::from_metres(view.si(signals.echo_amplitude)),
                    echoed_frequency_hz: view.si(signals.echo_frequency),
                    output_on: view.flag(Some(signals.output_on)),
                    watchdog_tripped: view.flag(signals.watchdog_tripped),
                    fault: alarmed || view.is_faulty(signals.fault),
                    temperature_c: view.optional(signals.temperature),
                    taken_at: mark.taken_at,
                    sequence: mark.sequence,
                };
                let vibrates = state.amplitude.is_ok_and(|read| read.value > OFF_AMPLITUDE_PP_M);
                self.orders.read_back(state.output_on || vibrates, mark.arrived);
                states.try_push(Ok(state)).is_err()
            }
            Part::Stage { signals, states, .. } if view.holds(signals.position) => {
                let state = StageState {
                    position_m: view.si(signals.position),
                    velocity_m_s: view.si(signals.velocity),
                    at_limit: view.flag(signals.at_limit),
                    fault: alarmed || view.is_faulty(signals.fault),
                    taken_at: mark.taken_at,
                    sequence: mark.sequence,
                };
                // A velocity that is not a number is none at rest.
                let rests = state.velocity_m_s.abs() <= AT_REST_M_S;
                self.orders.read_back(!rests, mark.arrived);
                states.try_push(Ok(state)).is_err()
            }
            Part::Supply { closed, states } if view.holds(*closed) => {
                let closed = view.values.get(*closed) != 0.0;
                self.orders.read_back(closed, mark.arrived);
                let state = SupplyState { cut: !closed, taken_at: mark.taken_at, sequence: mark.sequence };
                states.try_push(Ok(state)).is_err()
            }
            Part::Contacts(contacts) => match contacts.take(&view) {
                Some(full) => full,
                None => return,
            },
            Part::Amplifier { .. } | Part::Stage { .. } | Part::Supply { .. } => return,
        };
        self.health.count(if full { &self.health.ring_full } else { &self.health.samples });
    }

    /// The instrument raised an alarm unasked: its state shows a fault until it has been silent for a while.
    pub fn alarm(&mut self, text: &str) {
        self.health.count(&self.health.alarms);
        self.health.problem(format!("the instrument says {text}"));
        self.alarm_until = self.arrived.plus(ALARM_HOLDS);
    }
}

fn need(profile: &Profile, name: &str) -> Result<SignalId, SetupError> {
    let missing = || SetupError::NoSignal { name: name.into(), known: signals(profile) };
    profile.signal(name).ok_or_else(missing)
}

fn signals(profile: &Profile) -> String {
    profile.signals().map(|(name, _)| name).collect::<Vec<_>>().join(", ")
}

fn need_set(profile: &Profile, name: &'static str) -> Result<SetId, SetupError> {
    profile.set(name).ok_or(SetupError::NoSetPoint(name))
}

#[cfg(test)]
pub(crate) mod tests;
