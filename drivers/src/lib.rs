//! Drivers: the instruments of a rig behind the loop's ports. The bundled profiles are in `profiles/`.
//!
//! One thread a link does all the talking. It decodes frames by the instrument's profile and hands
//! finished samples to the loop through a ring; commands come back through another. The loop's side
//! ([`ports`]) never blocks, locks or allocates.
//!
//! ```no_run
//! use muprime_drivers::InstrumentsSetup;
//! let setup: InstrumentsSetup = toml::from_str(r#"
//!     [[force]]
//!     profile = "muprime-force2"
//!     address = "127.0.0.1:1502"
//!     [amplifier]
//!     profile = "muprime-amplifier"
//!     address = "127.0.0.1:1502"
//!     [stage]
//!     profile = "muprime-stage"
//!     address = "127.0.0.1:1502"
//! "#)?;
//! // `epoch` is the moment that the loop calls zero.
//! let rig = muprime_drivers::open(&setup, std::time::Instant::now())?;
//! // rig.force, rig.amplifier, rig.stage go to the loop; rig.links stays with the supervisor: its
//! // health counters can be read at any time, and dropping it sends the safe set-points and ends
//! // the threads.
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The profiles that come with the program can be looked at without an instrument:
//!
//! ```
//! let profile = muprime_drivers::profile("ati-netft-can")?;
//! assert!(profile.signals().any(|(name, _)| name == "fz"));
//! assert!(muprime_drivers::profile("no-such-cell").is_err());
//! # Ok::<(), muprime_drivers::OpenError>(())
//! ```
//!
//! | module | purpose |
//! |---|---|
//! | [`setup`] | the instruments' sections of a setup |
//! | [`ports`] | the loop's side: port objects over rings |
//! | [`endpoint`] | the wire's side, whatever the wire: frames to samples, commands to set-points |
//! | [`timebase`] | an instrument's clock and counter, mapped to the loop's |
//! | [`health`] | what a link counts |
//! | [`identity`] | which instrument an address means, however it is spelt |
//! | [`bundled`] | the profiles that come with the program |
//! | [`user_profiles`] | profiles from files and folders |
//! | [`mailbox`] | the newest command on its way from the loop to a link |
//! | [`link_error`] | why a conversation ended, and how its link was closed |
//! | [`connection`] | the life of a link: connect, converse, back off |
//! | [`off`] | how an instrument is switched off and read back, whatever the wire |
//! | [`modbus`] | the conversation with registers, over [`modbus_tcp`] or [`modbus_rtu`] |
//! | [`can`] | the conversation in CAN messages, over [`slcan`] or [`socketcan`] |
//! | [`text`] | the conversation in lines |
//! | [`transport`] | what carries lines and streams: a serial line, TCP, datagrams |
//! | [`trace`], [`peek`], [`remedy`] | every byte; instruments without a profile; remedies for bad answers |
//! | [`chamber`] | the air around the rig, set and read beside the loop |
//! | [`canopen`] | the conversation with a CANopen drive of CiA 402 |
//! | [`serial`] | serial lines |
//! | [`stream`] | frames that come by themselves |
//! | [`vibrometer`] | the settings of a vibrometer's controller, read back for a calibration |
#![allow(
    clippy::disallowed_methods,
    reason = "a link's thread lives in wall-clock time: it waits for its wire and stamps what comes"
)]

pub mod bundled;
pub mod can;
pub mod canopen;
pub mod chamber;
pub mod connection;
pub mod endpoint;
pub mod health;
pub mod identity;
pub mod link_error;
pub mod mailbox;
pub mod modbus;
pub mod modbus_rtu;
pub mod modbus_tcp;
pub mod off;
pub mod peek;
pub mod ports;
pub mod remedy;
pub mod serial;
pub mod setup;
pub mod slcan;
#[cfg(all(feature = "can", target_os = "linux"))]
pub mod socketcan;
#[cfg(not(all(feature = "can", target_os = "linux")))]
#[path = "without_can.rs"]
pub mod socketcan;
pub mod stream;
pub mod text;
pub mod timebase;
pub mod trace;
pub mod transport;
pub mod user_profiles;
pub mod vibrometer;

pub use health::{Health, HealthReport};
pub use link_error::{Closed, LinkError};
pub use setup::{AxisSetup, InstrumentSetup, InstrumentsSetup, SetupError};

use connection::Connection;
use endpoint::Endpoint;
use instruments::{LinkKind, Profile};
use realtime::Clock;
use realtime::ports::{Absent, Amplifier, ForceSensor, SafetyInputs, Stage, SupplySwitch};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

