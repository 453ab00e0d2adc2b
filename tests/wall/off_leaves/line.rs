//! A line between a driver and an instrument on which something goes wrong at a chosen time.

use instruments::codec::modbus_rtu;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serialport::{SerialPort, TTYPort};
use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// What goes wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// Every answer comes so much later.
    Late(Duration),
    /// Every answer is other bytes.
    Garbage,
    /// Set-points are refused: in registers the blocks, and the amplitude (a stage: the load) by itself; in
    /// lines see `Trouble::refused_line`.
    Refused,
    /// What is sent comes back, and no answer.
    Echo,
    /// Connections are closed, and new ones as well.
    Cut,
    /// The instrument stands still: what is sent to it waits.
    Stopped,
    /// Nothing passes any more in either direction, and nobody is told.
    HalfOpen,
}

/// What goes wrong, and when.
#[derive(Clone, Copy, Debug)]
pub struct Fault {
    pub kind: Kind,
    pub from: Instant,
    pub until: Instant,
}

/// The fault that a line has, now or later.
#[derive(Clone)]
pub struct Trouble {
    fault: Arc<Mutex<Option<Fault>>>,
    stop: Arc<AtomicBool>,
    /// Register whose write is refused by itself.
    refused: u16,
    /// Lines that could have been refused so far, and whether an error waits to be asked for.
    refusals: Arc<AtomicU32>,
    error: Arc<AtomicBool>,
    seed: u64,
}

impl Trouble {
    pub fn new(refused: u16, seed: u64) -> Self {
        Self {
            fault: Arc::default(),
            stop: Arc::default(),
            refused,
            refusals: Arc::default(),
            error: Arc::default(),
            seed,
        }
    }

    pub fn strike(&self, fault: Fault) {
        *self.fault.lock().unwrap() = Some(fault);
    }

    pub fn end(&self) {
        self.stop.store(true, Ordering::Release);
    }

    fn now(&self) -> Option<Kind> {
        let now = Instant::now();
        self.fault.lock().unwrap().filter(|f| (f.from..f.until).contains(&now)).map(|f| f.kind)
    }

    fn over(&self) -> bool {
        self.stop.load(Ordering::Acquire)
    }

    /// What an instrument that refuses passes on of these bytes, and what it answers itself.
    fn refuse(&self, asked: &[u8]) -> (Vec<u8>, Vec<u8>) {
        let word = |at: usize| Some(u16::from_be_bytes([*asked.get(at)?, *asked.get(at + 1)?]));
        let refuses = |address: Option<u16>, count: Option<u16>| {
            count.is_some_and(|count| count >= 4) || address == Some(self.refused)
        };
        if asked.starts_with(b"setVOLT") {
            return (Vec::new(), b"ERR\r".to_vec());
        }
        if asked.get(2..4) == Some(&[0, 0]) && asked.get(7) == Some(&16) {
            let refused = refuses(word(8), word(10));
            let answer = refused.then(|| [&asked[..5], &[3, asked[6], 0x90, 3]].concat());
            return answer.map_or((asked.to_vec(), Vec::new()), |answer| (Vec::new(), answer));
        }
        if asked.get(1) == Some(&16) && refuses(word(2), word(4)) {
            return (Vec::new(), modbus_rtu::refuse(asked[0], 16, 3));
        }
        let (mut pass, mut back) = (Vec::new(), Vec::new());
        for line in asked.split_inclusive(|byte| matches!(byte, b'\n' | b'\r')) {
            match self.refused_line(line) {
                Some(answer) => back.extend(answer),
                None => pass.extend_from_slice(line),
            }
        }
        (pass, back)
    }

    /// SCPI: every other switch is not taken, and the next question for errors is answered with one. slcan:
    /// service data are aborted, and every other frame of process data is ignored.
    fn refused_line(&self, line: &[u8]) -> Option<Vec<u8>> {
        let another = || self.refusals.fetch_add(1, Ordering::AcqRel).is_multiple_of(2);
        if line.starts_with(b"OUTP1 0") && another() {
            self.error.store(true, Ordering::Release);
            return Some(Vec::new());
        }
        if line.starts_with(b"SYST:ERR?") && self.error.swap(false, Ordering::AcqRel) {
            return Some(b"-221,\"Settings conflict\"\n".to_vec());
        }
        let identifier = line.strip_prefix(b"t").and_then(|rest| rest.get(..3))?;
        match identifier[0] {
            // A write (command byte 0x2.) of service data: aborted as not possible in the present state.
            b'6' if line.get(5) == Some(&b'2') => {
                let node = std::str::from_utf8(&identifier[1..]).ok()?;
                let object = std::str::from_utf8(line.get(7..13)?).ok()?;
                Some(
                    format!("t5{:02X}880{object}22000008\r", u8::from_str_radix(node, 16).ok()? | 0x80)
                        .into_bytes(),
                )
            }
            b'2' if another() => Some(Vec::new()),
            _ => None,
        }
    }
}

fn came(read: std::io::Result<usize>) -> Option<usize> {
    match read {
        Ok(0) => None,
        Ok(count) => Some(count),
        Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => Some(0),
        Err(_) => None,
    }
}

