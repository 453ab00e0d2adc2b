//! A virtual rig's instruments behind their real protocols, each where the setup looks for it.
//!
//! `127.0.0.1:0` is any free port, `pty` a pseudo-terminal made for the purpose, an interface such as
//! `vcan0` the kernel's bus. What was chosen is put into the setup, so that the drivers find it.

use drivers::socketcan::KernelCan;
use drivers::vibrometer::VibrometerSetup;
use drivers::{InstrumentSetup, InstrumentsSetup};
use instruments::{LinkKind, Profile};
use miette::{IntoDiagnostic, bail, miette};
use serialport::{SerialPort, TTYPort};
use sim::wire::can::{CanDevice, CanEmulator, EmulatedAdapter};
use sim::wire::device::Device;
use sim::wire::lines::{LineInstrument, TcpLines};
use sim::wire::modbus_tcp::ModbusTcpServer;
use sim::wire::serial::SerialEmulator;
use sim::wire::streams::NetworkStream;
use sim::wire::sysfs::SysfsFolder;
use sim::wire::{Command, Quantity, SharedPlant};
use std::any::Any;
use std::collections::BTreeMap;
use std::net::SocketAddr;

/// Running emulators; dropping them stops them.
#[derive(Default)]
pub struct Emulators {
    serving: Vec<Box<dyn Any + Send>>,
    /// Where the Modbus TCP server listens, if there is one.
    pub modbus_tcp: Option<SocketAddr>,
    /// Where each instrument is, in words.
    pub places: Vec<String>,
}

impl Emulators {
    fn add(&mut self, emulator: impl Any + Send) {
        self.serving.push(Box::new(emulator));
    }
}

/// Serves every instrument of a setup over one world; to other machines only where `everywhere`.
///
/// # Errors
/// An address that cannot be served, or a profile that names what the world does not have.
pub fn serve(
    setup: &mut InstrumentsSetup,
    plant: &SharedPlant,
    everywhere: bool,
) -> miette::Result<Emulators> {
    if let Some(weight) = setup.stage.dead_weight_n {
        plant.now().0.command(&[(Command::NormalForce, weight)]);
    }
    let mut all: Vec<&mut InstrumentSetup> = setup.all_mut().collect();
    let (emulators, registers, lines, buses) = Default::default();
    let mut serving = Serving { plant, everywhere, emulators, registers, lines, buses };
    for instrument in &mut all {
        serving.one(instrument)?;
    }
    let mut emulators = serving.shared(&mut all)?;
    emulators.places = all.iter().map(|one| format!("{} at {}", one.profile, one.address)).collect();
    Ok(emulators)
}

/// What is served so far, and the places that several instruments may share, by address.
struct Serving<'a> {
    plant: &'a SharedPlant,
    everywhere: bool,
    emulators: Emulators,
    registers: BTreeMap<String, BTreeMap<u8, Device>>,
    lines: BTreeMap<String, BTreeMap<u8, Device>>,
    buses: BTreeMap<String, Vec<CanDevice>>,
}

