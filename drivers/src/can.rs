//! The conversation in CAN messages, over the kernel's bus or a serial adapter.
//!
//! Several messages may make up one sample. Their common request ties them together: a new request drops what
//! an earlier one left. After a time without an answer the driver only listens before the next request, so
//! that a late half is never joined to a new one.

use super::connection::{Connection, LONGEST_SLEEP, Periodic, Spawned};
use super::link_error::LinkError;
use super::setup::InstrumentSetup;
use super::slcan::Slcan;
use super::socketcan::KernelCan;
use super::trace::TracedBus;
use instruments::profile::{FrameKind, Part};
use instruments::{CanEvent, CanFrame, CanPort, FrameId};
use realtime::Nanos;
use std::convert::Infallible;
use std::time::{Duration, Instant};

/// The message for a controller whose error counters are at 96, or at 128: then no node hears of a broken
/// frame any more, and the link ends.
pub(super) const WARNS: &str =
    "the CAN controller warns: its error counters are high; check cable and termination";
pub(super) const LEFT: &str = "the controller left the bus (bus-off); restart it by hand";
pub(super) const PASSIVE: &str = "the CAN controller is error passive; check cable, termination and bit rate";

/// Opens the bus at an address: an interface of the kernel's (`can0`), or `slcan:PATH`.
///
/// # Errors
/// Where there is none.
pub fn open(address: &str, bitrate: u32) -> Result<Box<dyn CanPort>, LinkError> {
    match address.strip_prefix("slcan:") {
        Some(path) => Ok(Box::new(Slcan::open(path, bitrate)?)),
        None => Ok(Box::new(TracedBus { inner: KernelCan::open(address)?, interface: address.into() })),
    }
}

/// Starts the thread of one instrument.
pub(crate) fn spawn(instrument: &InstrumentSetup, connection: Connection) -> Spawned {
    let link = connection.endpoint.profile().description.link.clone();
    let address = instrument.address.clone();
    let base = instrument.base.or(link.base).unwrap_or(0);
    let (bitrate, rate_hz) = (link.bitrate.unwrap_or(1_000_000), instrument.rate_hz);
    connection.spawn(move |connection| {
        let mut port = open(&address, bitrate)?;
        let health = connection.endpoint.health();
        health.count(&health.connections);
        for init in &connection.endpoint.profile().description.init {
            if let Some(frame) =
                init.can.as_ref().and_then(|(id, data)| CanFrame::build(*id, *id > 0x7FF, data))
            {
                port.send(&frame)?;
            }
        }
        converse(connection, port.as_mut(), base, rate_hz)
    })
}

/// One group of messages, on its way to a sample.
struct Group {
    frame: FrameId,
    parts: Vec<Part>,
    base: u32,
    request: Option<(CanFrame, Periodic)>,
    bytes: Vec<u8>,
    next: usize,
    requested_at: Option<Instant>,
}

fn groups(connection: &Connection, base: u32, rate_hz: Option<f64>) -> Vec<Group> {
    let profile = connection.endpoint.profile();
    let now = connection.now();
    let frames = profile.frames().iter().enumerate();
    let group = |(i, frame): (usize, &instruments::profile::Frame)| {
        let FrameKind::Messages(index, parts) = &frame.kind else { return None };
        let message = &profile.description.message[*index];
        let extended = base > 0x7FF || parts.iter().any(|part| part.extended);
        let request = message.request.as_ref().and_then(|data| CanFrame::build(base, extended, data));
        let periodic = Periodic::new(rate_hz.unwrap_or(message.rate_hz), now);
        Some(Group {
            frame: FrameId(i),
            parts: parts.clone(),
            base,
            request: request.map(|request| (request, periodic)),
            bytes: Vec::new(),
            next: 0,
            requested_at: None,
        })
    };
    frames.filter_map(group).collect()
}

