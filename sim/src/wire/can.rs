//! Emulated instruments on a CAN bus: plain CAN, and a CANopen drive.

use super::device::Device;
use super::drive::Drive;
use super::serial::Port;
use super::{Service, SharedPlant};
use instruments::codec::can::{CanFrame, SlcanReader, slcan_line};
use instruments::profile::{FrameKind, Part};
use instruments::{CanEvent, CanPort, FrameId, LinkKind};
use realtime::Nanos;
use std::collections::VecDeque;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// The far side of a serial CAN adapter: the driver's end speaks to the adapter, this end is the bus.
pub struct EmulatedAdapter {
    port: Port,
    reader: SlcanReader,
    waiting: VecDeque<CanFrame>,
    damage: Arc<AtomicUsize>,
}

impl EmulatedAdapter {
    /// An adapter on a serial port.
    pub fn new(port: Port) -> Self {
        Self { port, reader: SlcanReader::default(), waiting: VecDeque::new(), damage: Arc::default() }
    }

    /// What is done to the next frame that is sent: 1 loses it, 2 sends it twice.
    pub fn damage(&self) -> Arc<AtomicUsize> {
        Arc::clone(&self.damage)
    }
}

impl CanPort for EmulatedAdapter {
    fn send(&mut self, frame: &CanFrame) -> io::Result<bool> {
        let line = slcan_line(frame);
        match self.damage.swap(0, Ordering::SeqCst) {
            1 => return Ok(true),
            2 => self.port.write_all(&line)?,
            _ => {}
        }
        self.port.write_all(&line)?;
        Ok(true)
    }

    fn receive(&mut self, deadline: Instant) -> io::Result<Option<CanEvent>> {
        loop {
            if let Some(frame) = self.waiting.pop_front() {
                return Ok(Some(CanEvent::Frame(frame, Duration::ZERO)));
            }
            let mut buffer = [0; 256];
            let left = deadline.saturating_duration_since(Instant::now()).max(Duration::from_micros(100));
            self.port.set_timeout(left)?;
            match self.port.read(&mut buffer) {
                Ok(count) => self.reader.push(&buffer[..count], |frame| self.waiting.push_back(frame)),
                Err(_) if Instant::now() >= deadline => return Ok(None),
                // Nobody holds the other end open just now.
                Err(_) => std::thread::sleep(Duration::from_micros(200)),
            }
        }
    }
}

/// One emulated instrument at its identifiers.
pub struct CanDevice {
    /// The instrument.
    pub device: Device,
    /// Identifier that its messages are counted from, or its node number.
    pub base: u32,
}

/// Emulated instruments on a bus; dropping it stops them.
pub struct CanEmulator {
    _thread: Service,
}

impl CanEmulator {
    /// Serves `devices` on a bus, on a thread of its own.
    ///
    /// # Errors
    /// Where no thread can be had.
    pub fn start(
        port: impl CanPort + 'static,
        devices: Vec<CanDevice>,
        plant: SharedPlant,
    ) -> io::Result<Self> {
        let instruments = devices.into_iter().map(Instrument::new).collect();
        let mut bus = Bus { port: Box::new(port), instruments, plant };
        let turn = move |_: &_| {
            if let Err(error) = bus.turn() {
                tracing::debug!(%error, "the emulated bus");
                std::thread::sleep(Duration::from_millis(5));
            }
        };
        Ok(Self { _thread: Service::start("can-emulator", turn)? })
    }
}

/// A group of messages, sent on request or by itself.
struct Group {
    frame: FrameId,
    parts: Vec<Part>,
    request: Option<Vec<u8>>,
    period: u64,
    due: Nanos,
}

enum Instrument {
    Plain { device: Box<Device>, base: u32, groups: Vec<Group> },
    Drive(Box<Drive>),
}

impl Instrument {
    fn new(can: CanDevice) -> Self {
        let CanDevice { device, base } = can;
        let profile = device.profile();
        if profile.description.link.kind == LinkKind::Canopen {
            return Self::Drive(Box::new(Drive::new(device, u8::try_from(base).unwrap_or(1))));
        }
        let mut groups = Vec::new();
        for (index, frame) in profile.frames().iter().enumerate() {
            let FrameKind::Messages(group, parts) = &frame.kind else { continue };
            let message = &profile.description.message[*group];
            let period = Nanos::from_seconds(1.0 / message.rate_hz).0.max(1);
            let (frame, parts, request) = (FrameId(index), parts.clone(), message.request.clone());
            groups.push(Group { frame, parts, request, period, due: Nanos(0) });
        }
        Self::Plain { device: Box::new(device), base, groups }
    }

    /// When the instrument has something to say by itself.
    fn due(&self) -> Option<Nanos> {
        match self {
            Self::Plain { groups, .. } => {
                groups.iter().filter(|group| group.request.is_none()).map(|group| group.due).min()
            }
            Self::Drive(drive) => drive.due(),
        }
    }
}

struct Bus {
    port: Box<dyn CanPort>,
    instruments: Vec<Instrument>,
    plant: SharedPlant,
}

/// The frames of one sample: the parts of its bytes.
fn split(base: u32, parts: &[Part], bytes: &[u8]) -> Vec<CanFrame> {
    let mut at = 0;
    let mut frames = Vec::with_capacity(parts.len());
    for part in parts {
        let (id, extended) = part.at(base);
        frames.extend(CanFrame::build(id, extended, &bytes[at..at + part.length]));
        at += part.length;
    }
    frames
}

impl Bus {
    /// Hears what comes and says what is due.
    fn turn(&mut self) -> io::Result<()> {
        let (now, epoch) = (self.plant.now().1, Instant::now());
        let next = self.instruments.iter().filter_map(Instrument::due).min();
        let pause = next.map_or(20_000_000, |due| due.since(now).0.min(20_000_000));
        let heard = self.port.receive(epoch + Duration::from_nanos(pause))?;
        let mut out = Vec::new();
        {
            let (mut plant, now) = self.plant.now();
            for instrument in &mut self.instruments {
                match instrument {
                    Instrument::Plain { device, base, groups } => {
                        let asks = |data: &[u8]| groups.iter().find(|g| g.request.as_deref() == Some(data));
                        if let Some(CanEvent::Frame(frame, _)) = heard
                            && frame.id == *base
                            && let Some(group) = asks(frame.data())
                        {
                            let bytes = device.frame(group.frame, &mut *plant, now);
                            out.extend(split(*base, &group.parts, &bytes));
                        }
                        for group in groups.iter_mut().filter(|g| g.request.is_none() && g.due <= now) {
                            let bytes = device.frame(group.frame, &mut *plant, now);
                            out.extend(split(*base, &group.parts, &bytes));
                            let missed = now.since(group.due).0 / group.period;
                            group.due = Nanos(group.due.0 + (missed + 1) * group.period);
                        }
                    }
                    Instrument::Drive(drive) => {
                        if let Some(CanEvent::Frame(frame, _)) = heard {
                            out.extend(drive.hear(&frame, &mut *plant, now));
                        }
                        out.extend(drive.say(&mut *plant, now));
                    }
                }
            }
        }
        for frame in out {
            // A full queue loses the frame, as on a real bus nobody would hear it.
            let _ = self.port.send(&frame)?;
        }
        Ok(())
    }
}
