//! Sustained sample rates and ages on every transport that needs no hardware: the driver beside a bare client of the
//! same crate, in turn, against the same emulator in the same run; and what the wire itself would allow.
//!
//! `cargo bench -p muprime-rig --bench buses` prints the table that BENCHMARKS.md quotes. The bare client does what the bus
//! demands (the silence between RTU frames, one answer before the next question) and nothing else: it decodes nothing.
#![allow(clippy::disallowed_methods, reason = "it measures time")]

use drivers::InstrumentSetup;
use drivers::endpoint::Endpoint;
use instruments::codec::can::{CanFrame, SlcanReader, slcan_line};
use instruments::codec::modbus_rtu as rtu;
use realtime::ports::{Amplifier, ForceSensor, Nanos};
use serialport::{SerialPort, TTYPort};
use sim::wire::can::{CanDevice, CanEmulator, EmulatedAdapter};
use sim::wire::device::Device;
use sim::wire::lines::{LineInstrument, TcpLines};
use sim::wire::modbus_tcp::ModbusTcpServer;
use sim::wire::serial::SerialEmulator;
use sim::wire::{Command, Plant, Quantity, SharedPlant};
use std::io::{Read, Write};
use std::time::{Duration, Instant};

/// How long each client runs in a turn, and how many turns there are.
const TURN: Duration = Duration::from_millis(1500);
const TURNS: usize = 5;
/// As often as the instrument answers: every period is over before the driver could sleep for it.
const FAST: f64 = 1e9;

/// A world that stands still but counts: every read is a new sample, taken when it is read.
struct Still {
    samples: f64,
    begun: Instant,
}

impl Plant for Still {
    fn advance(&mut self, _now: Nanos) {}
    fn measure(&mut self, quantity: Quantity) -> f64 {
        match quantity {
            Quantity::ForceSample | Quantity::DriveCount | Quantity::StageCount => {
                self.samples += 1.0;
                self.samples
            }
            Quantity::ForceTime | Quantity::DriveTime | Quantity::DeviceTime => {
                self.begun.elapsed().as_secs_f64()
            }
            Quantity::FrequencySetPoint => 27_500.0,
            Quantity::LateralForce | Quantity::NormalForce => 0.25,
            _ => 0.0,
        }
    }
    fn command(&mut self, _commands: &[(Command, f64)]) {}
}

fn plant() -> SharedPlant {
    SharedPlant::new(Still { samples: 0.0, begun: Instant::now() }, Instant::now())
}

fn device(id: &str) -> Device {
    Device::new(drivers::profile(id).unwrap()).unwrap()
}

fn pty() -> (Box<dyn SerialPort>, String) {
    let (master, slave) = TTYPort::pair().unwrap();
    let path = slave.name().unwrap();
    (Box::new(master), path)
}

fn open(path: &str, baud: u32) -> Box<dyn SerialPort> {
    serialport::new(path, baud).timeout(Duration::from_secs(1)).open().unwrap()
}

/// Samples per second of the driver, and ages in us of what the loop's side reads each millisecond.
fn driver(instrument: &InstrumentSetup) -> (f64, Vec<f64>) {
    let profile = drivers::profile(&instrument.profile).unwrap();
    let epoch = Instant::now();
    let now = || Nanos(u64::try_from(epoch.elapsed().as_nanos()).unwrap());
    let amplifier = profile.set("amplitude").is_some();
    let mut read: Box<dyn FnMut(Nanos) -> Option<Nanos>>;
    let endpoint = if amplifier {
        let (endpoint, mut port) = Endpoint::amplifier(profile, instrument).unwrap();
        read = Box::new(move |now| port.state(now).ok().map(|state| state.taken_at));
        endpoint
    } else {
        let (endpoint, (mut port, _)) = Endpoint::force(profile, instrument).unwrap();
        read = Box::new(move |now| port.read(now).lateral.ok().map(|reading| reading.taken_at));
        endpoint
    };
    let health = endpoint.health();
    let link = drivers::open_one(instrument, endpoint, epoch).unwrap();
    // The first samples come while the link is being set up.
    std::thread::sleep(Duration::from_millis(100));
    read(now());
    let (began, before) = (Instant::now(), health.report().samples);
    let mut ages = Vec::new();
    while began.elapsed() < TURN {
        std::thread::sleep(Duration::from_millis(1));
        let at = now();
        ages.extend(read(at).map(|taken| at.since(taken).0 as f64 * 1e-3));
    }
    let rate = (health.report().samples - before) as f64 / began.elapsed().as_secs_f64();
    drop(link);
    (rate, ages)
}

/// Samples per second of something that makes one at each call.
fn bare(mut sample: impl FnMut() -> u64) -> f64 {
    let (began, mut samples) = (Instant::now(), 0);
    while began.elapsed() < TURN {
        samples += sample();
    }
    samples as f64 / began.elapsed().as_secs_f64()
}