fn converse(
    connection: &mut Connection,
    port: &mut dyn CanPort,
    base: u32,
    rate_hz: Option<f64>,
) -> Result<Infallible, LinkError> {
    let limit_ms = connection.endpoint.profile().description.link.response_timeout_ms;
    let limit = Duration::from_millis(u64::from(limit_ms));
    let mut groups = groups(connection, base, rate_hz);
    // Late answers to an earlier connection are discarded.
    let quiet = Instant::now() + limit;
    while port.receive(quiet)?.is_some() && Instant::now() < quiet {}
    let mut heard = Instant::now();
    loop {
        if connection.stopping() {
            return Err(LinkError::Stopped);
        }
        let now = connection.now();
        for group in &mut groups {
            let waiting = group.requested_at.is_some();
            if let Some((request, periodic)) =
                group.request.as_mut().filter(|(_, periodic)| !waiting && periodic.is_due(now))
            {
                (group.next, group.bytes) = (0, Vec::new());
                if port.send(request)? {
                    group.requested_at = Some(Instant::now());
                }
                periodic.advance(now);
            }
            if group.requested_at.is_some_and(|since| since.elapsed() > limit) {
                return Err(LinkError::Timeout(limit_ms));
            }
        }
        let silence = limit.max(LONGEST_SLEEP) * 5;
        if heard.elapsed() > silence {
            return Err(LinkError::Timeout(u32::try_from(silence.as_millis()).unwrap_or(u32::MAX)));
        }
        let open = groups.iter().filter(|group| group.requested_at.is_none());
        let next = open.filter_map(|group| group.request.as_ref()).map(|(_, periodic)| periodic.due).min();
        let pause = next.map_or(LONGEST_SLEEP, |due| {
            Duration::from_nanos(due.since(connection.now()).0).min(LONGEST_SLEEP)
        });
        match port.receive(Instant::now() + pause)? {
            None | Some(CanEvent::Other) => {}
            Some(CanEvent::BusOff) => return Err(LinkError::Io(LEFT.into())),
            Some(CanEvent::Passive) => return Err(LinkError::Io(PASSIVE.into())),
            Some(CanEvent::Warning) => connection.endpoint.health().problem(WARNS),
            Some(CanEvent::Frame(frame, ago)) => {
                let ago = Nanos(u64::try_from(ago.as_nanos()).unwrap_or(0));
                let arrived = connection.now().since(ago);
                for group in &mut groups {
                    if group.take(&frame) {
                        heard = Instant::now();
                        group.requested_at = None;
                        let bytes = std::mem::take(&mut group.bytes);
                        group.next = 0;
                        connection.endpoint.frame(group.frame, &bytes, arrived)?;
                        connection.tell(Ok(()));
                    }
                }
            }
        }
    }
}