impl Serving<'_> {
    /// Serves an instrument that has its place for itself; another one is put to those of its place.
    fn one(&mut self, instrument: &mut InstrumentSetup) -> miette::Result<()> {
        let (plant, everywhere, emulators) = (self.plant, self.everywhere, &mut self.emulators);
        let mut profile = instrument.description().into_diagnostic()?;
        if let Some(rate) = instrument.rate_hz {
            // What comes by itself comes as often as the setup expects it.
            let unasked = profile.description.message.iter_mut().filter(|message| message.request.is_none());
            unasked.for_each(|message| message.rate_hz = rate);
        }
        let link = profile.description.link.clone();
        let device = mounted(profile, instrument)?;
        let failed = |error: std::io::Error| miette!("{} cannot be served: {error}", instrument.profile);
        let twice = |of: &str, unit: u8| {
            miette!(help = "give one of them another `unit`", "two instruments {of} have Modbus unit {unit}")
        };
        match link.kind {
            LinkKind::ModbusTcp if !instrument.address.starts_with("rtu:") => {
                let unit = instrument.unit.or(link.unit).unwrap_or(1);
                let units = self.registers.entry(instrument.address.clone()).or_default();
                // A board that is relay and inputs at once is named twice and served once.
                let other = |served: &Device| served.profile().id() != instrument.profile;
                if units.insert(unit, device).is_some_and(|served| other(&served)) {
                    return Err(twice("of the virtual rig", unit));
                }
            }
            LinkKind::ModbusTcp | LinkKind::ModbusRtu => {
                let unit = instrument.unit.or(link.unit).unwrap_or(1);
                if instrument.address.ends_with("pty") {
                    let port = port(&mut instrument.address)?;
                    let units = [(unit, device)].into_iter().collect();
                    emulators.add(SerialEmulator::modbus_rtu(port, units, plant.clone()).map_err(failed)?);
                } else {
                    let units = self.lines.entry(instrument.address.clone()).or_default();
                    if units.insert(unit, device).is_some() {
                        return Err(twice(&format!("at {}", instrument.address), unit));
                    }
                }
            }
            LinkKind::Can | LinkKind::Canopen => {
                let base = instrument.base.or(link.base).or(link.node.map(u32::from)).unwrap_or(0);
                let devices = CanDevice { device, base };
                if instrument.address.starts_with("slcan:") {
                    let adapter = EmulatedAdapter::new(port(&mut instrument.address)?);
                    emulators.add(CanEmulator::start(adapter, vec![devices], plant.clone()).map_err(failed)?);
                } else {
                    self.buses.entry(instrument.address.clone()).or_default().push(devices);
                }
            }
            LinkKind::Serial => {
                let port = port(&mut instrument.address)?;
                let served = if device.profile().description.stream.is_some() {
                    SerialEmulator::stream(port, device, plant.clone())
                } else {
                    SerialEmulator::lines(port, LineInstrument::new(device, plant.clone()), || None)
                };
                emulators.add(served.map_err(failed)?);
            }
            LinkKind::Tcp | LinkKind::Udp if device.profile().description.stream.is_some() => {
                let place = socket(&instrument.address, everywhere)?;
                let served = NetworkStream::start(place, device, plant.clone()).map_err(failed)?;
                instrument.address = served.address().to_string();
                emulators.add(served);
            }
            LinkKind::Sysfs => {
                let served = SysfsFolder::start(device, plant.clone()).map_err(failed)?;
                instrument.address = served.path().display().to_string();
                emulators.add(served);
            }
            LinkKind::Scpi | LinkKind::Tcp | LinkKind::Udp => {
                let served = LineInstrument::new(device, plant.clone());
                let server =
                    TcpLines::start(socket(&instrument.address, everywhere)?, served).map_err(failed)?;
                instrument.address = server.address().to_string();
                emulators.add(server);
            }
        }
        Ok(())
    }

    /// Serves the shared places with all their instruments.
    fn shared(self, all: &mut [&mut InstrumentSetup]) -> miette::Result<Emulators> {
        let (plant, everywhere, mut emulators) = (self.plant, self.everywhere, self.emulators);
        for (address, units) in self.registers {
            let server = ModbusTcpServer::start(socket(&address, everywhere)?, units, plant.clone())
                .map_err(|error| miette!("cannot listen on {address}: {error}"))?;
            for instrument in all.iter_mut().filter(|instrument| instrument.address == address) {
                instrument.address = server.address().to_string();
            }
            emulators.modbus_tcp.get_or_insert(server.address());
            emulators.add(server);
        }
        for (mut address, units) in self.lines {
            let port = port(&mut address)?;
            let failed = |error: std::io::Error| miette!("{address} cannot be served: {error}");
            emulators.add(SerialEmulator::modbus_rtu(port, units, plant.clone()).map_err(failed)?);
        }
        for (interface, devices) in self.buses {
            let bus = KernelCan::open(&interface).into_diagnostic()?;
            let emulator = CanEmulator::start(bus, devices, plant.clone());
            emulators.add(emulator.into_diagnostic()?);
        }
        Ok(emulators)
    }
}

