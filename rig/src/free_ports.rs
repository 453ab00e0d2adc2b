//! Whether a run could open what its setup names: serial lines, sockets, CAN interfaces, and the claim of the
//! rig. Each is opened and closed again; nothing is sent.

#![allow(clippy::disallowed_methods, reason = "a socket is waited for in wall-clock time")]

use crate::rig_lock::RigLock;
use drivers::InstrumentSetup;
use drivers::modbus_tcp::resolve;
use instruments::LinkKind;
use runs::Setup;
use runs::input::Problems;
use std::collections::BTreeSet;
use std::fs::OpenOptions;
use std::net::{TcpListener, TcpStream};
use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
use std::path::Path;
use std::time::Duration;

/// How long a device may take to accept.
const ACCEPTS_WITHIN: Duration = Duration::from_secs(1);

/// Everything that cannot be opened, with the place of its address in the setup.
///
/// # Errors
/// All of it.
pub fn free(setup: &Setup) -> miette::Result<()> {
    let mut wrong = Problems::of(&setup.origin, &setup.text);
    let served = setup.file.virtual_rig.is_some();
    let mut tried = BTreeSet::new();
    for (table, instrument) in setup.file.by_table() {
        // One line or one device server may carry several.
        if !tried.insert(instrument.address.clone()) {
            continue;
        }
        if let Err((problem, remedy)) = if served { can_be_served(instrument) } else { opens(instrument) } {
            let problem = format!("{table} `{}` at {}: {problem}", instrument.profile, instrument.address);
            let place: &[&str] = if table == "force" { &["force"] } else { &[table, "address"] };
            wrong.add(place, problem, Some(remedy.to_string()));
        }
    }
    if wrong.is_empty()
        && !served
        && let Err(held) = RigLock::take(setup)
    {
        let remedy = held.help().map(|h| h.to_string());
        wrong.add(&["name"], format!("{held}: {}", held.root_cause()), remedy);
    }
    wrong.end()
}

type Closed = (String, &'static str);

const PLUG: &str = "plug it in or correct the address; `--offline` leaves the ports out";

/// Whether an emulator can listen where the virtual rig is to.
fn can_be_served(instrument: &InstrumentSetup) -> Result<(), Closed> {
    let remedy = "end the program that has it, or state port 0: any free one is taken";
    match kind(instrument) {
        Some((LinkKind::ModbusTcp | LinkKind::Scpi | LinkKind::Tcp, port))
            if !instrument.address.starts_with("rtu:") =>
        {
            let address = resolve(&instrument.address, port);
            let address = address.map_err(|e| (e.to_string(), "correct the address"))?;
            TcpListener::bind(address).map(drop).map_err(|e| (format!("cannot be served there: {e}"), remedy))
        }
        Some((LinkKind::Can | LinkKind::Canopen, _)) if !instrument.address.starts_with("slcan:") => {
            opens(instrument)
        }
        _ => Ok(()),
    }
}

fn kind(instrument: &InstrumentSetup) -> Option<(LinkKind, Option<u16>)> {
    let link = instrument.description().ok()?.description.link;
    Some((link.kind, link.port))
}

/// Whether the instrument's address can be opened.
fn opens(instrument: &InstrumentSetup) -> Result<(), Closed> {
    let Some((kind, port)) = kind(instrument) else { return Ok(()) };
    let address = instrument.address.as_str();
    let found = |address: &str| {
        let correct = "correct the address; `--offline` leaves the ports out";
        resolve(address, port).map_err(|e| (e.to_string(), correct))
    };
    let socket = |address: &str| {
        let found = found(address)?;
        let accepted = TcpStream::connect_timeout(&found, ACCEPTS_WITHIN);
        let remedy = "switch it on, check cable and address; `--offline` leaves the ports out";
        accepted.map(drop).map_err(|e| (format!("nobody accepts there: {e}"), remedy))
    };
    match kind {
        LinkKind::ModbusTcp if !address.starts_with("rtu:") => socket(address),
        LinkKind::Scpi | LinkKind::Tcp => socket(address.strip_prefix("tcp:").unwrap_or(address)),
        // Nobody accepts datagrams before one is sent.
        LinkKind::Udp => found(address).map(drop),
        LinkKind::Sysfs if Path::new(address).is_dir() => Ok(()),
        LinkKind::Sysfs => Err(("there is no such folder".into(), PLUG)),
        LinkKind::Serial if address.starts_with("tcp:") => socket(&address[4..]),
        LinkKind::Can | LinkKind::Canopen if !address.starts_with("slcan:") => {
            let there = Path::new("/sys/class/net").join(address).exists();
            let remedy = "bring the interface up, as in `ip link set can0 up type can bitrate 1000000`; `--offline` leaves the ports out";
            if there { Ok(()) } else { Err(("there is no such CAN interface".into(), remedy)) }
        }
        LinkKind::ModbusTcp | LinkKind::ModbusRtu | LinkKind::Serial | LinkKind::Can | LinkKind::Canopen => {
            line(Path::new(address.split_once(':').map_or(address, |(_, path)| path)))
        }
    }
}

fn line(path: &Path) -> Result<(), Closed> {
    let flags = libc::O_NOCTTY | libc::O_NONBLOCK;
    let opened = OpenOptions::new().read(true).write(true).custom_flags(flags).open(path);
    let file = opened.map_err(|e| {
        let remedy = match e.raw_os_error() {
            _ if e.kind() == std::io::ErrorKind::PermissionDenied => {
                "give the user the group that owns it, mostly `dialout`"
            }
            Some(libc::EBUSY) => "another program holds it: end that",
            _ => PLUG,
        };
        (format!("cannot be opened: {e}"), remedy)
    })?;
    let is_line = file.metadata().is_ok_and(|m| m.file_type().is_char_device());
    let other = ("that is not a serial line".into(), "name the device, as in /dev/ttyUSB0");
    if is_line { Ok(()) } else { Err(other) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use drivers::user_profiles::Source;

    /// An instrument with a socket, datagrams or a folder is none with a serial line.
    #[test]
    fn each_kind_of_link_is_opened_as_its_driver_does() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let there = listener.local_addr().unwrap().to_string();
        let text = include_str!("../../docs/profiles/ascii-generator.toml");
        let text = text.replacen("\"serial\"\nbaud = 115200\nformat = \"8N1\"", "\"tcp\"", 1);
        let source = Source { id: "own".into(), origin: "own".into(), text, files: Vec::new() };
        let tcp = InstrumentSetup { source: Some(source.into()), ..InstrumentSetup::new("own", &there) };
        assert_eq!(opens(&tcp), Ok(()));
        drop(listener);
        assert!(opens(&tcp).unwrap_err().0.contains("nobody accepts"));
        assert_eq!(opens(&InstrumentSetup::new("ati-netft-rdt", "127.0.0.1:49152")), Ok(()));
        let folder = tempfile::tempdir().unwrap();
        let sysfs = |folder: &Path| InstrumentSetup::new("iio-voltage", folder.to_str().unwrap());
        assert_eq!(opens(&sysfs(folder.path())), Ok(()));
        assert!(opens(&sysfs(Path::new("/no/such/device"))).is_err());
    }
}