/// From the driver to the instrument.
fn up(trouble: &Trouble, from: &mut dyn Read, to: &mut dyn Write, back: &mut dyn Write, alive: &AtomicBool) {
    let mut buffer = [0; 4096];
    let mut held: Vec<u8> = Vec::new();
    while !trouble.over() && alive.load(Ordering::Acquire) {
        let Some(count) = came(from.read(&mut buffer)) else { break };
        let asked = &buffer[..count];
        match trouble.now() {
            Some(Kind::Stopped) => held.extend_from_slice(asked),
            Some(Kind::HalfOpen) => {}
            Some(Kind::Cut) => break,
            kind => {
                let _ = to.write_all(&std::mem::take(&mut held));
                if asked.is_empty() {
                    continue;
                }
                if kind == Some(Kind::Echo) {
                    let _ = back.write_all(asked);
                }
                let (pass, answer) = match kind {
                    Some(Kind::Refused) => trouble.refuse(asked),
                    _ => (asked.to_vec(), Vec::new()),
                };
                let _ = back.write_all(&answer);
                let _ = to.write_all(&pass);
            }
        }
    }
    alive.store(false, Ordering::Release);
}

/// From the instrument to the driver.
fn down(trouble: &Trouble, from: &mut dyn Read, to: &mut dyn Write, alive: &AtomicBool) {
    let mut buffer = [0; 4096];
    let mut random = ChaCha8Rng::seed_from_u64(trouble.seed);
    while !trouble.over() && alive.load(Ordering::Acquire) {
        let Some(count) = came(from.read(&mut buffer)) else { break };
        let answer = &mut buffer[..count];
        match trouble.now().filter(|_| count > 0) {
            Some(Kind::Late(by)) => std::thread::sleep(by),
            Some(Kind::Garbage) => random.fill_bytes(answer),
            Some(Kind::Echo | Kind::HalfOpen | Kind::Stopped) => continue,
            Some(Kind::Cut) => break,
            Some(Kind::Refused) | None => {}
        }
        if to.write_all(answer).is_err() {
            break;
        }
    }
    alive.store(false, Ordering::Release);
}

/// Stands before a TCP server; returns where.
pub fn before_tcp(server: SocketAddr, trouble: &Trouble) -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    listener.set_nonblocking(true).unwrap();
    let trouble = trouble.clone();
    std::thread::spawn(move || {
        while !trouble.over() {
            match listener.accept() {
                Ok((client, _)) if trouble.now() != Some(Kind::Cut) => connect(client, server, &trouble),
                Ok(_) => {}
                Err(_) => std::thread::sleep(Duration::from_millis(1)),
            }
        }
    });
    address
}

fn connect(client: TcpStream, server: SocketAddr, trouble: &Trouble) {
    let Ok(instrument) = TcpStream::connect(server) else { return };
    for stream in [&client, &instrument] {
        stream.set_nonblocking(false).unwrap();
        stream.set_nodelay(true).unwrap();
        stream.set_read_timeout(Some(Duration::from_millis(1))).unwrap();
    }
    let alive = Arc::new(AtomicBool::new(true));
    let both = [trouble.clone(), trouble.clone()];
    let [mut c, mut c2, mut c3] = [0; 3].map(|_| client.try_clone().unwrap());
    let [mut i, mut i2] = [0; 2].map(|_| instrument.try_clone().unwrap());
    let [here, there] = [Arc::clone(&alive), alive];
    let [trouble, other] = both;
    std::thread::spawn(move || {
        up(&trouble, &mut c, &mut i, &mut c2, &here);
        let _ = c.shutdown(std::net::Shutdown::Both);
    });
    std::thread::spawn(move || {
        down(&other, &mut i2, &mut c3, &there);
        let _ = i2.shutdown(std::net::Shutdown::Both);
        let _ = c3.shutdown(std::net::Shutdown::Both);
    });
}

/// Stands before an instrument on a serial line; returns the path of the driver's end.
pub fn before_line(path: &str, trouble: &Trouble) -> String {
    let (driver, slave) = TTYPort::pair().unwrap();
    let name = slave.name().unwrap();
    let mut driver: Box<dyn SerialPort> = Box::new(driver);
    let mut instrument = serialport::new(path, 115_200).open().unwrap();
    for port in [&mut driver, &mut instrument] {
        port.set_timeout(Duration::from_millis(1)).unwrap();
    }
    let alive = Arc::new(AtomicBool::new(true));
    let mut ends = [0; 3].map(|_| driver.try_clone().unwrap());
    let mut instrument_too = instrument.try_clone().unwrap();
    let (here, there) = (Arc::clone(&alive), alive);
    let (trouble, other) = (trouble.clone(), trouble.clone());
    std::thread::spawn(move || {
        // The driver's end is kept open while nobody holds it.
        let _kept = slave;
        let [from, back, _] = &mut ends;
        up(&trouble, from, &mut instrument, back, &here);
    });
    std::thread::spawn(move || down(&other, &mut instrument_too, &mut driver, &there));
    name
}
