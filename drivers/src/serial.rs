//! Serial lines.

use super::session::Ended;
use serialport::{DataBits, Parity, SerialPort, StopBits};
use std::io::{Read, Write};
use std::time::{Duration, Instant};

/// A serial line whose reads have deadlines, and on which an unplugged port is an error.
pub struct Line {
    port: Box<dyn SerialPort>,
}

impl Line {
    /// Opens `path` at `baud` with `format` such as `8N1`.
    ///
    /// # Errors
    /// Where the port is not there, is in use, or the format makes no sense.
    pub fn open(path: &str, baud: u32, format: &str) -> Result<Self, Ended> {
        let (data, parity, stop) = parse_format(format)
            .ok_or_else(|| Ended::Io(format!("`{format}` is no serial format such as 8N1")))?;
        let port = serialport::new(path, baud)
            .data_bits(data)
            .parity(parity)
            .stop_bits(stop)
            .timeout(Duration::from_millis(5))
            .open()
            .map_err(|error| Ended::Io(format!("{path}: {error}")))?;
        Ok(Self { port })
    }

    /// Reads what comes until `deadline`; zero bytes mean that it passed.
    ///
    /// # Errors
    /// Where the port is gone. An unplugged port gives `Ok(0)` at once and for ever
    /// (espmonitor issue 12): that is an error too, else the thread would spin.
    pub fn read(&mut self, buffer: &mut [u8], deadline: Instant) -> Result<usize, Ended> {
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            self.port
                .set_timeout(left.max(Duration::from_micros(100)))
                .map_err(|error| Ended::Io(error.to_string()))?;
            match came(self.port.read(buffer))? {
                Some(count) => return Ok(count),
                None if Instant::now() >= deadline => return Ok(0),
                None => {}
            }
        }
    }

    /// Sends all of `bytes`.
    ///
    /// # Errors
    /// Where the port does not take them.
    pub fn write(&mut self, bytes: &[u8]) -> Result<(), Ended> {
        self.port.set_timeout(Duration::from_millis(500)).map_err(|error| Ended::Io(error.to_string()))?;
        self.port.write_all(bytes)?;
        Ok(())
    }

    /// Throws away what comes until the line has been silent for `quiet`; gives up after `most`.
    /// Returns whether it fell silent.
    ///
    /// # Errors
    /// Where the port is gone.
    pub fn drain(&mut self, quiet: Duration, most: Duration) -> Result<bool, Ended> {
        let end = Instant::now() + most;
        let mut buffer = [0; 512];
        while Instant::now() < end {
            if self.read(&mut buffer, Instant::now() + quiet)? == 0 {
                return Ok(true);
            }
        }
        Ok(false)
    }
}

/// How many bytes a read brought; `None` where it is to be tried again until the deadline.
fn came(read: std::io::Result<usize>) -> Result<Option<usize>, Ended> {
    use std::io::ErrorKind::{Interrupted, TimedOut};
    match read {
        Ok(0) => Err(Ended::Io("the port is gone (unplugged?)".into())),
        Ok(count) => Ok(Some(count)),
        Err(error) if matches!(error.kind(), TimedOut | Interrupted) => Ok(None),
        Err(error) => Err(error.into()),
    }
}

fn parse_format(format: &str) -> Option<(DataBits, Parity, StopBits)> {
    let bytes = format.as_bytes();
    let data = match bytes.first()? {
        b'7' => DataBits::Seven,
        b'8' => DataBits::Eight,
        _ => return None,
    };
    let parity = match bytes.get(1)? {
        b'N' => Parity::None,
        b'E' => Parity::Even,
        b'O' => Parity::Odd,
        _ => return None,
    };
    let stop = match bytes.get(2)? {
        b'1' => StopBits::One,
        b'2' => StopBits::Two,
        _ => return None,
    };
    (bytes.len() == 3).then_some((data, parity, stop))
}

/// The latency timer of a USB serial adapter in ms, where the port is such a one: at FTDI's default
/// of 16 ms a sensor that sends 100 frames a second gives 62.5.
#[must_use]
pub fn latency_timer_ms(path: &str) -> Option<u32> {
    let name = std::fs::canonicalize(path).ok()?;
    let timer = format!("/sys/bus/usb-serial/devices/{}/latency_timer", name.file_name()?.to_str()?);
    std::fs::read_to_string(timer).ok()?.trim().parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Error, ErrorKind};

    /// espmonitor issue 12: an unplugged port gives `Ok(0)` at once and for ever.
    #[test]
    fn a_read_of_nothing_is_an_unplugged_port() {
        let gone = came(Ok(0)).unwrap_err().to_string();
        assert!(gone.contains("unplugged"), "{gone}");
        assert!(matches!(came(Ok(7)), Ok(Some(7))));
        assert!(matches!(came(Err(Error::from(ErrorKind::TimedOut))), Ok(None)));
        assert!(matches!(came(Err(Error::from(ErrorKind::Interrupted))), Ok(None)));
        assert!(came(Err(Error::from(ErrorKind::BrokenPipe))).is_err());
    }
}