/// An emulated instrument as it is mounted: a force sensor shows the axes that the setup has it for.
fn mounted(profile: Profile, instrument: &InstrumentSetup) -> miette::Result<Device> {
    let mut device = Device::new(profile).into_diagnostic()?;
    let axes = [(&instrument.lateral, Quantity::LateralForce), (&instrument.normal, Quantity::NormalForce)];
    for (axis, quantity) in axes {
        if let Some(axis) = axis {
            device.mount(&axis.signal, quantity, axis.gain, axis.offset_n);
        }
    }
    Ok(device)
}

/// Serves a vibrometer's controller where the setup looks for it.
///
/// # Errors
/// A line that cannot be served, or a profile that names what the world does not have.
pub fn vibrometer(setup: &mut VibrometerSetup, plant: &SharedPlant) -> miette::Result<SerialEmulator> {
    let profile = setup.description().into_diagnostic()?;
    let device = Device::new(profile).into_diagnostic()?;
    let port = port(&mut setup.address)?;
    SerialEmulator::lines(port, LineInstrument::new(device, plant.clone()), || None)
        .map_err(|error| miette!("{} cannot be served: {error}", setup.profile))
}

/// A loopback address, unless other machines are to be served.
fn socket(address: &str, everywhere: bool) -> miette::Result<SocketAddr> {
    let address: SocketAddr = address
        .parse()
        .map_err(|_| miette!("`{address}`: the virtual rig needs an address like 127.0.0.1:0"))?;
    if everywhere || address.ip().is_loopback() {
        Ok(address)
    } else {
        Err(miette!("the virtual rig listens on loopback only, not on {address}"))
    }
}

/// The emulator's end of a serial line: `pty` makes one and puts its path into the address, another
/// path is opened.
fn port(address: &mut String) -> miette::Result<Box<dyn SerialPort>> {
    let (scheme, path) = match address.split_once(':') {
        Some((scheme, path)) => (format!("{scheme}:"), path.to_string()),
        None => (String::new(), address.clone()),
    };
    if path == "pty" {
        let (master, slave) = TTYPort::pair().map_err(|error| miette!("no pseudo-terminal: {error}"))?;
        let name = slave.name().ok_or_else(|| miette!("a pseudo-terminal without a name"))?;
        *address = format!("{scheme}{name}");
        return Ok(Box::new(master));
    }
    serialport::new(&path, 115_200).open().map_err(|error| miette!("{path}: {error}"))
}

/// Emulators of a setup's instruments by Modbus unit, for a virtual rig behind Modbus TCP.
///
/// # Errors
/// A profile that is not bundled or names what the world does not have, or two instruments of one unit.
pub fn emulators(setup: &InstrumentsSetup) -> miette::Result<BTreeMap<u8, Device>> {
    let mut devices = BTreeMap::new();
    for instrument in setup.all() {
        let profile = instrument.description().into_diagnostic()?;
        if !matches!(profile.description.link.kind, LinkKind::ModbusTcp | LinkKind::ModbusRtu) {
            continue;
        }
        let unit = instrument.unit.or(profile.description.link.unit).unwrap_or(1);
        let device = mounted(profile, instrument).map_err(|e| miette!("{}: {e}", instrument.profile))?;
        let other = |served: &Device| served.profile().id() != instrument.profile;
        if devices.insert(unit, device).is_some_and(|served| other(&served)) {
            bail!(
                help = "give one of them another `unit`",
                "two instruments of the virtual rig have Modbus unit {unit}"
            );
        }
    }
    Ok(devices)
}
