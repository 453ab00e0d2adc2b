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

/// What the loop wants of an amplifier, a stage or a supply's switch, as the link's thread takes it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SetPoint {
    /// Set-points by the names that profiles use for them, in SI units; amplitudes are peak-to-peak. No
    /// profile has one without a name.
    pub values: [(&'static str, f64); 3],
    /// Whether it drives, moves, loads or closes.
    pub on: bool,
    /// Count of commands, and heartbeat; none for a supply's switch.
    pub sequence: Option<u32>,
    /// It must not leave after this.
    pub expires_at: Nanos,
}

impl From<DriveCommand> for SetPoint {
    fn from(command: DriveCommand) -> Self {
        let on = command.enable();
        let (amplitude_pp_m, frequency_hz) = (command.amplitude().metres(), command.frequency_hz());
        Self {
            values: [("amplitude", amplitude_pp_m), ("frequency", frequency_hz), ("enable", f64::from(on))],
            on,
            sequence: Some(command.sequence()),
            expires_at: command.expires_at(),
        }
    }
}

impl SetPoint {
    /// What the loop wants of the stage: velocity along the stroke in m/s, normal load in N.
    pub(crate) fn of_stage(velocity_m_s: f64, load_n: f64, sequence: u32, expires_at: Nanos) -> Self {
        let on = !(velocity_m_s == 0.0 && load_n == 0.0);
        let values = [("velocity", velocity_m_s), ("load", load_n), ("enable", f64::from(on))];
        Self { values, on, sequence: Some(sequence), expires_at }
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

/// Force instruments as one port, each axis from the first that gives it (lateral, normal). They sample on
/// their own: each axis has its own age.
pub struct Merged(pub Vec<(ForcePort, (bool, bool))>);

impl ForceSensor for Merged {
    fn read(&mut self, now: Nanos) -> Forces {
        let mut forces = Forces::missing(NoData::NotFitted);
        for (port, (lateral, normal)) in self.0.iter_mut().rev() {
            let read = port.read(now);
            forces.lateral = if *lateral { read.lateral } else { forces.lateral };
            forces.normal = if *normal { read.normal } else { forces.normal };
        }
        forces
    }
}

/// The rig's force sensor out of one or two instruments, each with which axes it gives (lateral, normal).
///
/// # Errors
/// Where an axis is given by no instrument or by two.
pub fn compose(ports: Vec<(ForcePort, (bool, bool))>) -> Result<Box<dyn ForceSensor>, SetupError> {
    let given = |axis: fn(&(bool, bool)) -> bool| ports.iter().filter(|(_, axes)| axis(axes)).count();
    let once = given(|axes| axes.0) == 1 && given(|axes| axes.1) == 1;
    if once { Ok(Box::new(Merged(ports))) } else { Err(SetupError::Axes) }
}

/// The loop's side of an instrument with states of type `S` that takes set-points.
pub struct Port<S> {
    states: HeapCons<Result<S, NoData>>,
    commands: Mailbox<SetPoint>,
    last: Result<S, NoData>,
}

/// The states of an instrument on their way to the loop.
pub type States<S> = HeapProd<Result<S, NoData>>;

/// The amplifier's port.
pub type AmplifierPort = Port<AmplifierState>;
/// The stage's port.
pub type StagePort = Port<StageState>;
/// The port of the switch in the amplifier's supply.
pub type SupplyPort = Port<SupplyState>;

/// The ends that the link holds, into the loop and out of it, and the port.
pub fn port<S>() -> (States<S>, Mailbox<SetPoint>, Port<S>) {
    let (into_loop, states) = HeapRb::new(SAMPLES).split();
    let commands = Mailbox::default();
    (into_loop, commands.clone(), Port { states, commands, last: Err(NoData::NeverRead) })
}

impl<S> Port<S> {
    /// Hands a set-point to the link.
    pub(crate) fn push(&mut self, set_point: impl Into<SetPoint>) {
        let set_point = set_point.into();
        self.commands.put(set_point, set_point.on.then_some(set_point.expires_at));
    }
}

impl Amplifier for AmplifierPort {
    fn command(&mut self, command: DriveCommand, _now: Nanos) {
        self.push(command);
    }

    fn state(&mut self, _now: Nanos) -> Result<AmplifierState, NoData> {
        latest(&mut self.states, &mut self.last)
    }
}

impl Stage for StagePort {
    fn command(&mut self, command: StageCommand, _now: Nanos) {
        let (velocity_m_s, load_n) = (command.velocity_m_s(), command.normal_force_n());
        self.push(SetPoint::of_stage(velocity_m_s, load_n, command.sequence(), command.expires_at()));
    }

    fn state(&mut self, _now: Nanos) -> Result<StageState, NoData> {
        latest(&mut self.states, &mut self.last)
    }
}

/// The supply opens when the loop has been silent for this time: a dead loop closes no supply.
const SUPPLY_EXPIRES: Nanos = Nanos(250_000_000);

impl SupplySwitch for SupplyPort {
    fn command(&mut self, command: SupplyCommand, now: Nanos) {
        let on = command == SupplyCommand::Restore;
        let values = [("closed", f64::from(on)), ("", 0.0), ("", 0.0)];
        self.push(SetPoint { values, on, sequence: None, expires_at: now.plus(SUPPLY_EXPIRES) });
    }

    fn state(&mut self, _now: Nanos) -> Result<SupplyState, NoData> {
        latest(&mut self.states, &mut self.last)
    }
}
