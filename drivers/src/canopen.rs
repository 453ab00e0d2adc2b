//! The conversation with a CANopen drive in profile-velocity mode (CiA 301, CiA 402).
//!
//! Set-up goes by service data and is judged object by object; motion goes by process data. The
//! drive is enabled only while the loop's commands are fresh. A fault is reset when a person opens
//! the rig, never by itself.

use super::can::{self, LEFT, PASSIVE, WARNS};
use super::connection::{Connection, LONGEST_SLEEP, Periodic, Spawned};
use super::endpoint::{BadFrame, Due};
use super::link_error::LinkError;
use super::off::{self, OFF_ANSWER_MS, OffWay};
use super::setup::InstrumentSetup;
use instruments::codec::canopen::{self, DriveState, SdoAnswer};
use instruments::{CanEvent, CanFrame, CanPort, FrameId, FrameKind, SetId, SignalId};
use std::convert::Infallible;
use std::time::{Duration, Instant};

/// The low half of a device type that says CiA 402.
const PROFILE_402: u32 = 402;
/// Switched on, not enabled: the drive holds no set-point.
const NOT_ENABLED: u16 = 0x07;

/// Starts the thread of one drive.
pub(crate) fn spawn(instrument: &InstrumentSetup, connection: Connection) -> Spawned {
    let link = connection.endpoint.profile().description.link.clone();
    let address = instrument.address.clone();
    let node = instrument.base.or(link.node.map(u32::from)).unwrap_or(1);
    let node = u8::try_from(node).ok().filter(|node| (1..=127).contains(node));
    let node = node.ok_or_else(|| LinkError::Io("CANopen has the nodes 1 to 127: correct `base`".into()))?;
    connection.spawn(move |connection| {
        let port = can::open(&address, link.bitrate.unwrap_or(1_000_000))?;
        let health = connection.endpoint.health();
        health.count(&health.connections);
        let map = Map::of(connection, node)
            .ok_or_else(|| LinkError::Io("the profile is no CiA 402 drive's".into()))?;
        let block = vec![0; map.length];
        let limit_ms = link.response_timeout_ms;
        let mut master = Master { port, node, limit_ms, map, block, tries: 0 };
        off::at_the_beginning(connection, &mut master)?;
        master.set_up(connection)?;
        master.go_on(connection, Duration::from_millis(u64::from(link.heartbeat_ms.unwrap_or(300))))
    })
}

/// Where a drive's process data are.
struct Map {
    /// The frame that the drive sends, and its identifier.
    data: FrameId,
    cob: u32,
    status: SignalId,
    /// The identifier of the frame that it takes, its length in bytes and how often it is sent.
    out: u32,
    length: usize,
    rate_hz: f64,
}

impl Map {
    /// `None` for a profile that would have been refused: one frame each way, with a status word.
    fn of(connection: &Connection, node: u8) -> Option<Self> {
        let profile = connection.endpoint.profile();
        let (data, status, block) =
            (FrameId(0), profile.signal("statusword")?, profile.description.write.first()?);
        let FrameKind::Messages(_, parts) = &profile.frames().first()?.kind else { return None };
        let [cob, out] = [parts.first()?.id, block.cob?].map(|cob| cob + u32::from(node));
        let (length, rate_hz) = (2 * usize::from(block.count), block.rate_hz.unwrap_or(100.0));
        Some(Self { data, cob, status, out, length, rate_hz })
    }
}

struct Master {
    port: Box<dyn CanPort>,
    node: u8,
    limit_ms: u32,
    map: Map,
    block: Vec<u8>,
    /// Times that 'off' was sent since the drive last showed it.
    tries: u32,
}

impl Master {
    fn send(&mut self, frame: &CanFrame) -> Result<(), LinkError> {
        if self.port.send(frame)? {
            Ok(())
        } else {
            Err(LinkError::Io("the bus takes no frames (nobody acknowledges?)".into()))
        }
    }