impl Group {
    /// Takes a frame if it is the next of the sample; says whether the sample is whole.
    fn take(&mut self, frame: &CanFrame) -> bool {
        // An answer without a request, or to one too long ago, is dropped.
        if self.request.is_some() && self.requested_at.is_none() {
            return false;
        }
        let Some(place) = (self.parts.iter())
            .position(|part| part.at(self.base) == (frame.id, frame.extended) && part.selects(frame.data()))
        else {
            return false;
        };
        if place != self.next {
            // A part came out of order: the sample cannot be trusted.
            (self.next, self.bytes) = (0, Vec::new());
            if place != 0 {
                return false;
            }
        }
        self.bytes.extend_from_slice(frame.data());
        self.next += 1;
        self.next == self.parts.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::endpoint::Endpoint;
    use crate::link_error::Closed;
    use crate::setup::AxisSetup;
    use realtime::ports::{ForceSensor, NoData};
    use std::collections::VecDeque;
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::sync::{Arc, Mutex};
    use std::thread::JoinHandle;

    #[test]
    fn an_identifier_of_29_bits_is_not_the_one_of_11() {
        let axis = |signal: &str| Some(AxisSetup { signal: signal.into(), gain: 1.0, offset_n: 0.0 });
        let setup = InstrumentSetup { normal: axis("fz"), ..InstrumentSetup::new("ati-netft-can", "none") };
        let (endpoint, _port) = Endpoint::force(setup.description().unwrap(), &setup).unwrap();
        let (ready, _opened) = std::sync::mpsc::sync_channel(1);
        let connection = Connection::new(endpoint, Instant::now(), Arc::default(), ready);
        let mut group = groups(&connection, 432, None).remove(0);
        group.requested_at = Some(Instant::now());
        group.take(&CanFrame::build(HALVES[0], true, &[9; 8]).unwrap());
        assert!(group.bytes.is_empty(), "another instrument's");
        group.take(&CanFrame::build(HALVES[0], false, &[7; 8]).unwrap());
        assert_eq!(group.bytes, [7; 8]);
    }

    /// What happens on a bus, shared with its test.
    #[derive(Clone)]
    struct Bus {
        /// The sensor answers.
        answers: Arc<AtomicBool>,
        /// Reported once, before any frame.
        event: Arc<Mutex<Option<CanEvent>>>,
        waiting: VecDeque<CanFrame>,
        read: u32,
        sample: u16,
    }

    /// Identifiers of the two halves of a sample.
    const HALVES: [u32; 2] = [437, 438];

    impl CanPort for Bus {
        fn send(&mut self, _: &CanFrame) -> std::io::Result<bool> {
            if self.answers.load(Ordering::Relaxed) {
                self.sample = self.sample.wrapping_add(1);
                let [low, high] = self.sample.to_le_bytes();
                self.waiting.extend(CanFrame::new(HALVES[0], &[0; 8]));
                self.waiting.extend(CanFrame::new(HALVES[1], &[0x56, 2, 0, 0, 0, 0, low, high]));
            }
            Ok(true)
        }

        /// A bus that is full: something is there at every look. Of nine frames one is the sensor's; the
        /// others are unknown, of the sensor's identifiers with a wrong length, or no frame at all.
        fn receive(&mut self, _: Instant) -> std::io::Result<Option<CanEvent>> {
            if let Some(event) = self.event.lock().unwrap().take() {
                return Ok(Some(event));
            }
            self.read += 1;
            let frame = match self.read % 9 {
                0 => match self.waiting.pop_front() {
                    Some(frame) => Some(frame),
                    None => CanFrame::new(0x7FF, &[0xFF; 8]),
                },
                1 | 2 => CanFrame::new(HALVES[1], &[1, 2, 3]),
                3 => return Ok(Some(CanEvent::Other)),
                4 => CanFrame::build(0x1234_5678, true, &[]),
                n => CanFrame::new(n, &[0; 8]),
            };
            // A frame of 8 bytes takes 222 us at 500 kbit/s.
            std::thread::sleep(Duration::from_micros(20));
            Ok(frame.map(|frame| CanEvent::Frame(frame, Duration::ZERO)))
        }
    }

    /// A sensor on a full bus behind a link of its own; the bus, the port, the health, and what ends the link.
    struct Link {
        bus: Bus,
        port: Box<dyn ForceSensor>,
        health: Arc<crate::health::Health>,
        ended: Arc<Mutex<Vec<String>>>,
        stop: Arc<AtomicBool>,
        epoch: Instant,
        thread: Option<JoinHandle<Closed>>,
    }

    impl Link {
        fn start() -> Self {
            let axis = |signal: &str| Some(AxisSetup { signal: signal.into(), gain: 1.0, offset_n: 0.0 });
            let setup = InstrumentSetup {
                lateral: axis("fx"),
                normal: axis("fz"),
                ..InstrumentSetup::new("ati-netft-can", "none")
            };
            // A machine that others use holds a thread up for longer than this sensor may be silent.
            let text = crate::bundled::text(&setup.profile).unwrap();
            let patient = text.replace("response_timeout_ms = 20\n", "response_timeout_ms = 3000\n");
            assert_ne!(patient, text);
            let file = |name: &str| crate::bundled::file(name).map(String::from);
            let profile = instruments::profile::Profile::parse_with(&patient, &file).unwrap();
            let (endpoint, port) = Endpoint::force(profile, &setup).unwrap();
            let (health, epoch) = (endpoint.health(), Instant::now());
            let (ready, opened) = std::sync::mpsc::sync_channel(1);
            let stop = Arc::new(AtomicBool::new(false));
            let connection = Connection::new(endpoint, epoch, Arc::clone(&stop), ready);
            assert_eq!(
                groups(&connection, 432, None)[0].parts.iter().map(|p| p.at(432).0).collect::<Vec<_>>(),
                HALVES
            );
            let bus = Bus {
                answers: Arc::new(AtomicBool::new(true)),
                event: Arc::default(),
                waiting: VecDeque::new(),
                read: 0,
                sample: 0,
            };
            let ended = Arc::new(Mutex::new(Vec::new()));
            let (mut shared, ends) = (bus.clone(), Arc::clone(&ended));
            let thread = connection.spawn(move |connection| {
                let over = converse(connection, &mut shared, 432, None);
                ends.lock().unwrap().extend(over.as_ref().err().map(ToString::to_string));
                over
            });
            opened.recv().unwrap().unwrap();
            let port = crate::ports::compose(vec![port]).unwrap();
            Link { bus, port, health, ended, stop, epoch, thread: thread.ok() }
        }

        fn until(&mut self, what: &str, mut is: impl FnMut(&mut Self) -> bool) {
            let began = Instant::now();
            while !is(self) {
                assert!(
                    began.elapsed() < Duration::from_secs(120),
                    "{what}: {:?}",
                    self.ended.lock().unwrap()
                );
                std::thread::sleep(Duration::from_millis(1));
            }
        }

        fn normal(&mut self) -> Result<f64, NoData> {
            let now = Nanos(self.epoch.elapsed().as_nanos() as u64);
            self.port.read(now).normal.map(|reading| reading.value)
        }
    }

    impl Drop for Link {
        fn drop(&mut self) {
            self.stop.store(true, Ordering::Release);
            let _ = self.thread.take().map(JoinHandle::join);
        }
    }

    #[test]
    fn a_full_bus_neither_hides_the_sensor_nor_its_silence() {
        let mut link = Link::start();
        link.until("samples", |link| link.health.report().samples > 100);
        assert!((link.normal().unwrap() - 0.299).abs() < 1e-9, "{:?}", link.normal());
        assert!(link.ended.lock().unwrap().is_empty());
        // Silent in the midst of the others' frames: reported as silent, without a wait.
        link.bus.answers.store(false, Ordering::Relaxed);
        let silent_from = Instant::now();
        link.until("its end", |link| link.ended.lock().unwrap().iter().any(|why| why.contains("no answer")));
        assert!(silent_from.elapsed() < Duration::from_secs(120), "{:?}", silent_from.elapsed());
        link.until("its report", |link| link.normal() == Err(NoData::Disconnected));
    }

    #[test]
    fn a_controller_that_warns_is_noted_and_a_passive_one_ends_the_link() {
        let mut link = Link::start();
        *link.bus.event.lock().unwrap() = Some(CanEvent::Warning);
        link.until("noted", |link| link.health.report().last_problem == WARNS);
        let samples = link.health.report().samples;
        link.until("goes on", |link| link.health.report().samples > samples + 20);
        assert!(link.ended.lock().unwrap().is_empty() && link.normal().is_ok());

        *link.bus.event.lock().unwrap() = Some(CanEvent::Passive);
        link.until("its end", |link| link.ended.lock().unwrap().iter().any(|why| why == PASSIVE));
    }
}