/// The ports of a rig, connected.
pub struct Rig {
    /// Both axes of force; they may come from two instruments.
    pub force: Box<dyn ForceSensor>,
    /// The ultrasonic drive.
    pub amplifier: Box<dyn Amplifier>,
    /// The stage.
    pub stage: Box<dyn Stage>,
    /// The switch in the amplifier's supply; [`Absent`] where the setup has none.
    pub supply: Box<dyn SupplySwitch>,
    /// The safety contacts; [`Absent`] where the setup has none.
    pub contacts: Box<dyn SafetyInputs>,
    /// The threads beside the loop.
    pub links: Links,
}

/// Why a rig could not be connected. Nothing was commanded then.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the message of an error says what its fields are")]
pub enum OpenError {
    #[error(
        "no profile is called `{id}`; there are: {known}; looked in: {looked}; a file is named by its path, as in `my-sensor.toml`"
    )]
    UnknownProfile { id: String, known: String, looked: String },
    #[error("{}: {problem}", file.display())]
    Unreadable { file: std::path::PathBuf, problem: user_profiles::FileError },
    #[error("two profiles are called `{id}`: {places}; {remedy}")]
    Ambiguous { id: String, places: String, remedy: String },
    #[error("profile `{id}`: {error}")]
    Profile { id: String, error: instruments::ProfileError },
    #[error("instrument `{id}` at {address}: {problem}")]
    Mismatch { id: String, address: String, problem: SetupError },
    /// The instrument did not answer, or is not what the profile says.
    #[error("instrument `{id}` at {address}: {problem}")]
    Link { id: String, address: String, problem: LinkError },
    /// The same of an instrument beside the loop.
    #[error("`{id}` at {address}: {problem}")]
    Beside { id: String, address: String, problem: LinkError },
    /// The profile is not that of a chamber or of a vibrometer's controller; what it lacks.
    #[error("profile `{0}`{1}")]
    Unfit(String, &'static str),
}

/// What an instrument is to the rig.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PortRole {
    /// It measures forces.
    Force,
    /// It drives the plate.
    Amplifier,
    /// It moves and loads the finger.
    Stage,
    /// It switches the amplifier's supply.
    Supply,
    /// It reads the safety contacts.
    Contacts,
}

impl PortRole {
    /// Whether it takes no set-points.
    pub const fn only_measures(self) -> bool {
        matches!(self, Self::Force | Self::Contacts)
    }
}

/// How the link of one instrument was closed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LinkEnd {
    /// Id of the instrument's profile.
    pub name: String,
    /// What it is to the rig.
    pub role: PortRole,
    /// Whether it was read back off.
    pub closed: Closed,
}

/// The threads that talk to the instruments. Closing or dropping it switches off what can be switched off, reads it back, and
/// ends the threads; that takes at most [`off::OFF_WITHIN`] and the time limits of one connection and one answer more.
pub struct Links {
    stop: Arc<AtomicBool>,
    links: Vec<Link>,
    clock: Clock,
}

struct Link {
    name: String,
    role: PortRole,
    health: Arc<Health>,
    thread: Option<JoinHandle<Closed>>,
}

impl Links {
    fn none(clock: Clock) -> Self {
        Self { stop: Arc::new(AtomicBool::new(false)), links: Vec::new(), clock }
    }

    /// The time that they stamp with.
    pub const fn clock(&self) -> &Clock {
        &self.clock
    }

    /// Each instrument's name and counters.
    pub fn health(&self) -> impl Iterator<Item = (&str, HealthReport)> {
        self.links.iter().map(|link| (link.name.as_str(), link.health.report()))
    }

    /// Switches off, ends the threads and says of each instrument how its link was closed, in the order of the setup.
    pub fn close(mut self) -> Vec<LinkEnd> {
        self.end()
    }

    fn end(&mut self) -> Vec<LinkEnd> {
        self.stop.store(true, Ordering::Release);
        let ended = |mut link: Link| {
            let joined = link.thread.take().map(JoinHandle::join);
            let closed = match joined {
                Some(Ok(closed)) => closed,
                _ => Closed::NotReadBack("its thread is gone".into()),
            };
            LinkEnd { name: link.name, role: link.role, closed }
        };
        self.links.drain(..).map(ended).collect()
    }
}

impl Drop for Links {
    fn drop(&mut self) {
        self.end();
    }
}

