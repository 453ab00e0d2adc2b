//! A look at an instrument that has no profile yet: registers, CAN frames or bytes. It reads, for a bounded
//! time, and writes nothing.

use super::link_error::{AddressError, LinkError};
use super::modbus::{Registers, Trouble};
use super::modbus_rtu::Rtu;
use super::modbus_tcp::{Tcp, resolve};
use super::remedy::advice;
use super::transport::Address;
use instruments::CanEvent;
pub use instruments::profile::MOST_REGISTERS;
use instruments::schema::Table;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// How long a connection may take, and how long an answer, in ms.
const PATIENCE_MS: u32 = 1000;
/// Most bytes that are listened to.
pub const MOST_BYTES: usize = 4096;

/// What is at the address.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PeekAddress {
    /// A serial line, by its path.
    Serial(String),
    /// `host:port`.
    Tcp(String),
    /// A CAN interface, or `slcan:PATH`.
    Can(String),
}

impl PeekAddress {
    /// The place that an address means: `rtu:PATH` or `PATH`, `tcp:HOST:PORT`, `can:NAME` or `slcan:PATH`.
    pub fn of(address: &str) -> Self {
        let interface =
            |name: &str| name.strip_prefix("vcan").or(name.strip_prefix("can")).map(str::is_empty);
        if let Some(host) = address.strip_prefix("tcp:") {
            Self::Tcp(host.into())
        } else if let Some(name) = address.strip_prefix("can:") {
            Self::Can(name.into())
        } else if address.starts_with("slcan:")
            || (interface(address) == Some(false) && !address.contains('/'))
        {
            Self::Can(address.into())
        } else {
            Self::Serial(address.strip_prefix("rtu:").unwrap_or(address).into())
        }
    }
}

/// How a serial line or a bus runs.
#[derive(Debug, Clone)]
pub struct Speed {
    /// Symbols per second of a serial line.
    pub baud: u32,
    /// Its format, such as `8N1`.
    pub format: String,
}

/// Why a look failed, with what to look at.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the message of an error says what it is")]
pub enum PeekError {
    #[error(transparent)]
    Address(#[from] AddressError),
    #[error(transparent)]
    Io(#[from] std::io::Error),
    #[error("{0}; {advice}", advice = advice(&.0.to_string()))]
    Link(#[from] LinkError),
    #[error("the instrument refused: {0}")]
    Refused(String),
    #[error("{0}; check speed, format and wiring of the line")]
    Corrupt(String),
    #[error("{0} is a CAN bus and has no {1}")]
    CanBus(String, &'static str),
}

impl From<Trouble> for PeekError {
    fn from(trouble: Trouble) -> Self {
        match trouble {
            Trouble::Refused(why) => Self::Refused(why),
            Trouble::Corrupt(why) => Self::Corrupt(why),
            Trouble::LinkError(ended) => ended.into(),
        }
    }
}

/// Reads `count` registers from `first` on, over Modbus TCP or RTU.
///
/// # Errors
/// Nobody there, or an answer that is no good.
pub fn registers(
    place: &PeekAddress,
    speed: &Speed,
    unit: u8,
    table: Table,
    (first, count): (u16, u16),
) -> Result<Vec<u16>, PeekError> {
    let bytes = match place {
        PeekAddress::Tcp(host) => {
            let address = resolve(host, Some(502))?;
            let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
            let with = (&runtime, &Instant::now().into());
            Tcp::connect(with, address, unit, PATIENCE_MS, PATIENCE_MS)?.read(table, first, count)?
        }
        PeekAddress::Serial(path) => {
            Rtu::open(path, speed.baud, &speed.format, unit, PATIENCE_MS)?.read(table, first, count)?
        }
        PeekAddress::Can(name) => return Err(PeekError::CanBus(name.clone(), "registers; leave them out")),
    };
    Ok(bytes.chunks_exact(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]])).collect())
}

/// Frames of one identifier.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Frames {
    /// How many came.
    pub count: u32,
    /// The data of the last one.
    pub data: Vec<u8>,
}

/// Listens to a CAN bus; frames by identifier, and whether that has 29 bits.
///
/// # Errors
/// No bus, or one that fails.
pub fn frames(name: &str, bitrate: u32, long: Duration) -> Result<BTreeMap<(u32, bool), Frames>, PeekError> {
    let mut port = super::can::open(name, bitrate)?;
    let (until, mut seen) = (Instant::now() + long, BTreeMap::<_, Frames>::new());
    while Instant::now() < until {
        match port.receive(until)? {
            Some(CanEvent::Frame(frame, _)) => {
                let of = seen.entry((frame.id, frame.extended)).or_default();
                *of = Frames { count: of.count + 1, data: frame.data().to_vec() };
            }
            Some(CanEvent::BusOff | CanEvent::Passive) => {
                return Err(std::io::Error::other(super::can::PASSIVE).into());
            }
            Some(CanEvent::Warning | CanEvent::Other) | None => {}
        }
    }
    Ok(seen)
}

/// Listens to a serial line or a TCP server, and returns the bytes that came.
///
/// # Errors
/// Nobody there, or a line that fails.
pub fn bytes(place: &PeekAddress, speed: &Speed, long: Duration) -> Result<Vec<u8>, PeekError> {
    let address = match place {
        PeekAddress::Serial(path) => Address::Serial(path.clone(), speed.baud, speed.format.clone()),
        PeekAddress::Tcp(host) => Address::Tcp(resolve(host, None)?),
        PeekAddress::Can(name) => return Err(PeekError::CanBus(name.clone(), "lines")),
    };
    let patience = Duration::from_millis(PATIENCE_MS.into());
    let mut transport = address.open(patience)?;
    let until = Instant::now() + long;
    let (mut came, mut buffer) = (Vec::new(), [0; 512]);
    while Instant::now() < until && came.len() < MOST_BYTES {
        match transport.read(&mut buffer, until) {
            Ok(0) => break,
            Ok(count) => came.extend_from_slice(&buffer[..count]),
            // A server that closes after its words has shown them.
            Err(_) if !came.is_empty() => break,
            Err(ended) => return Err(ended.into()),
        }
    }
    came.truncate(MOST_BYTES);
    Ok(came)
}

#[cfg(test)]
mod tests {
    use super::PeekAddress;

    #[test]
    fn addresses_say_what_is_there() {
        let serial = PeekAddress::Serial("/dev/ttyUSB0".into());
        assert_eq!(PeekAddress::of("rtu:/dev/ttyUSB0"), serial);
        assert_eq!(PeekAddress::of("/dev/ttyUSB0"), serial);
        assert_eq!(PeekAddress::of("tcp:10.0.0.7:502"), PeekAddress::Tcp("10.0.0.7:502".into()));
        for name in ["can0", "vcan1", "slcan:/dev/ttyACM0"] {
            assert_eq!(PeekAddress::of(name), PeekAddress::Can(name.into()));
        }
        assert_eq!(PeekAddress::of("can:mybus"), PeekAddress::Can("mybus".into()));
        assert_eq!(PeekAddress::of("can/port"), PeekAddress::Serial("can/port".into()));
    }
}
