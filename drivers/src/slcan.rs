//! CAN through a serial adapter (slcan).

use super::link_error::LinkError;
use super::off::PendingOff;
use super::serial::Line;
use instruments::codec::can::{CanFrame, SlcanReader, slcan_line, slcan_speed};
use instruments::{CanEvent, CanPort};
use std::collections::VecDeque;
use std::io;
use std::time::{Duration, Instant};

/// A bus behind a serial adapter.
pub struct Slcan {
    line: Line,
    reader: SlcanReader,
    waiting: VecDeque<CanFrame>,
}

impl Slcan {
    /// Opens the adapter at `path` and its bus at `bitrate`.
    ///
    /// # Errors
    /// Where the port is not there or the bit rate is none of the protocol's.
    pub fn open(path: &str, bitrate: u32) -> Result<Self, LinkError> {
        let speed = slcan_speed(bitrate)
            .ok_or_else(|| LinkError::Io(format!("slcan knows no bit rate of {bitrate} per second")))?;
        // Adapters of this kind are USB: the symbol rate of the line means nothing to them.
        let mut line = Line::open(path, 115_200, "8N1")?;
        line.write(b"\rC\r")?;
        line.drain(Duration::from_millis(20), Duration::from_millis(200), &PendingOff::default())?;
        line.write(&[b'S', speed, b'\r', b'O', b'\r'])?;
        Ok(Self { line, reader: SlcanReader::default(), waiting: VecDeque::new() })
    }
}

impl CanPort for Slcan {
    fn send(&mut self, frame: &CanFrame) -> io::Result<bool> {
        self.line.write(&slcan_line(frame)).map(|()| true).map_err(io::Error::other)
    }

    fn receive(&mut self, deadline: Instant) -> io::Result<Option<CanEvent>> {
        loop {
            if let Some(frame) = self.waiting.pop_front() {
                return Ok(Some(CanEvent::Frame(frame, Duration::ZERO)));
            }
            let mut buffer = [0; 512];
            let count = self.line.read(&mut buffer, deadline).map_err(io::Error::other)?;
            if count == 0 {
                return Ok(None);
            }
            self.reader.push(&buffer[..count], |frame| self.waiting.push_back(frame));
        }
    }
}

impl Drop for Slcan {
    fn drop(&mut self) {
        let _ = self.line.write(b"C\r");
    }
}