/// Connects every instrument of a setup. Returns once each has answered with its signature and a
/// first sample. A clock that can be held may be from now on, if this process serves every instrument itself.
///
/// # Errors
/// The first instrument that is unknown, does not fit the setup, does not answer, or is another
/// than the profile says. Nothing was commanded then.
pub fn open(setup: &InstrumentsSetup, clock: impl Into<Clock>) -> Result<Rig, OpenError> {
    let mut links = Links::none(clock.into());
    links.clock.hold_for(setup.all().map(|instrument| instrument.address.as_str()));
    let one = |own: &InstrumentSetup| start(&mut links, own, Endpoint::force(own.description()?, own));
    let force = setup.force.iter().map(one).collect::<Result<_, _>>()?;
    let force = ports::compose(force).map_err(|problem| setup.force[0].mismatch(problem))?;
    let own = &setup.amplifier;
    let amplifier = start(&mut links, own, Endpoint::amplifier(own.description()?, own))?;
    let own = &setup.stage;
    let stage = start(&mut links, own, Endpoint::stage(own.description()?, own))?;
    let mut supply: Box<dyn SupplySwitch> = Box::new(Absent);
    if let Some(own) = &setup.supply_relay {
        supply = Box::new(start(&mut links, own, Endpoint::supply(own.description()?))?);
    }
    let mut contacts: Box<dyn SafetyInputs> = Box::new(Absent);
    if let Some(own) = &setup.safety_inputs {
        contacts = Box::new(start(&mut links, own, Endpoint::contacts(own.description()?, own))?);
    }
    Ok(Rig { force, amplifier: Box::new(amplifier), stage: Box::new(stage), supply, contacts, links })
}

/// The bundled profile of that name, its golden vectors run.
///
/// # Errors
/// Where there is none, or it does not hold.
pub fn profile(id: &str) -> Result<Profile, OpenError> {
    let text = bundled::text(id).ok_or_else(|| OpenError::UnknownProfile {
        id: id.into(),
        known: bundled::ids().collect::<Vec<_>>().join(", "),
        looked: "no folder".into(),
    })?;
    Profile::checked(text, &|name| bundled::file(name).map(String::from))
        .map_err(|error| OpenError::Profile { id: id.into(), error })
}

/// Connects one instrument by itself: its port is the endpoint's other half.
///
/// # Errors
/// Where it does not answer, or is another than the profile says. Nothing was commanded then.
pub fn open_one(
    instrument: &InstrumentSetup,
    endpoint: Endpoint,
    clock: impl Into<Clock>,
) -> Result<Links, OpenError> {
    let mut links = Links::none(clock.into());
    start(&mut links, instrument, Ok((endpoint, ())))?;
    Ok(links)
}

/// Starts the thread of one instrument, waits for its first sample and returns its port.
fn start<Port>(
    links: &mut Links,
    instrument: &InstrumentSetup,
    made: Result<(Endpoint, Port), SetupError>,
) -> Result<Port, OpenError> {
    let (endpoint, port) = made.map_err(|problem| instrument.mismatch(problem))?;
    let (health, role) = (endpoint.health(), endpoint.role());
    let (ready, opened) = std::sync::mpsc::sync_channel(1);
    let connection = Connection::new(endpoint, links.clock.clone(), Arc::clone(&links.stop), ready);
    let (id, address) = (&instrument.profile, &instrument.address);
    let failed = |problem| OpenError::Link { id: id.clone(), address: address.clone(), problem };
    let thread = match connection.endpoint.profile().description.link.kind {
        // Registers are registers: `rtu:PATH` reaches the same map over a serial line.
        LinkKind::ModbusTcp if !instrument.address.starts_with("rtu:") => {
            modbus_tcp::spawn(instrument, connection)
        }
        LinkKind::ModbusTcp | LinkKind::ModbusRtu => modbus_rtu::spawn(instrument, connection),
        LinkKind::Can if !connection.endpoint.role().only_measures() => {
            return Err(instrument.mismatch(SetupError::PlainCan));
        }
        LinkKind::Can => can::spawn(instrument, connection),
        LinkKind::Canopen => canopen::spawn(instrument, connection),
        LinkKind::Serial | LinkKind::Tcp | LinkKind::Udp | LinkKind::Scpi | LinkKind::Sysfs => {
            text::spawn(instrument, connection)
        }
    }
    .map_err(failed)?;
    links.links.push(Link { name: instrument.profile.clone(), role, health, thread: Some(thread) });
    opened.recv().unwrap_or(Err(LinkError::Unopened)).map_err(failed)?;
    Ok(port)
}

/// Samples per second of a profile's regular samples: of its stream, its polls, its
/// messages or its queries. `None` for a profile that does not hold or has none.
pub fn nominal_rate_hz(instrument: &InstrumentSetup) -> Option<f64> {
    let profile = instrument.description().ok()?;
    let d = &profile.description;
    let polled = d.poll.iter().find_map(|poll| poll.rate_hz);
    let streamed = d.stream.as_ref().map(|stream| stream.rate_hz);
    let sent = d.message.first().map(|message| message.rate_hz);
    streamed.or(polled).or(sent).or_else(|| d.query.first().map(|query| query.rate_hz))
}
