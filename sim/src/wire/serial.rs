//! Emulated instruments on serial lines: the port, and Modbus RTU with streams on it.

use super::device::{Device, Refused};
use super::{Service, SharedPlant};
use instruments::codec::modbus_rtu::{self as rtu, Operation, Parsed};
use instruments::schema::{Stream, Table};
use realtime::Nanos;
use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::time::Duration;

/// The emulator's end of a serial line.
pub type Port = Box<dyn serialport::SerialPort>;

/// An emulator on a serial line; dropping it stops it.
pub struct SerialEmulator {
    _thread: Service,
}

impl SerialEmulator {
    /// Runs `turn` again and again on a thread of its own, with what the line gave meanwhile and where
    /// answers go. The line is polled every half millisecond; one that nobody holds open is waited for.
    ///
    /// # Errors
    /// Where no thread can be had.
    pub fn start(
        mut port: Port,
        mut turn: impl FnMut(&[u8]) -> Vec<u8> + Send + 'static,
    ) -> io::Result<Self> {
        let _ = port.set_timeout(Duration::from_micros(500));
        let mut buffer = [0; 1024];
        let turn = move |_: &_| {
            let count = match port.read(&mut buffer) {
                Ok(count) => count,
                Err(error) if error.kind() == io::ErrorKind::TimedOut => 0,
                Err(_) => {
                    std::thread::sleep(Duration::from_millis(1));
                    0
                }
            };
            let answer = turn(&buffer[..count]);
            if !answer.is_empty() {
                let _ = port.write_all(&answer);
            }
        };
        Ok(Self { _thread: Service::start("serial-emulator", turn)? })
    }

    /// Serves Modbus RTU units, each with its stream if its profile has one.
    ///
    /// # Errors
    /// Where no thread can be had.
    pub fn modbus_rtu(port: Port, devices: BTreeMap<u8, Device>, plant: SharedPlant) -> io::Result<Self> {
        let mut line = RtuLine {
            devices,
            plant,
            heard: Vec::new(),
            streaming: None,
            unlocked: BTreeSet::new(),
            silent_turns: 0,
            zeros: 0,
        };
        Self::start(port, move |bytes| line.turn(bytes))
    }

    /// Serves an instrument whose stream runs as long as it is on.
    ///
    /// # Errors
    /// Where no thread can be had, or the profile has no stream.
    pub fn stream(port: Port, mut device: Device, plant: SharedPlant) -> io::Result<Self> {
        let stream = device.profile().description.stream.clone();
        let stream = stream.ok_or_else(|| io::Error::other("the profile has no stream"))?;
        let mut due = plant.now().1;
        Self::start(port, move |_| frames(&mut device, &stream, &plant, &mut due).concat())
    }
}

/// Frames of a stream that one turn may send: 9 ms of the fastest.
const FRAMES_A_TURN: u64 = 64;

/// Modbus exception of a request that is not allowed now.
const ILLEGAL_FUNCTION: u8 = 1;

/// Units on one line; a unit that streams has it to itself.
struct RtuLine {
    devices: BTreeMap<u8, Device>,
    plant: SharedPlant,
    heard: Vec<u8>,
    streaming: Option<(u8, Nanos)>,
    unlocked: BTreeSet<u8>,
    silent_turns: u32,
    zeros: u16,
}

impl RtuLine {
    fn turn(&mut self, bytes: &[u8]) -> Vec<u8> {
        if let Some((unit, due)) = self.streaming {
            return self.stream(unit, due, bytes);
        }
        self.heard.extend_from_slice(bytes);
        // A pause parts frames: what is incomplete after it is noise.
        self.silent_turns = if bytes.is_empty() { self.silent_turns + 1 } else { 0 };
        if self.silent_turns > 20 {
            self.heard.clear();
        }
        let functions = |device: &Device| {
            let d = &device.profile().description;
            let started = d.stream.as_ref().and_then(|stream| stream.start_function);
            started.into_iter().chain(d.init.iter().filter_map(|init| init.function)).collect::<Vec<_>>()
        };
        let own: Vec<u8> = self.devices.values().flat_map(functions).map(|(function, _)| function).collect();
        loop {
            match rtu::hear(&self.heard, &own) {
                Parsed::Incomplete => return Vec::new(),
                Parsed::Noise => {
                    self.heard.remove(0);
                }
                Parsed::Request(unit, operation, length) => {
                    self.heard.drain(..length);
                    return self.answer(unit, operation);
                }
            }
        }
    }

