//! The loop's side of the drivers: port objects over single-producer, single-consumer rings of samples and a
//! mailbox of commands.
//!
//! Nothing here blocks, locks or allocates after it was made.

use crate::mailbox::Mailbox;
use crate::setup::SetupError;
use realtime::ports::{
    Amplifier, AmplifierState, Contacts, ForceSensor, Forces, Nanos, NoData, SafetyInputs, Stage, StageState,
    SupplyCommand, SupplyState, SupplySwitch,
};
use realtime::safety::{DriveCommand, StageCommand};
use ringbuf::traits::{Consumer, Split};
use ringbuf::{HeapCons, HeapProd, HeapRb};

/// Samples that wait for the loop at most: a quarter of a second at 1 kHz.
const SAMPLES: usize = 256;

/// What the loop wants of the amplifier, as the link's thread takes it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriveSetPoint {
    /// Peak-to-peak amplitude in m.
    pub amplitude_pp_m: f64,
    /// Frequency in Hz.
    pub frequency_hz: f64,
    /// Output on.
    pub enable: bool,
    /// Count of commands, and heartbeat.
    pub sequence: u32,
    /// It must not leave after this.
    pub expires_at: Nanos,
}

impl From<DriveCommand> for DriveSetPoint {
    fn from(command: DriveCommand) -> Self {
        Self {
            amplitude_pp_m: command.amplitude().metres(),
            frequency_hz: command.frequency_hz(),
            enable: command.enable(),
            sequence: command.sequence(),
            expires_at: command.expires_at(),
        }
    }
}

/// What the loop wants of the stage, as the link's thread takes it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StageSetPoint {
    /// Velocity along the stroke in m/s.
    pub velocity_m_s: f64,
    /// Normal load in N.
    pub normal_force_n: f64,
    /// Count of commands, and heartbeat.
    pub sequence: u32,
    /// It must not leave after this.
    pub expires_at: Nanos,
}

impl StageSetPoint {
    /// Whether it neither moves nor loads.
    pub fn rests(&self) -> bool {
        self.velocity_m_s == 0.0 && self.normal_force_n == 0.0
    }
}

impl From<StageCommand> for StageSetPoint {
    fn from(command: StageCommand) -> Self {
        Self {
            velocity_m_s: command.velocity_m_s(),
            normal_force_n: command.normal_force_n(),
            sequence: command.sequence(),
            expires_at: command.expires_at(),
        }
    }
}

/// The newest of what waits in a ring, else the last one.
fn latest<T: Copy>(ring: &mut HeapCons<T>, last: &mut T) -> T {
    while let Some(newer) = ring.try_pop() {
        *last = newer;
    }
    *last
}

/// The loop's side of an instrument that only measures.
pub struct SensorPort<T> {
    ring: HeapCons<T>,
    last: T,
}

/// A port of forces.
pub type ForcePort = SensorPort<Forces>;
/// A port of safety contacts.
pub type ContactsPort = SensorPort<Contacts>;

/// The ring into which the link pushes, and a port that shows `none` until then.
pub fn sensor<T>(none: T) -> (HeapProd<T>, SensorPort<T>) {
    let (producer, ring) = HeapRb::new(SAMPLES).split();
    (producer, SensorPort { ring, last: none })
}

impl ForceSensor for ForcePort {
    fn read(&mut self, _now: Nanos) -> Forces {
        latest(&mut self.ring, &mut self.last)
    }
}

impl SafetyInputs for ContactsPort {
    fn read(&mut self, _now: Nanos) -> Contacts {
        latest(&mut self.ring, &mut self.last)
    }
}

/// Two force instruments with one axis each. They sample on their own: each axis has its own age.
struct Pair {
    lateral: ForcePort,
    normal: ForcePort,
}

impl ForceSensor for Pair {
    fn read(&mut self, now: Nanos) -> Forces {
        Forces { lateral: self.lateral.read(now).lateral, normal: self.normal.read(now).normal }
    }
}

/// The rig's force sensor out of one or two instruments, each with which axes it gives (lateral, normal).
///
/// # Errors
/// Where an axis is given by no instrument or by two.
pub fn compose(mut ports: Vec<(ForcePort, (bool, bool))>) -> Result<Box<dyn ForceSensor>, SetupError> {
    let axes: Vec<(bool, bool)> = ports.iter().map(|(_, axes)| *axes).collect();
    match axes.as_slice() {
        [(true, true)] => Ok(Box::new(ports.remove(0).0)),
        [(true, false), (false, true)] => {
            let normal = ports.remove(1).0;
            Ok(Box::new(Pair { lateral: ports.remove(0).0, normal }))
        }
        [(false, true), (true, false)] => {
            let lateral = ports.remove(1).0;
            Ok(Box::new(Pair { lateral, normal: ports.remove(0).0 }))
        }
        _ => Err(SetupError::Axes),
    }
}

/// The loop's side of an instrument with states of type `S` that takes set-points of type `C`.
pub struct Port<S, C> {
    states: HeapCons<Result<S, NoData>>,
    commands: Mailbox<C>,
    last: Result<S, NoData>,
}

/// The ends that the link of such an instrument holds.
pub struct Link<S, C> {
    /// Into the loop.
    pub states: HeapProd<Result<S, NoData>>,
    /// Out of the loop.
    pub commands: Mailbox<C>,
}

/// The amplifier's port.
pub type AmplifierPort = Port<AmplifierState, DriveSetPoint>;
/// The stage's port.
pub type StagePort = Port<StageState, StageSetPoint>;
/// The port of the switch in the amplifier's supply.
pub type SupplyPort = Port<SupplyState, SupplySetPoint>;

/// A port, and the ends that the link holds.
pub fn port<S, C>() -> (Link<S, C>, Port<S, C>) {
    let (into_loop, states) = HeapRb::new(SAMPLES).split();
    let commands = Mailbox::default();
    let link = Link { states: into_loop, commands: commands.clone() };
    (link, Port { states, commands, last: Err(NoData::NeverRead) })
}

impl AmplifierPort {
    /// Hands a set-point to the link.
    pub(crate) fn push(&mut self, set_point: DriveSetPoint) {
        self.commands.put(set_point, !set_point.enable);
    }
}

impl Amplifier for AmplifierPort {
    fn command(&mut self, command: DriveCommand, _now: Nanos) {
        self.push(command.into());
    }

    fn state(&mut self, _now: Nanos) -> Result<AmplifierState, NoData> {
        latest(&mut self.states, &mut self.last)
    }
}

impl Stage for StagePort {
    fn command(&mut self, command: StageCommand, _now: Nanos) {
        let set_point = StageSetPoint::from(command);
        self.commands.put(set_point, set_point.rests());
    }

    fn state(&mut self, _now: Nanos) -> Result<StageState, NoData> {
        latest(&mut self.states, &mut self.last)
    }
}

/// The supply opens when the loop has been silent for this time: a dead loop closes no supply.
const SUPPLY_EXPIRES: Nanos = Nanos(250_000_000);

/// The loop's set-point of the supply, as the link's thread takes it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SupplySetPoint {
    /// Closed; else open.
    pub closed: bool,
    /// It must not leave after this.
    pub expires_at: Nanos,
}

impl SupplySwitch for SupplyPort {
    fn command(&mut self, command: SupplyCommand, now: Nanos) {
        let closed = command == SupplyCommand::Restore;
        self.commands.put(SupplySetPoint { closed, expires_at: now.plus(SUPPLY_EXPIRES) }, !closed);
    }

    fn state(&mut self, _now: Nanos) -> Result<SupplyState, NoData> {
        latest(&mut self.states, &mut self.last)
    }
}