/// One transport: its name, the driver's setup, the bare client's turn, and what the wire allows in samples a second.
struct Bus<'a> {
    name: &'a str,
    instrument: InstrumentSetup,
    bare: Box<dyn FnMut() -> f64 + 'a>,
    wire: String,
}

fn race(mut bus: Bus<'_>) {
    let (mut ratios, mut ours, mut theirs, mut ages) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for turn in 0..TURNS {
        let bare_first = turn % 2 == 0;
        let mut other = bare_first.then(|| (bus.bare)());
        let (rate, mut age) = driver(&bus.instrument);
        let other = *other.get_or_insert_with(|| (bus.bare)());
        ratios.push(rate / other);
        ours.push(rate);
        theirs.push(other);
        ages.append(&mut age);
    }
    let at = |values: &mut Vec<f64>, q: f64| {
        values.sort_by(f64::total_cmp);
        values[((values.len() - 1) as f64 * q).round() as usize]
    };
    println!(
        "| {} | {:.0} | {:.0} | {:.2} ({:.2} to {:.2}) | {} | {:.2} / {:.2} / {:.2} |",
        bus.name,
        at(&mut ours, 0.5),
        at(&mut theirs, 0.5),
        at(&mut ratios, 0.5),
        at(&mut ratios, 0.0),
        at(&mut ratios, 1.0),
        bus.wire,
        at(&mut ages, 0.5) * 1e-3,
        at(&mut ages, 0.99) * 1e-3,
        at(&mut ages, 1.0) * 1e-3,
    );
}

fn fast(profile: &str, address: &str) -> InstrumentSetup {
    let axis = |signal: &str| Some(drivers::AxisSetup { signal: signal.into(), gain: 1.0, offset_n: 0.0 });
    let mut setup = InstrumentSetup { rate_hz: Some(FAST), ..InstrumentSetup::new(profile, address) };
    let named = drivers::profile(profile).unwrap();
    if named.signal("fx").is_some() {
        (setup.lateral, setup.normal) = (axis("fx"), axis("fz"));
    }
    setup
}

fn modbus_tcp() {
    let units = [(1, device("muprime-force2"))].into_iter().collect();
    let server = ModbusTcpServer::start("127.0.0.1:0".parse().unwrap(), units, plant()).unwrap();
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    let profile = drivers::profile("muprime-force2").unwrap();
    let poll = profile.frames()[0].spans[0];
    let address = server.address();
    let bare = move || {
        let connected = runtime.block_on(async {
            let stream = tokio::net::TcpStream::connect(address).await?;
            stream.set_nodelay(true)?;
            Ok::<_, std::io::Error>(tokio_modbus::client::tcp::attach_slave(stream, tokio_modbus::Slave(1)))
        });
        let mut client = connected.unwrap();
        bare(|| {
            use tokio_modbus::client::Reader;
            runtime.block_on(client.read_holding_registers(poll.address, poll.count)).unwrap().unwrap();
            1
        })
    };
    race(Bus {
        name: "Modbus TCP, 12 registers (tokio-modbus)",
        instrument: fast("muprime-force2", &address.to_string()),
        bare: Box::new(bare),
        wire: "loopback".into(),
    });
}

fn modbus_rtu() {
    const BAUD: u32 = 115_200;
    let (port, path) = pty();
    let units = [(9, device("robotiq-ft300"))].into_iter().collect();
    let _emulator = SerialEmulator::modbus_rtu(port, units, plant()).unwrap();
    let request = rtu::read(9, 3, 180, 6);
    let silence = Duration::from_secs_f64(rtu::silence_s(BAUD));
    let bare = || {
        let mut line = open(&path, BAUD);
        let mut answer = vec![0; request.answer_length];
        bare(|| {
            line.write_all(&request.bytes).unwrap();
            line.read_exact(&mut answer).unwrap();
            std::thread::sleep(silence);
            1
        })
    };
    // Question and answer at ten bits a byte, and a silence after each.
    let bits = 10.0 * (request.bytes.len() + request.answer_length) as f64;
    let wire = 1.0 / (bits / f64::from(BAUD) + 2.0 * rtu::silence_s(BAUD));
    let instrument = InstrumentSetup { baud: Some(BAUD), ..fast("robotiq-ft300", &path) };
    let wire = format!("{wire:.0} at 115200 baud");
    race(Bus { name: "Modbus RTU, 6 registers, pty (serialport)", instrument, bare: Box::new(bare), wire });
}

