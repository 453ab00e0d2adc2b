//! The conversation with a CANopen drive in profile-velocity mode (CiA 301, CiA 402).
//!
//! Set-up goes by service data and is judged object by object; motion goes by process data. The
//! drive is enabled only while the loop's commands are fresh. A fault is reset when a person opens
//! the rig, never by itself.

use super::can;
use super::endpoint::{BadFrame, Due};
use super::session::{Ended, LONGEST_SLEEP, Periodic, Session};
use super::setup::InstrumentSetup;
use instruments::FrameId;
use instruments::bus::{CanEvent, CanPort};
use instruments::codec::can::CanFrame;
use instruments::codec::canopen::{self, DriveState, Nmt, SdoAnswer};
use instruments::profile::FrameKind;
use std::convert::Infallible;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// The low half of a device type that says CiA 402.
const PROFILE_402: u32 = 402;
/// Switched on, not enabled: the drive holds no set-point.
const NOT_ENABLED: u16 = 0x07;

/// Starts the thread of one drive.
///
/// # Errors
/// Where no thread can be had.
pub fn spawn(instrument: &InstrumentSetup, session: Session) -> Result<JoinHandle<()>, String> {
    let link = session.endpoint.profile().description.link.clone();
    let address = instrument.address.clone();
    let node = instrument.base.and_then(|base| u8::try_from(base).ok()).or(link.node).unwrap_or(1);
    session.spawn(move |session| {
        let port = can::open(&address, link.bitrate.unwrap_or(1_000_000))?;
        let health = session.endpoint.health();
        health.count(&health.connections);
        let limit_ms = link.response_timeout_ms;
        let mut master = Master { port, node, limit_ms, block: Vec::new() };
        master.set_up(session)?;
        master.go_on(session, Duration::from_millis(u64::from(link.heartbeat_ms.unwrap_or(300))))
    })
}

struct Master {
    port: Box<dyn CanPort>,
    node: u8,
    limit_ms: u32,
    block: Vec<u8>,
}

impl Master {
    fn send(&mut self, frame: &CanFrame) -> Result<(), Ended> {
        if self.port.send(frame)? {
            Ok(())
        } else {
            Err(Ended::Io("the bus takes no frames (nobody acknowledges?)".into()))
        }
    }

    fn sdo(&mut self, request: &CanFrame, index: u16, sub: u8) -> Result<SdoAnswer, Ended> {
        self.send(request)?;
        let deadline = Instant::now() + Duration::from_millis(u64::from(self.limit_ms));
        while let Some(event) = self.port.receive(deadline)? {
            match event {
                CanEvent::Frame(frame, _) => {
                    if let Some(answer) = canopen::sdo_answer(&frame, self.node, index, sub) {
                        return Ok(answer);
                    }
                }
                CanEvent::BusOff => return Err(Ended::Io("the controller left the bus (bus-off)".into())),
                CanEvent::Warning => {}
            }
            if Instant::now() >= deadline {
                break;
            }
        }
        Err(Ended::Timeout(self.limit_ms))
    }

    fn read(&mut self, index: u16, sub: u8) -> Result<u32, Ended> {
        match self.sdo(&canopen::sdo_read(self.node, index, sub), index, sub)? {
            SdoAnswer::Value(value) => Ok(value),
            other => Err(Ended::Refused(format!("object {index:#06x}:{sub} cannot be read: {other:x?}"))),
        }
    }

    fn write(&mut self, index: u16, sub: u8, bytes: u8, value: i64) -> Result<(), Ended> {
        match self.sdo(&canopen::sdo_write(self.node, index, sub, bytes, value), index, sub)? {
            SdoAnswer::Written => Ok(()),
            other => {
                Err(Ended::Refused(format!("object {index:#06x}:{sub} cannot be set to {value}: {other:x?}")))
            }
        }
    }

    fn set_up(&mut self, session: &mut Session) -> Result<(), Ended> {
        let kind = self.read(0x1000, 0)?;
        if kind & 0xFFFF != PROFILE_402 {
            let said = format!("node {} is no drive of CiA 402 (device type {kind:#010x})", self.node);
            return Err(Ended::Frame(BadFrame::WrongInstrument(said)));
        }
        let status = self.read(0x6041, 0)?;
        let faulted = u16::try_from(status & 0xFFFF).ok().and_then(DriveState::of) == Some(DriveState::Fault);
        if faulted && session.ready.is_some() {
            // A person has just opened the rig: this is the one place where a fault is reset.
            self.write(0x6040, 0, 2, 0)?;
            self.write(0x6040, 0, 2, 0x80)?;
        }
        for init in session.endpoint.profile().description.init.clone() {
            if let Some((index, sub, bytes, value)) = init.sdo {
                self.write(index, sub, bytes, value)?;
            }
        }
        let mode = self.read(0x6061, 0)?;
        if mode != 3 {
            return Err(Ended::Refused(format!("the drive shows mode {mode}, not 3 (profile velocity)")));
        }
        self.send(&canopen::nmt(Nmt::Start, self.node))
    }