    /// The next event. A frame of 29 bits is none of CANopen's, whatever its number.
    fn receive(&mut self, deadline: Instant) -> Result<Option<CanEvent>, LinkError> {
        Ok(match self.port.receive(deadline)? {
            Some(CanEvent::Frame(frame, _)) if frame.extended => Some(CanEvent::Other),
            event => event,
        })
    }

    fn sdo(&mut self, request: &CanFrame, index: u16, sub: u8) -> Result<SdoAnswer, LinkError> {
        self.send(request)?;
        let deadline = Instant::now() + Duration::from_millis(u64::from(self.limit_ms));
        while let Some(event) = self.receive(deadline)? {
            match event {
                CanEvent::Frame(frame, _) => {
                    if let Some(answer) = canopen::sdo_answer(&frame, self.node, index, sub) {
                        return Ok(answer);
                    }
                }
                CanEvent::BusOff => {
                    return Err(LinkError::Io("the controller left the bus (bus-off)".into()));
                }
                CanEvent::Passive => return Err(LinkError::Io(PASSIVE.into())),
                CanEvent::Warning | CanEvent::Other => {}
            }
            if Instant::now() >= deadline {
                break;
            }
        }
        Err(LinkError::Timeout(self.limit_ms))
    }

    fn read(&mut self, index: u16, sub: u8) -> Result<u32, LinkError> {
        match self.sdo(&canopen::sdo_read(self.node, index, sub), index, sub)? {
            SdoAnswer::Value(value) => Ok(value),
            other => Err(LinkError::Refused(format!("object {index:#06x}:{sub} cannot be read: {other:x?}"))),
        }
    }

    fn write(&mut self, index: u16, sub: u8, bytes: u8, value: i64) -> Result<(), LinkError> {
        match self.sdo(&canopen::sdo_write(self.node, index, sub, bytes, value), index, sub)? {
            SdoAnswer::Written => Ok(()),
            other => Err(LinkError::Refused(format!(
                "object {index:#06x}:{sub} cannot be set to {value}: {other:x?}"
            ))),
        }
    }

    fn set_up(&mut self, connection: &mut Connection) -> Result<(), LinkError> {
        let kind = self.read(0x1000, 0)?;
        if kind & 0xFFFF != PROFILE_402 {
            let problem = format!("node {} is not a drive of CiA 402 (device type {kind:#010x})", self.node);
            return Err(LinkError::Frame(BadFrame::WrongInstrument(problem)));
        }
        let status = self.read(0x6041, 0)?;
        let faulted = u16::try_from(status & 0xFFFF).ok().and_then(DriveState::of) == Some(DriveState::Fault);
        if faulted && connection.is_first() {
            // A person has just opened the rig: this is the one place where a fault is reset.
            self.write(0x6040, 0, 2, 0)?;
            self.write(0x6040, 0, 2, 0x80)?;
        }
        for init in connection.endpoint.profile().description.init.clone() {
            if let Some((index, sub, bytes, value)) = init.sdo {
                self.write(index, sub, bytes, value)?;
            }
        }
        let mode = self.read(0x6061, 0)?;
        if mode != 3 {
            return Err(LinkError::Refused(format!("the drive shows mode {mode}, not 3 (profile velocity)")));
        }
        self.send(&canopen::start(self.node))
    }

