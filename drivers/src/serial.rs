//! Serial lines.

use super::link_error::LinkError;
use super::off::PendingOff;
use super::trace;
use serialport::{DataBits, Parity, SerialPort, StopBits};
use std::io::{Read, Write};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::{Duration, Instant};

/// A serial line whose reads have deadlines, and on which an unplugged port is an error.
pub struct Line {
    port: Box<dyn SerialPort>,
    /// In the trace.
    name: String,
}

impl Line {
    /// Opens `path` at `baud` with `format` such as `8N1`.
    ///
    /// # Errors
    /// Where the port is not there, is in use, or the format makes no sense.
    pub fn open(path: &str, baud: u32, format: &str) -> Result<Self, LinkError> {
        let (data, parity, stop) = parse_format(format)
            .ok_or_else(|| LinkError::Io(format!("`{format}` is not a serial format such as 8N1")))?;
        let port = serialport::new(path, baud)
            .data_bits(data)
            .parity(parity)
            .stop_bits(stop)
            .timeout(Duration::from_millis(5))
            .open()
            .map_err(|error| LinkError::Io(format!("{path}: {error}")))?;
        Ok(Self { port, name: path.into() })
    }

    /// Reads what comes until `deadline`; zero bytes mean that it passed.
    ///
    /// # Errors
    /// Where the port is gone. An unplugged port gives `Ok(0)` at once and for ever
    /// (espmonitor issue 12): that is an error too, else the thread would spin.
    pub fn read(&mut self, buffer: &mut [u8], deadline: Instant) -> Result<usize, LinkError> {
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            self.port
                .set_timeout(left.max(Duration::from_micros(100)))
                .map_err(|error| LinkError::Io(error.to_string()))?;
            match came(self.port.read(buffer))? {
                Some(count) => {
                    trace::received(&self.name, &buffer[..count]);
                    return Ok(count);
                }
                None if Instant::now() >= deadline => return Ok(0),
                None => {}
            }
        }
    }

    /// Sends all of `bytes`.
    ///
    /// # Errors
    /// Where the port does not take them.
    pub fn write(&mut self, bytes: &[u8]) -> Result<(), LinkError> {
        self.port
            .set_timeout(Duration::from_millis(500))
            .map_err(|error| LinkError::Io(error.to_string()))?;
        trace::sent(&self.name, bytes);
        self.port.write_all(bytes)?;
        Ok(())
    }

    /// Throws away what comes until the line has been silent for `quiet`; gives up after `most`, or for
    /// an 'off' that waits. Returns whether it fell silent.
    ///
    /// # Errors
    /// Where the port is gone.
    pub fn drain(
        &mut self,
        quiet: Duration,
        most: Duration,
        pending_off: &PendingOff,
    ) -> Result<bool, LinkError> {
        let (mut silent, mut end) = (Instant::now() + quiet, Instant::now() + most);
        let mut buffer = [0; 512];
        while Instant::now() < end {
            if self.read(&mut buffer, pending_off.look(&mut end).min(silent))? > 0 {
                silent = Instant::now() + quiet;
            } else if Instant::now() >= silent {
                return Ok(true);
            }
        }
        Ok(false)
    }
}

/// A serial line that several units share: whoever takes it has it for one exchange.
#[derive(Clone)]
pub struct SharedLine(Arc<Open>);

struct Open {
    key: PathBuf,
    settings: (u32, String),
    line: Mutex<Line>,
    /// A read or write has failed: whoever comes next opens the port anew.
    gone: AtomicBool,
}

/// The lines that this process has open for sharing.
static OPEN: Mutex<Vec<Weak<Open>>> = Mutex::new(Vec::new());