fn ati_stream() {
    let (port, path) = pty();
    let units = [(10, device("ati-digital-ft"))].into_iter().collect();
    let _emulator = SerialEmulator::modbus_rtu(port, units, plant()).unwrap();
    let bare = || {
        let mut line = open(&path, 1_250_000);
        line.write_all(&rtu::custom(10, 0x46, &[0x55], 5).bytes).unwrap();
        line.read_exact(&mut [0; 5]).unwrap();
        let (mut buffer, mut bytes) = ([0; 1024], 0);
        let rate = bare(|| {
            bytes += line.read(&mut buffer).unwrap();
            let whole = bytes / 13;
            bytes %= 13;
            whole as u64
        });
        line.write_all(&[0; 72]).unwrap();
        line.set_timeout(Duration::from_millis(100)).unwrap();
        while line.read(&mut buffer).is_ok() {}
        rate
    };
    let wire = format!("{:.0} at 1.25 Mbaud, 7000 sent", 1.25e6 / (13.0 * 11.0));
    let instrument = InstrumentSetup { rate_hz: None, ..fast("ati-digital-ft", &path) };
    race(Bus { name: "ATI stream, 13 bytes, pty (serialport)", instrument, bare: Box::new(bare), wire });
}

fn slcan() {
    let (port, path) = pty();
    let devices = vec![CanDevice { device: device("ati-netft-can"), base: 432 }];
    let _emulator = CanEmulator::start(EmulatedAdapter::new(port), devices, plant()).unwrap();
    let request = slcan_line(&CanFrame::new(432, &[0x02]).unwrap());
    let bare = || {
        let mut line = open(&path, 115_200);
        line.write_all(b"\rC\rS8\rO\r").unwrap();
        std::thread::sleep(Duration::from_millis(50));
        line.set_timeout(Duration::from_millis(1)).unwrap();
        let mut buffer = [0; 512];
        while line.read(&mut buffer).is_ok() {}
        line.set_timeout(Duration::from_secs(1)).unwrap();
        let mut reader = SlcanReader::default();
        bare(|| {
            line.write_all(&request).unwrap();
            let mut frames = 0;
            while frames < 2 {
                let count = line.read(&mut buffer).unwrap();
                reader.push(&buffer[..count], |_| frames += 1);
            }
            1
        })
    };
    let instrument = fast("ati-netft-can", &format!("slcan:{path}"));
    // devices.md 1.1: request and two replies at 500 kbit/s with the most stuffing bits.
    race(Bus {
        name: "CAN by slcan, request and 2 replies, pty (serialport)",
        instrument,
        bare: Box::new(bare),
        wire: "1493 at 500 kbit/s".into(),
    });
}

fn serial_block() {
    let (port, path) = pty();
    let served = LineInstrument::new(device("piezodrive-pdus210"), plant());
    let _emulator = SerialEmulator::lines(port, served, || None).unwrap();
    let bare = || {
        let mut line = open(&path, 921_600);
        let mut state = [0; 80];
        let mut asked = Instant::now();
        bare(|| {
            // The gap that the maker demands between questions.
            std::thread::sleep(Duration::from_micros(2500).saturating_sub(asked.elapsed()));
            line.write_all(b"getSTATE\r").unwrap();
            asked = Instant::now();
            line.read_exact(&mut state).unwrap();
            1
        })
    };
    let wire = format!("{:.0} with the maker's 2.5 ms between questions", 1.0 / 2.5e-3);
    let instrument = fast("piezodrive-pdus210", &path);
    race(Bus {
        name: "serial text and 80-byte block, pty (serialport)",
        instrument,
        bare: Box::new(bare),
        wire,
    });
}

fn scpi() {
    let served = LineInstrument::new(device("keysight-33500b"), plant());
    let server = TcpLines::start("127.0.0.1:0".parse().unwrap(), served).unwrap();
    let address = server.address();
    let bare = || {
        let mut stream = std::net::TcpStream::connect(address).unwrap();
        stream.set_nodelay(true).unwrap();
        let mut buffer = [0; 256];
        bare(|| {
            for question in ["SOUR1:VOLT?\n", "SOUR1:FREQ?\n", "OUTP1?\n"] {
                stream.write_all(question.as_bytes()).unwrap();
                let mut last = 0;
                while last != b'\n' {
                    let count = stream.read(&mut buffer).unwrap();
                    last = buffer[count - 1];
                }
            }
            1
        })
    };
    let instrument = fast("keysight-33500b", &address.to_string());
    race(Bus {
        name: "SCPI over TCP, 3 questions (std::net)",
        instrument,
        bare: Box::new(bare),
        wire: "loopback".into(),
    });
}

fn main() {
    println!(
        "| transport | driver (1/s) | bare client (1/s) | ratio (least to most) | the wire allows (1/s) | age 50 / 99 / 100 % (ms) |"
    );
    println!("|---|---|---|---|---|---|");
    modbus_tcp();
    modbus_rtu();
    ati_stream();
    slcan();
    serial_block();
    scpi();
}