    fn go_on(&mut self, connection: &mut Connection, heartbeat: Duration) -> Result<Infallible, LinkError> {
        let mut write = Periodic::new(self.map.rate_hz, connection.now());
        let mut alive = Instant::now();
        loop {
            if connection.stopping() {
                return Err(off::at_the_end(connection, self));
            }
            if alive.elapsed() > heartbeat {
                return Err(LinkError::Io(format!("node {} gives no sign of life", self.node)));
            }
            let now = connection.now();
            if write.is_due(now) {
                match connection.endpoint.due(now) {
                    Due::Nothing => {}
                    Due::SetPoints(set_points) => {
                        let state = DriveState::of(connection.endpoint.value(self.map.status) as u16);
                        let control = state.and_then(DriveState::towards_enabled).unwrap_or(0);
                        self.process_data(connection, control, &set_points)?;
                    }
                    // Only the loop's own commands enable; the safe set-points do not.
                    Due::Safe(_) => self.send_off(connection)?,
                }
                write.advance(connection.now());
            }
            let pause = Duration::from_nanos(write.due.since(connection.now()).0).min(LONGEST_SLEEP);
            match self.receive(Instant::now() + pause)? {
                Some(CanEvent::Frame(frame, _)) if frame.id == self.map.cob => {
                    alive = Instant::now();
                    let arrived = connection.now();
                    connection.endpoint.frame(self.map.data, frame.data(), arrived)?;
                    connection.tell(Ok(()));
                }
                Some(CanEvent::Frame(frame, _)) if frame.id == 0x700 + u32::from(self.node) => {
                    alive = Instant::now();
                    if frame.data() == [0] {
                        return Err(LinkError::Io("the drive restarted".into()));
                    }
                }
                Some(CanEvent::Frame(frame, _)) if frame.id == 0x80 + u32::from(self.node) => {
                    let word = frame.data().iter().take(2).rev();
                    let code = word.fold(0_u32, |sum, byte| sum << 8 | u32::from(*byte));
                    connection.endpoint.alarm(&format!("emergency {code:#06x}"));
                }
                Some(CanEvent::BusOff) => return Err(LinkError::Io(LEFT.into())),
                Some(CanEvent::Passive) => return Err(LinkError::Io(PASSIVE.into())),
                Some(CanEvent::Warning) => connection.endpoint.health().problem(WARNS),
                _ => {}
            }
        }
    }

    fn process_data(
        &mut self,
        connection: &Connection,
        control: u16,
        set_points: &[(SetId, f64)],
    ) -> Result<(), LinkError> {
        for (set, value) in set_points {
            let _ = connection.endpoint.profile().encode_set(*set, *value, &mut self.block);
        }
        self.block[..2].copy_from_slice(&control.to_le_bytes());
        let frame = CanFrame::new(self.map.out, &self.block);
        let none = || LinkError::Io("its set-points are more than the 8 bytes of a frame".into());
        self.send(&frame.ok_or_else(none)?)
    }
}

impl OffWay for Master {
    fn send_off(&mut self, connection: &mut Connection) -> Result<(), LinkError> {
        let safe = connection.endpoint.hand_out_off(connection.now());
        let sent = self.process_data(connection, NOT_ENABLED, &safe);
        self.tries += 1;
        // A drive that is not operational takes no process data, but service data: the second way, where the
        // first has not shown itself or where nobody knows the drive's state.
        let served = if self.tries > 1 || sent.is_err() {
            self.write(0x6040, 0, 2, i64::from(NOT_ENABLED))
        } else {
            Ok(())
        };
        match (sent, served) {
            (Ok(()), Ok(()) | Err(LinkError::Refused(_) | LinkError::Timeout(_))) | (Err(_), Ok(())) => {
                Ok(())
            }
            (Err(ended), _) | (Ok(()), Err(ended)) => Err(ended),
        }
    }

    fn be_patient(&mut self, _connection: &Connection) {
        self.limit_ms = self.limit_ms.max(OFF_ANSWER_MS);
    }