    fn answer(&mut self, unit: u8, operation: Operation) -> Vec<u8> {
        let Some(device) = self.devices.get_mut(&unit) else { return Vec::new() };
        let (mut plant, now) = self.plant.now();
        let stream = device.profile().description.stream.clone();
        // An instrument with functions of its own around its configuration is locked until the first of them.
        let key = device.profile().description.init.iter().find_map(|init| init.function);
        match operation {
            Operation::Read { function, address, count } => {
                let mut tables = [Table::Coil, Table::Discrete, Table::Holding].into_iter();
                let table = tables.find(|table| table.read_function() == function).unwrap_or(Table::Input);
                let read = device.read(table, address, count.min(125), &mut *plant, now);
                let refused = |why| rtu::refuse(unit, function, code(why));
                read.map_or_else(refused, |registers| rtu::give(unit, function, &registers))
            }
            Operation::Write { function, address, registers } => {
                let second =
                    if function == 6 { registers[0] } else { u16::try_from(registers.len()).unwrap_or(0) };
                let starts = stream
                    .and_then(|s| s.start_register)
                    .is_some_and(|s| registers == [s.1] && address == s.0);
                if starts {
                    self.streaming = Some((unit, now));
                    return rtu::confirm(unit, function, address, second);
                }
                if key.is_some() && !self.unlocked.contains(&unit) {
                    return rtu::refuse(unit, function, ILLEGAL_FUNCTION);
                }
                let table = if function == 15 { Table::Coil } else { Table::Holding };
                let written = device.write(table, address, &registers, &mut *plant);
                let refused = |why| rtu::refuse(unit, function, code(why));
                written.map_or_else(refused, |()| rtu::confirm(unit, function, address, second))
            }
            Operation::Custom { function, data } => {
                if stream.and_then(|s| s.start_function) == Some((function, data)) {
                    self.streaming = Some((unit, now));
                } else if key == Some((function, data)) {
                    self.unlocked.insert(unit);
                } else if key.is_some_and(|(own, _)| own == function) {
                    self.unlocked.remove(&unit);
                }
                rtu::acknowledge(unit, function, rtu::DONE)
            }
        }
    }

    /// A streaming unit sends frames and hears only the bytes that stop it.
    fn stream(&mut self, unit: u8, mut due: Nanos, bytes: &[u8]) -> Vec<u8> {
        let Some(device) = self.devices.get_mut(&unit) else { return Vec::new() };
        let Some(stream) = device.profile().description.stream.clone() else { return Vec::new() };
        let stop = stream.stop.map(|(stop, _)| stop);
        for &byte in bytes {
            self.zeros = if Some(byte) == stop { self.zeros + 1 } else { 0 };
        }
        if self.zeros >= 14 {
            (self.streaming, self.zeros) = (None, 0);
            self.heard.clear();
            return Vec::new();
        }
        let sent = frames(device, &stream, &self.plant, &mut due);
        self.streaming = Some((unit, due));
        sent.concat()
    }
}

/// The frames of a stream that are due; `due` goes on to the next one.
pub fn frames(device: &mut Device, stream: &Stream, plant: &SharedPlant, due: &mut Nanos) -> Vec<Vec<u8>> {
    let (mut plant, now) = plant.as_left();
    let Some(frame) = device.profile().frame("stream") else { return Vec::new() };
    let end = device.profile().description.link.rx_end().to_owned();
    let period = Nanos::from_seconds(1.0 / stream.rate_hz).0.max(1);
    // A thread that was held up for long leaves samples out, as the instrument's own buffer would.
    *due = Nanos(due.0 + (now.since(*due).0 / period).saturating_sub(FRAMES_A_TURN) * period);
    let mut sent = Vec::new();
    while *due <= now {
        plant.advance(*due);
        let mut bytes = device.frame(frame, &mut *plant, *due);
        match device.profile().frames()[frame.0].write_line(&bytes, 1.0) {
            Some(line) => sent.push([line, end.clone()].concat().into_bytes()),
            None => {
                close(stream, &mut bytes);
                sent.push(bytes);
            }
        }
        *due = Nanos(due.0 + period);
    }
    sent
}

/// Puts sync bytes and check into a stream's frame.
fn close(stream: &Stream, bytes: &mut [u8]) {
    bytes[..stream.sync.len()].copy_from_slice(&stream.sync);
    let Some(shape) = stream.shape() else { return };
    let body = bytes.len() - shape.check.length();
    let check = shape.check.of(&bytes[shape.check_from..body], shape.check_high_first);
    bytes[body..].copy_from_slice(&check);
}

const fn code(refused: Refused) -> u8 {
    match refused {
        Refused::Address => 2,
        Refused::Value => 3,
    }
}
