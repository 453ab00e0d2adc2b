//! Emulated instruments that speak in lines of text and blocks of bytes.
//!
//! Everything comes from the profile: its queries, its set-points with their answers, its set-up. A
//! line that it does not know is an error, in the way of the instrument: a line that says so, or an
//! entry of the error queue.

use super::device::Device;
use super::serial::{Port, SerialEmulator};
use super::{Command, Plant, Service, SharedPlant};
use instruments::codec::pattern::Pattern;
use instruments::{FrameId, FrameKind, SetId};
use realtime::Nanos;
use std::io::{self, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// More clients than this are turned away.
const MOST_CLIENTS: usize = 8;
/// A longer line is thrown away.
const LONGEST_LINE: usize = 256;

/// An instrument that speaks in lines.
pub struct LineInstrument {
    device: Device,
    plant: SharedPlant,
    error: bool,
    /// Heartbeats of the world that the profile knows none of.
    feeds: Vec<Command>,
}

impl LineInstrument {
    /// By its profile.
    pub fn new(device: Device, plant: SharedPlant) -> Self {
        let commands = &device.profile().description.emulator.command;
        let has = |command: Command| commands.values().any(|name| name == command.name());
        let watched =
            [(Command::Enable, Command::DriveHeartbeat), (Command::Velocity, Command::StageHeartbeat)];
        let feeds = watched.into_iter().filter(|(drives, beat)| has(*drives) && !has(*beat));
        let feeds = feeds.map(|(_, beat)| beat).collect();
        Self { device, plant, error: false, feeds }
    }

    /// An amplifier or a stage without a heartbeat has no watchdog: the emulator feeds the world's for it.
    pub fn live(&mut self) {
        for beat in &self.feeds {
            let (mut plant, now) = self.plant.now();
            // only change counts
            plant.command(&[(*beat, (now.0 / 1_000_000 % 65_536) as f64)]);
        }
    }

    /// A line as it is sent; nothing where there is none.
    fn line(&self, line: Option<String>) -> Vec<u8> {
        let end = self.device.profile().description.link.rx_end();
        line.map_or_else(Vec::new, |line| (line + end).into_bytes())
    }

    /// The answer to one line; empty where there is none.
    pub fn answer(&mut self, line: &str) -> Vec<u8> {
        let plant = self.plant.clone();
        let (mut plant, now) = plant.now();
        self.say(line.trim(), &mut *plant, now)
    }

    fn say(&mut self, line: &str, plant: &mut dyn Plant, now: Nanos) -> Vec<u8> {
        let description = &self.device.profile().description;
        if line.is_empty() {
            return Vec::new();
        }
        if let Some(query) = description.link.error_query.as_ref().filter(|query| query.send == line) {
            let ok = query.ok.first().cloned().unwrap_or_default();
            let status =
                if self.error { "-113,\"Undefined header\"".into() } else { format!("{ok}\"No error\"") };
            self.error = false;
            return self.line(Some(status));
        }
        if let Some(init) = description.init.iter().find(|init| init.send.as_deref() == Some(line)) {
            return self.line(init.expect.as_ref().and_then(|all| all.first()).cloned());
        }
        if let Some(choice) = &description.link.choice
            && let Some(which) = number_in(&choice.ask, line)
        {
            return self.line(description.emulator.names.get(which).cloned());
        }
        if let Some((frame, index, which)) = self.query(line) {
            let query = &description.query[index];
            // A wrong unit answers as plausibly as the right one.
            let tenfold = if query.name.as_ref() == "range" { 10f64.powi(which as i32) } else { 1.0 };
            if description.link.choice.is_some() && which >= description.emulator.names.len() {
                return Vec::new();
            }
            let bytes = self.device.frame(frame, plant, now);
            let line = self.device.profile().frames()[frame.0].write_line(&bytes, tenfold);
            return if line.is_some() { self.line(line) } else { bytes };
        }
        match self.set(line) {
            Some((heard, answer)) => {
                for (set, value) in heard {
                    self.error |= self.device.set(set, value, plant).is_err();
                }
                self.line(answer)
            }
            None => {
                self.error = true;
                let unknown = self.device.profile().description.link.unsolicited.last().cloned();
                let zeros =
                    |alarm: String| Pattern::parse(&alarm).map_or(alarm, |pattern| pattern.write(&[], 0));
                self.line(unknown.map(zeros))
            }
        }
    }

    /// The question that a line puts: its frame, its place in the profile, and the number of the unit that it is put to.
    fn query(&self, line: &str) -> Option<(FrameId, usize, usize)> {
        let profile = self.device.profile();
        profile.frames().iter().enumerate().find_map(|(i, frame)| match frame.kind {
            FrameKind::Query(index) => number_in(&profile.description.query[index].send, line)
                .map(|which| (FrameId(i), index, which)),
            _ => None,
        })
    }

    /// The set-points that a line carries, their values as the instrument takes them, and the answer.
    fn set(&self, line: &str) -> Option<(Vec<(SetId, f64)>, Option<String>)> {
        let profile = self.device.profile();
        for (index, set) in profile.description.set.iter().enumerate() {
            let own = SetId(index);
            if set.send_zero.as_deref() == Some(line) {
                return Some((vec![(own, 0.0)], set.answer.as_ref().map(|(_, zero)| zero.clone())));
            }
            let Some(mut heard) = profile.heard(own, line) else { continue };
            // An instrument clips to what it can do, and answers what it took.
            for (set, value) in &mut heard {
                let (low, high) = profile.description.set[set.0].range.unwrap_or((f64::MIN, f64::MAX));
                *value = value.clamp(low, high);
            }
            let value = heard.iter().find(|(set, _)| *set == own).map_or(1.0, |(_, value)| *value);
            let text = if set.scale.fract() == 0.0 { format!("{value:.0}") } else { format!("{value}") };
            return Some((heard, set.answer.as_ref().map(|(answer, _)| answer.replace("{}", &text))));
        }
        None
    }
}

/// The number that a line has where the question has `{which}`; 0 for a question without one that is this line.
fn number_in(question: &str, line: &str) -> Option<usize> {
    match question.split_once("{which}") {
        None => (question == line).then_some(0),
        Some((before, after)) => line.strip_prefix(before)?.strip_suffix(after)?.parse().ok(),
    }
}

/// Cuts bytes into lines at either line end.
#[derive(Default)]
struct Lines(Vec<u8>);

impl Lines {
    fn push(&mut self, bytes: &[u8], mut whole: impl FnMut(&str)) {
        for &byte in bytes {
            if byte == b'\r' || byte == b'\n' {
                whole(&String::from_utf8_lossy(&self.0));
                self.0.clear();
            } else if self.0.len() < LONGEST_LINE {
                self.0.push(byte);
            }
        }
    }
}

impl SerialEmulator {
    /// Serves an instrument of lines on a serial line. What `alarm` gives is sent unasked.
    ///
    /// # Errors
    /// Where no thread can be had.
    pub fn lines(
        port: Port,
        mut instrument: LineInstrument,
        mut alarm: impl FnMut() -> Option<String> + Send + 'static,
    ) -> io::Result<Self> {
        let mut lines = Lines::default();
        Self::start(port, move |bytes| {
            let mut out = instrument.line(alarm());
            lines.push(bytes, |line| out.extend(instrument.answer(line)));
            instrument.live();
            out
        })
    }
}

/// An instrument of lines behind TCP; dropping it stops it.
pub struct TcpLines {
    address: SocketAddr,
    _thread: Service,
}

impl TcpLines {
    /// Serves an instrument at `address` (port 0 for any free one).
    ///
    /// # Errors
    /// Where the address cannot be bound.
    pub fn start(address: SocketAddr, instrument: LineInstrument) -> io::Result<Self> {
        let listener = TcpListener::bind(address)?;
        listener.set_nonblocking(true)?;
        let address = listener.local_addr()?;
        let instrument = Arc::new(Mutex::new(instrument));
        let clients = Arc::new(AtomicUsize::new(0));
        let turn = move |stopped: &Arc<AtomicBool>| {
            instrument.lock().unwrap_or_else(PoisonError::into_inner).live();
            match listener.accept() {
                Ok((stream, _)) if clients.load(Ordering::Relaxed) < MOST_CLIENTS => {
                    let (instrument, stopped) = (Arc::clone(&instrument), Arc::clone(stopped));
                    let clients = Arc::clone(&clients);
                    clients.fetch_add(1, Ordering::Relaxed);
                    std::thread::spawn(move || {
                        let _ = serve(stream, &instrument, &stopped);
                        clients.fetch_sub(1, Ordering::Relaxed);
                    });
                }
                Ok(_) => {}
                Err(_) => std::thread::sleep(Duration::from_millis(2)),
            }
        };
        Ok(Self { address, _thread: Service::start("lines", turn)? })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }
}

fn serve(mut stream: TcpStream, instrument: &Mutex<LineInstrument>, stopped: &AtomicBool) -> io::Result<()> {
    stream.set_nonblocking(false)?;
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(Duration::from_millis(20)))?;
    let (mut lines, mut buffer) = (Lines::default(), [0; 512]);
    while !stopped.load(Ordering::Acquire) {
        let count = match stream.read(&mut buffer) {
            Ok(0) => return Ok(()),
            Ok(count) => count,
            Err(error) if matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut) => {
                continue;
            }
            Err(error) => return Err(error),
        };
        let mut out = Vec::new();
        lines.push(&buffer[..count], |line| {
            out.extend(instrument.lock().unwrap_or_else(PoisonError::into_inner).answer(line));
        });
        stream.write_all(&out)?;
    }
    Ok(())
}