    fn read_state(&mut self, connection: &mut Connection) -> Result<(), LinkError> {
        let deadline = Instant::now() + Duration::from_millis(u64::from(self.limit_ms));
        while let Some(event) = self.receive(deadline)? {
            if let CanEvent::Frame(frame, _) = event
                && frame.id == self.map.cob
            {
                let arrived = connection.now();
                connection.endpoint.frame(self.map.data, frame.data(), arrived)?;
                if connection.endpoint.reads_off() {
                    self.tries = 0;
                    return Ok(());
                }
                // The drive slows down: what it shows next may be rest.
            }
            // Whatever came: a bus that is full of others' frames keeps nobody here.
            if Instant::now() >= deadline {
                break;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::endpoint::Endpoint;
    use std::sync::Arc;

    /// A bus that is full of others' frames.
    struct Flood;

    impl CanPort for Flood {
        fn send(&mut self, _: &CanFrame) -> std::io::Result<bool> {
            Ok(true)
        }

        fn receive(&mut self, _: Instant) -> std::io::Result<Option<CanEvent>> {
            Ok(CanFrame::new(0x7A, &[0; 8]).map(|frame| CanEvent::Frame(frame, Duration::ZERO)))
        }
    }

    fn stage() -> InstrumentSetup {
        let dead_weight_n = Some(0.25);
        InstrumentSetup { dead_weight_n, ..InstrumentSetup::new("cia402-profile-velocity", "none") }
    }

    fn connection() -> Connection {
        let endpoint = Endpoint::stage(crate::profile(&stage().profile).unwrap(), &stage()).unwrap().0;
        Connection::new(endpoint, Instant::now(), Arc::default(), std::sync::mpsc::sync_channel(1).0)
    }

    fn master(connection: &Connection, port: impl CanPort + 'static) -> Master {
        let map = Map::of(connection, 5).unwrap();
        let block = vec![0; map.length];
        Master { port: Box::new(port), node: 5, limit_ms: 20, map, block, tries: 0 }
    }

    /// A bus with one frame of 29 bits whose number is that of the drive's own.
    struct Foreign(Option<CanFrame>);

    impl CanPort for Foreign {
        fn send(&mut self, _: &CanFrame) -> std::io::Result<bool> {
            Ok(true)
        }

        fn receive(&mut self, _: Instant) -> std::io::Result<Option<CanEvent>> {
            Ok(self.0.take().map(|frame| CanEvent::Frame(frame, Duration::ZERO)))
        }
    }

    #[test]
    fn a_frame_of_29_bits_is_not_the_drives() {
        for extended in [false, true] {
            let mut connection = connection();
            let foreign = Foreign(CanFrame::build(0x185, extended, &[0; 8]));
            let mut master = master(&connection, foreign);
            master.read_state(&mut connection).unwrap();
            let status = connection.endpoint.value(master.map.status);
            assert_eq!(status.is_nan(), extended, "{status}");
        }
    }

    /// Set-points that no frame can carry are a failure: nobody would know that an 'off' was never sent.
    #[test]
    fn set_points_that_no_frame_carries_are_not_taken_as_sent() {
        let connection = connection();
        let mut master = master(&connection, Foreign(None));
        assert_eq!(master.process_data(&connection, 0, &[]), Ok(()));
        master.map.out = 0x800;
        assert!(master.process_data(&connection, 0, &[]).is_err());
    }

    #[test]
    fn a_node_beyond_127_is_refused() {
        for base in [0, 128, 300] {
            let refused = spawn(&InstrumentSetup { base: Some(base), ..stage() }, connection());
            assert!(matches!(refused, Err(LinkError::Io(why)) if why.contains("1 to 127")), "{base}");
        }
    }

    /// Switching off waits for the drive's state: no longer than it may, however full the bus is.
    #[test]
    fn a_full_bus_does_not_hold_up_an_off() {
        let mut connection = connection();
        let mut master = master(&connection, Flood);
        let (done, ended) = std::sync::mpsc::channel();
        // A thread of its own: what hangs must fail, not hang the test.
        std::thread::spawn(move || {
            let began = Instant::now();
            let over = off::switch_off(&mut connection, &mut master);
            let _ = done.send((over.map_err(|ended| ended.to_string()), began.elapsed()));
        });
        let most = off::OFF_WITHIN + Duration::from_secs(120);
        let (over, took) = ended.recv_timeout(2 * most).expect("it hangs");
        assert!(over.unwrap_err().contains("did not show 'off'") && took < most, "{took:?}");
    }
}
