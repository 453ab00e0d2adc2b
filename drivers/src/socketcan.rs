//! CAN through the kernel (SocketCAN).
//!
//! Frames that wait when the bus goes off would leave when it comes back (yarp-devices issue 246). So
//! bus-off ends the connection, nothing restarts by itself, and the caller learns of a queue without room and
//! sends the newest command instead of queueing more.

use instruments::{CanEvent, CanFrame, CanPort};
use socketcan::{
    CanDataFrame, CanError, CanFrame as Raw, CanSocket, EmbeddedFrame, ExtendedId, Frame, Id, Socket,
    SocketOptions, StandardId,
};
use std::io;
use std::time::{Duration, Instant, SystemTime};

/// A bus of the kernel's.
pub struct KernelCan {
    socket: CanSocket,
}

impl KernelCan {
    /// Opens an interface, such as `can0`.
    ///
    /// # Errors
    /// Where there is none, or this kernel has no CAN.
    pub fn open(interface: &str) -> io::Result<Self> {
        let socket = CanSocket::open(interface).map_err(|error| {
            let hint = if error.raw_os_error() == Some(libc::EAFNOSUPPORT) {
                ": this kernel has no CAN; use a serial adapter (slcan) or the guest of tests/can_guest"
            } else {
                ""
            };
            io::Error::other(format!("{interface}: {error}{hint}"))
        })?;
        socket.set_error_filter_accept_all()?;
        socket.set_recv_timestamp(true)?;
        Ok(Self { socket })
    }
}

impl CanPort for KernelCan {
    fn send(&mut self, frame: &CanFrame) -> io::Result<bool> {
        let id: Option<Id> = if frame.extended {
            ExtendedId::new(frame.id).map(Id::from)
        } else {
            u16::try_from(frame.id).ok().and_then(StandardId::new).map(Id::from)
        };
        let frame = id.and_then(|id| CanDataFrame::new(id, frame.data()));
        let frame = frame.ok_or_else(|| io::Error::other("no CAN frame can be like that"))?;
        sent(self.socket.write_frame(&frame))
    }

    fn receive(&mut self, deadline: Instant) -> io::Result<Option<CanEvent>> {
        loop {
            let left = deadline.saturating_duration_since(Instant::now()).max(Duration::from_micros(50));
            self.socket.set_read_timeout(left)?;
            match self.socket.read_frame_with_timestamp() {
                Ok((Raw::Data(data), stamp)) => {
                    let id = data.raw_id() & 0x1FFF_FFFF;
                    // The stamp is wall-clock time: only how long ago it was is used, and never a leap.
                    let ago = SystemTime::now().duration_since(stamp).unwrap_or_default();
                    let ago = if ago < Duration::from_secs(1) { ago } else { Duration::ZERO };
                    let frame = CanFrame::build(id, data.is_extended(), data.data());
                    return Ok(frame.map(|frame| CanEvent::Frame(frame, ago)));
                }
                Ok((Raw::Error(error), _)) => return Ok(Some(judge(&CanError::from(error)))),
                // Never thrown away in here: a bus that is full of them would keep its reader for ever.
                Ok((Raw::Remote(_), _)) => return Ok(Some(CanEvent::Other)),
                Err(error) if matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut) => {
                    return Ok(None);
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
    }
}

/// Whether a frame was taken: a queue without room is back-pressure, no error (python-can issue 2004).
fn sent(written: io::Result<()>) -> io::Result<bool> {
    match written {
        Ok(()) => Ok(true),
        Err(error) if matches!(error.raw_os_error(), Some(libc::ENOBUFS | libc::EAGAIN)) => Ok(false),
        Err(error) => Err(error),
    }
}

/// What an error frame means for the rig: the worst of its causes.
fn judge(error: &CanError) -> CanEvent {
    use socketcan::errors::{ControllerProblems, ErrorCause};
    let passive = ControllerProblems::RX_PASSIVE | ControllerProblems::TX_PASSIVE;
    let controller = |is: &dyn Fn(ControllerProblems) -> bool| {
        error.causes().any(|cause| matches!(cause, ErrorCause::Controller(problems) if is(*problems)))
    };
    if error.causes().any(|cause| matches!(cause, ErrorCause::BusOff)) {
        CanEvent::BusOff
    } else if controller(&|problems| problems.intersects(passive)) {
        CanEvent::Passive
    } else if controller(&|problems| problems != ControllerProblems::ACTIVE) {
        CanEvent::Warning
    } else {
        CanEvent::Other
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What the kernel tells of its controller, as `linux/can/error.h` has it.
    #[test]
    fn error_frames_are_classified() {
        use socketcan::CanErrorFrame;
        let event_of = |class: u32, controller: u8| {
            let frame = CanErrorFrame::new_error(class, &[0, controller, 0, 0, 0, 0, 0, 0]).unwrap();
            judge(&CanError::from(frame))
        };
        const CONTROLLER: u32 = 0x004;
        for (bits, event) in [
            (0x04, CanEvent::Warning),
            (0x08, CanEvent::Warning),
            (0x10, CanEvent::Passive),
            (0x20, CanEvent::Passive),
            (0x28, CanEvent::Passive),
            (0x40, CanEvent::Other),
        ] {
            assert_eq!(event_of(CONTROLLER, bits), event, "{bits:#04x}");
        }
        assert_eq!(event_of(0x040, 0), CanEvent::BusOff);
        assert_eq!(event_of(0x040 | CONTROLLER, 0x30), CanEvent::BusOff);
        assert_eq!(event_of(0x080, 0), CanEvent::Other);
    }

    #[test]
    fn a_full_queue_is_back_pressure_and_no_error() {
        let failed = |code: i32| sent(Err(io::Error::from_raw_os_error(code)));
        assert!(matches!(failed(libc::ENOBUFS), Ok(false)));
        assert!(matches!(failed(libc::EAGAIN), Ok(false)));
        assert!(failed(libc::ENETDOWN).is_err());
        assert!(matches!(sent(Ok(())), Ok(true)));
    }
}