impl SharedLine {
    /// Opens a line, or takes part in one that is open.
    ///
    /// # Errors
    /// What [`Line::open`] says, and a line that is open with other settings.
    pub fn open(path: &str, baud: u32, format: &str) -> Result<Self, LinkError> {
        let key = std::fs::canonicalize(path).unwrap_or_else(|_| path.into());
        let settings = (baud, format.to_string());
        let mut all = OPEN.lock().unwrap_or_else(PoisonError::into_inner);
        all.retain(|open| open.strong_count() > 0);
        let whole = |open: &Arc<Open>| open.key == key && !open.gone.load(Ordering::Acquire);
        if let Some(open) = all.iter().filter_map(Weak::upgrade).find(whole) {
            let (baud, format) = &open.settings;
            let other = format!("{path} is open for another unit at {baud} baud, {format}");
            return if open.settings == settings { Ok(Self(open)) } else { Err(LinkError::Io(other)) };
        }
        let line = Mutex::new(Line::open(path, baud, format)?);
        let open = Arc::new(Open { key, settings, line, gone: AtomicBool::new(false) });
        all.push(Arc::downgrade(&open));
        Ok(Self(open))
    }

    /// Does one exchange while nobody else has the line.
    ///
    /// # Errors
    /// What the exchange says.
    pub fn with<T>(&self, exchange: impl FnOnce(&mut Line) -> Result<T, LinkError>) -> Result<T, LinkError> {
        let done = exchange(&mut self.0.line.lock().unwrap_or_else(PoisonError::into_inner));
        if matches!(done, Err(LinkError::Io(_))) {
            self.0.gone.store(true, Ordering::Release);
        }
        done
    }
}

/// How many bytes a read brought; `None` where it is to be tried again until the deadline.
fn came(read: std::io::Result<usize>) -> Result<Option<usize>, LinkError> {
    use std::io::ErrorKind::{Interrupted, TimedOut};
    match read {
        Ok(0) => Err(LinkError::Io("the port is gone (unplugged?)".into())),
        Ok(count) => Ok(Some(count)),
        Err(error) if matches!(error.kind(), TimedOut | Interrupted) => Ok(None),
        Err(error) => Err(error.into()),
    }
}

fn parse_format(format: &str) -> Option<(DataBits, Parity, StopBits)> {
    fn meant<T: Copy>(all: &[(u8, T)], letter: u8) -> Option<T> {
        all.iter().find(|(known, _)| *known == letter).map(|(_, meant)| *meant)
    }
    let [data, parity, stop] = *format.as_bytes() else { return None };
    let data = meant(&[(b'7', DataBits::Seven), (b'8', DataBits::Eight)], data)?;
    let parity = meant(&[(b'N', Parity::None), (b'E', Parity::Even), (b'O', Parity::Odd)], parity)?;
    Some((data, parity, meant(&[(b'1', StopBits::One), (b'2', StopBits::Two)], stop)?))
}

/// The latency timer of a USB serial adapter in ms, where the port is such a one: at FTDI's default
/// of 16 ms a sensor that sends 100 frames a second gives 62.5.
pub fn latency_timer_ms(path: &str) -> Option<u32> {
    let name = std::fs::canonicalize(path).ok()?;
    let timer = format!("/sys/bus/usb-serial/devices/{}/latency_timer", name.file_name()?.to_str()?);
    std::fs::read_to_string(timer).ok()?.trim().parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serialport::TTYPort;
    use std::io::{Error, ErrorKind};

    #[test]
    fn a_line_is_shared_at_one_setting_and_opened_anew_once_it_is_gone() {
        let (instrument, driver) = TTYPort::pair().unwrap();
        let path = driver.name().unwrap();
        drop(driver);
        let first = SharedLine::open(&path, 9600, "8N1").unwrap();
        let second = SharedLine::open(&path, 9600, "8N1").unwrap();
        assert!(Arc::ptr_eq(&first.0, &second.0));
        let other = SharedLine::open(&path, 19_200, "8N1").err().unwrap().to_string();
        assert!(other.contains("9600"), "{other}");
        first.with(|_| Err::<(), _>(LinkError::Timeout(5))).unwrap_err();
        assert!(
            Arc::ptr_eq(&SharedLine::open(&path, 9600, "8N1").unwrap().0, &first.0),
            "a late answer is no end"
        );
        first.with(|_| Err::<(), _>(LinkError::Io("unplugged".into()))).unwrap_err();
        drop(first);
        assert!(SharedLine::open(&path, 9600, "8N1").is_err(), "the second still holds the port");
        drop(second);
        SharedLine::open(&path, 9600, "8N1").unwrap();
        drop(instrument);
    }

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
