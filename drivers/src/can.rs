//! The conversation in CAN messages, over the kernel's bus or a serial adapter.
//!
//! Several messages may make up one sample. They are tied together by the request that asked for
//! them: a new request throws away what an earlier one left, and after a time without an answer the
//! bus is listened to in silence before the next, so that a late half is never joined to a new one.

use super::off::Closed;
use super::session::{Ended, LONGEST_SLEEP, Periodic, Session};
use super::setup::InstrumentSetup;
use super::slcan::Slcan;
use super::socketcan::KernelCan;
use instruments::FrameId;
use instruments::bus::{CanEvent, CanPort};
use instruments::codec::can::CanFrame;
use instruments::profile::FrameKind;
use realtime::ports::Nanos;
use std::convert::Infallible;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Opens the bus at an address: an interface of the kernel's (`can0`), or `slcan:PATH`.
///
/// # Errors
/// Where there is none.
pub fn open(address: &str, bitrate: u32) -> Result<Box<dyn CanPort>, Ended> {
    match address.strip_prefix("slcan:") {
        Some(path) => Ok(Box::new(Slcan::open(path, bitrate)?)),
        None => Ok(Box::new(KernelCan::open(address)?)),
    }
}

/// Starts the thread of one instrument.
///
/// # Errors
/// Where no thread can be had.
pub fn spawn(instrument: &InstrumentSetup, session: Session) -> Result<JoinHandle<Closed>, String> {
    let link = session.endpoint.profile().description.link.clone();
    let address = instrument.address.clone();
    let base = instrument.base.or(link.base).unwrap_or(0);
    let (bitrate, rate_hz) = (link.bitrate.unwrap_or(1_000_000), instrument.rate_hz);
    session.spawn(move |session| {
        let mut port = open(&address, bitrate)?;
        let health = session.endpoint.health();
        health.count(&health.connections);
        for init in &session.endpoint.profile().description.init {
            if let Some(frame) =
                init.can.as_ref().and_then(|(id, data)| CanFrame::build(*id, *id > 0x7FF, data))
            {
                port.send(&frame)?;
            }
        }
        converse(session, port.as_mut(), base, rate_hz)
    })
}

/// One group of messages, on its way to a sample.
struct Group {
    frame: FrameId,
    parts: Vec<(u32, usize)>,
    request: Option<(CanFrame, Periodic)>,
    bytes: Vec<u8>,
    next: usize,
    asked_at: Option<Instant>,
}

fn groups(session: &Session, base: u32, rate_hz: Option<f64>) -> Vec<Group> {
    let profile = session.endpoint.profile();
    let now = session.now();
    let frames = profile.frames().iter().enumerate();
    let group = |(i, frame): (usize, &instruments::profile::Frame)| {
        let FrameKind::Messages(index, parts) = &frame.kind else { return None };
        let message = &profile.description.message[*index];
        let request = message.request.as_ref().and_then(|data| CanFrame::build(base, base > 0x7FF, data));
        let periodic = Periodic::new(rate_hz.unwrap_or(message.rate_hz), now);
        Some(Group {
            frame: FrameId(i),
            parts: parts.iter().map(|(id, length)| (base + id, *length)).collect(),
            request: request.map(|request| (request, periodic)),
            bytes: Vec::new(),
            next: 0,
            asked_at: None,
        })
    };
    frames.filter_map(group).collect()
}

fn converse(
    session: &mut Session,
    port: &mut dyn CanPort,
    base: u32,
    rate_hz: Option<f64>,
) -> Result<Infallible, Ended> {
    let limit_ms = session.endpoint.profile().description.link.response_timeout_ms;
    let limit = Duration::from_millis(u64::from(limit_ms));
    let mut groups = groups(session, base, rate_hz);
    // What an earlier connection was still owed comes now or never.
    let quiet = Instant::now() + limit;
    while port.receive(quiet)?.is_some() && Instant::now() < quiet {}
    let mut heard = Instant::now();
    loop {
        if session.stopping() {
            return Err(Ended::Stopped);
        }
        let now = session.now();
        for group in &mut groups {
            let waiting = group.asked_at.is_some();
            if let Some((request, periodic)) =
                group.request.as_mut().filter(|(_, periodic)| !waiting && periodic.is_due(now))
            {
                (group.next, group.bytes) = (0, Vec::new());
                if port.send(request)? {
                    group.asked_at = Some(Instant::now());
                }
                periodic.advance(now);
            }
            if group.asked_at.is_some_and(|asked| asked.elapsed() > limit) {
                return Err(Ended::Timeout(limit_ms));
            }
        }
        if heard.elapsed() > limit.max(LONGEST_SLEEP) * 5 {
            return Err(Ended::Timeout(5 * limit_ms));
        }
        let next = groups
            .iter()
            .filter_map(|g| g.request.as_ref().filter(|_| g.asked_at.is_none()).map(|(_, p)| p.due))
            .min();
        let pause = next
            .map_or(LONGEST_SLEEP, |due| Duration::from_nanos(due.since(session.now()).0).min(LONGEST_SLEEP));
        match port.receive(Instant::now() + pause)? {
            None => {}
            Some(CanEvent::BusOff) => {
                return Err(Ended::Io("the controller left the bus (bus-off); restart it by hand".into()));
            }
            Some(CanEvent::Warning) => {
                let health = session.endpoint.health();
                health.problem("the CAN controller warns: its error counters are high");
            }
            Some(CanEvent::Frame(frame, ago)) => {
                let ago = Nanos(u64::try_from(ago.as_nanos()).unwrap_or(0));
                let arrived = session.now().since(ago);
                for group in &mut groups {
                    if group.take(&frame) {
                        heard = Instant::now();
                        group.asked_at = None;
                        let bytes = std::mem::take(&mut group.bytes);
                        group.next = 0;
                        session.endpoint.frame(group.frame, &bytes, arrived)?;
                        session.tell(Ok(()));
                    }
                }
            }
        }
    }
}

impl Group {
    /// Takes a frame if it is the next of the sample; says whether the sample is whole.
    fn take(&mut self, frame: &CanFrame) -> bool {
        // An answer that nobody asked for, or asked for too long ago, is not taken.
        if self.request.is_some() && self.asked_at.is_none() {
            return false;
        }
        let Some(place) =
            self.parts.iter().position(|(id, length)| *id == frame.id && *length == frame.data().len())
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