    fn go_on(&mut self, session: &mut Session, heartbeat: Duration) -> Result<Infallible, Ended> {
        let profile = session.endpoint.profile();
        let broken = |what: &str| Ended::Io(format!("the profile has no {what}"));
        let frames = profile.frames().iter().enumerate();
        let (data, cob) = frames
            .filter_map(|(i, frame)| match &frame.kind {
                FrameKind::Messages(_, parts) => Some((FrameId(i), parts.first()?.0 + u32::from(self.node))),
                _ => None,
            })
            .next()
            .ok_or_else(|| broken("process data to read"))?;
        let status = profile.signal("statusword").ok_or_else(|| broken("signal `statusword`"))?;
        let block =
            profile.description.write.first().cloned().ok_or_else(|| broken("process data to write"))?;
        let out = block.cob.ok_or_else(|| broken("`cob` of its block"))? + u32::from(self.node);
        self.block = vec![0; 2 * usize::from(block.count)];
        let mut write = Periodic::new(block.rate_hz.unwrap_or(100.0), session.now());
        let mut alive = Instant::now();
        loop {
            if session.stopping() {
                self.halt(session, out)?;
                return Err(Ended::Stopped);
            }
            if alive.elapsed() > heartbeat {
                return Err(Ended::Io(format!("node {} gives no sign of life", self.node)));
            }
            let now = session.now();
            if write.is_due(now) {
                let due = session.endpoint.due(now);
                // Only the loop's own commands enable; the safe set-points do not.
                let safe = matches!(due, Due::Safe(_));
                if let Due::SetPoints(set_points) | Due::Safe(set_points) = due {
                    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 16 bits
                    let state = DriveState::of(session.endpoint.value(status) as u16);
                    let control = if safe {
                        NOT_ENABLED
                    } else {
                        state.and_then(DriveState::towards_enabled).unwrap_or(0)
                    };
                    for (set, value) in &set_points {
                        let _ = session.endpoint.profile().encode_set(*set, *value, &mut self.block);
                    }
                    self.block[..2].copy_from_slice(&control.to_le_bytes());
                    if let Some(frame) = CanFrame::new(out, &self.block) {
                        self.send(&frame)?;
                    }
                }
                write.advance(session.now());
            }
            let pause = Duration::from_nanos(write.due.since(session.now()).0).min(LONGEST_SLEEP);
            match self.port.receive(Instant::now() + pause)? {
                Some(CanEvent::Frame(frame, _)) if frame.id == cob => {
                    alive = Instant::now();
                    let arrived = session.now();
                    session.endpoint.frame(data, frame.data(), arrived)?;
                    session.tell(Ok(()));
                }
                Some(CanEvent::Frame(frame, _)) if frame.id == 0x700 + u32::from(self.node) => {
                    alive = Instant::now();
                    if frame.data() == [0] {
                        return Err(Ended::Io("the drive started anew".into()));
                    }
                }
                Some(CanEvent::Frame(frame, _)) if frame.id == 0x80 + u32::from(self.node) => {
                    let code = frame
                        .data()
                        .iter()
                        .take(2)
                        .rev()
                        .fold(0_u32, |sum, byte| sum << 8 | u32::from(*byte));
                    session.endpoint.alarm(&format!("emergency {code:#06x}"));
                }
                Some(CanEvent::BusOff) => {
                    return Err(Ended::Io(
                        "the controller left the bus (bus-off); restart it by hand".into(),
                    ));
                }
                _ => {}
            }
        }
    }

    fn halt(&mut self, session: &Session, out: u32) -> Result<(), Ended> {
        for (set, value) in session.endpoint.safe_set_points() {
            let _ = session.endpoint.profile().encode_set(set, value, &mut self.block);
        }
        self.block[..2].copy_from_slice(&NOT_ENABLED.to_le_bytes());
        if let Some(frame) = CanFrame::new(out, &self.block) {
            self.send(&frame)?;
        }
        Ok(())
    }
}
