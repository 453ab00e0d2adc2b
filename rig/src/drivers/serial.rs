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
            match self.port.read(buffer) {
                Ok(0) => return Err(Ended::Io("the port is gone (unplugged?)".into())),
                Ok(count) => return Ok(count),
                Err(error) if error.kind() == std::io::ErrorKind::TimedOut => {
                    if Instant::now() >= deadline {
                        return Ok(0);
                    }
                }
                Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error.into()),
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
