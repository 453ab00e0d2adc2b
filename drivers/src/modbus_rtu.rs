//! Registers over Modbus RTU, and the streams that sensors leave it for.
//!
//! RTU has no transaction number: a late answer of the right length looks like the answer to the next
//! request. So after a timeout the line is drained until it has been silent for longer than the instrument's
//! longest answer takes, and only then is the next request made. Sensors may share a line, each with a thread
//! of its own: an exchange has the line to itself. What takes set-points has a line of its own, so that
//! nothing holds up an 'off'.

use super::connection::{Connection, Spawned};
use super::link_error::{BAD_IN_A_ROW, LinkError};
use super::modbus::{Blocks, Conversation, Registers, Trouble};
use super::off::{OFF_WAITS_MS, PendingOff};
use super::serial::{Line, SharedLine};
use super::setup::InstrumentSetup;
use instruments::codec::modbus_rtu::{self as rtu, Request, RtuError};
use instruments::schema::{Stream, Table};
use std::convert::Infallible;
use std::time::{Duration, Instant};

/// Tries to stop a stream that a crashed client left on.
const STOP_TRIES: u32 = 10;

/// Starts the thread of one instrument.
pub(crate) fn spawn(instrument: &InstrumentSetup, connection: Connection) -> Spawned {
    let link = connection.endpoint.profile().description.link.clone();
    let path = instrument.address.strip_prefix("rtu:").unwrap_or(&instrument.address).to_string();
    let rate_hz = instrument.rate_hz;
    let unit = instrument.unit.or(link.unit).unwrap_or(1);
    let baud = instrument.baud.or(link.baud).unwrap_or(19_200);
    if let Some(late) = super::serial::latency_timer_ms(&path).filter(|&ms| ms > 2) {
        tracing::warn!(path, "the adapter holds bytes back for up to {late} ms; set its latency_timer to 1");
    }
    connection.spawn(move |connection| {
        let mut wire = Rtu::open(&path, baud, link.line_format(), unit, link.response_timeout_ms)?;
        wire.pending_off = connection.pending_off.clone();
        let health = connection.endpoint.health();
        health.count(&health.connections);
        let stream = connection.endpoint.profile().description.stream.clone();
        if let Some(stream) = stream.as_ref().filter(|stream| stream.stop_before_open) {
            wire.stop_stream(stream)?;
        }
        if !connection.is_first() && connection.endpoint.owes_off() {
            // Sent before the line is listened to: nobody knows how long it will be heard.
            wire.send_unanswered_off(connection)?;
        }
        // Whatever an earlier connection was still owed comes now or never.
        let longest = link.patience();
        wire.line.with(|line| line.drain(longest, 10 * longest, &PendingOff::default()))?;
        let conversation = Conversation::begin(connection, &mut wire)?;
        match stream {
            None => conversation.go_on(connection, rate_hz),
            Some(stream) => wire.listen(connection, &stream),
        }
    })
}

fn write_request(unit: u8, table: Table, address: u16, registers: &[u16]) -> Request {
    let write = if table.is_bits() { rtu::write_coils } else { rtu::write };
    write(unit, address, registers)
}

/// A unit on a line.
pub struct Rtu {
    line: SharedLine,
    unit: u8,
    answer_ms: u32,
    quiet_ms: u32,
    silence: f64,
    pending_off: PendingOff,
}

impl Rtu {
    /// A unit on the line at `path`; answers may take `answer_ms`.
    ///
    /// # Errors
    /// Where the port is not there, is in use, or the format makes no sense.
    pub fn open(path: &str, baud: u32, format: &str, unit: u8, answer_ms: u32) -> Result<Self, LinkError> {
        let line = SharedLine::open(path, baud, format)?;
        let (silence, pending_off) = (rtu::silence_s(baud), PendingOff::default());
        Ok(Rtu { line, unit, answer_ms, quiet_ms: answer_ms, silence, pending_off })
    }

    /// Writes the safe set-points, every block of them, and needs no answer. The 'off' that is answered and read back follows.
    fn send_unanswered_off(&mut self, connection: &Connection) -> Result<(), LinkError> {
        let profile = connection.endpoint.profile();
        let off = Blocks::of(profile).put(profile, &connection.endpoint.safe_set_points());
        for (n, (block, words)) in off.iter().enumerate() {
            if n > 0 {
                // One at a time has the line: where there is an answer to the one before, it is let through.
                let answer = Duration::from_millis(u64::from(self.answer_ms.min(OFF_WAITS_MS)));
                self.line.with(|line| line.drain(answer, 2 * answer, &self.pending_off))?;
            }
            std::thread::sleep(Duration::from_secs_f64(self.silence));
            let request = write_request(self.unit, block.table, block.address, words);
            self.line.with(|line| line.write(&request.bytes))?;
        }
        Ok(())
    }

    /// One request and its answer.
    fn ask(&mut self, request: &Request) -> Result<Vec<u8>, Trouble> {
        let (answer_ms, pending_off) = (self.answer_ms, &self.pending_off);
        let silence = Duration::from_secs_f64(self.silence);
        let exchange = |line: &mut Line| {
            line.write(&request.bytes)?;
            let mut deadline = Instant::now() + Duration::from_millis(u64::from(answer_ms));
            let mut answer = Vec::with_capacity(request.answer_length);
            let mut buffer = [0; 260];
            loop {
                let count = line.read(&mut buffer, pending_off.look(&mut deadline))?;
                if count == 0 && Instant::now() >= deadline {
                    return Err(match answer.len() {
                        0 => LinkError::Timeout(pending_off.limit_ms(answer_ms)),
                        n => LinkError::Cut(format!(
                            "{n} bytes came in place of {}: {}: are baud and format right, and `unit` one of its own?",
                            request.answer_length,
                            super::remedy::shown(&answer)
                        )),
                    });
                }
                answer.extend_from_slice(&buffer[..count]);
                // The length is known from the request, however the bytes come.
                if rtu::answer_length(request, &answer).is_some_and(|length| answer.len() >= length) {
                    break;
                }
            }
            std::thread::sleep(silence);
            Ok(answer)
        };
        self.line.with(exchange).map_err(Trouble::LinkError)
    }

    /// Judges an answer; after a bad one the line is drained, so that its rest is no next answer.
    fn judged<T>(&mut self, judged: Result<T, RtuError>) -> Result<T, Trouble> {
        judged.map_err(|error| match error {
            RtuError::Exception(code) => Trouble::Refused(super::remedy::exception(code)),
            other => {
                let quiet = Duration::from_millis(u64::from(self.quiet_ms));
                match self.line.with(|line| line.drain(quiet, 10 * quiet, &self.pending_off)) {
                    Ok(_) => Trouble::Corrupt(other.to_string()),
                    Err(ended) => Trouble::LinkError(ended),
                }
            }
        })
    }

    /// Stops a stream by talking into it, until the line falls silent.
    fn stop_stream(&mut self, stream: &Stream) -> Result<(), LinkError> {
        let Some((byte, count)) = stream.stop else { return Ok(()) };
        for _ in 0..STOP_TRIES {
            self.line.with(|line| line.write(&vec![byte; usize::from(count)]))?;
            let settle = Duration::from_millis(u64::from(stream.settle_ms));
            if self.line.with(|line| line.drain(settle, settle * 3, &self.pending_off))? {
                return Ok(());
            }
        }
        Err(LinkError::Io("the instrument's stream cannot be stopped".into()))
    }

    /// Starts the stream and hands over its frames until something is wrong.
    fn listen(&mut self, connection: &mut Connection, stream: &Stream) -> Result<Infallible, LinkError> {
        self.start_stream(stream)?;
        super::stream::listen(connection, stream, false, &mut |buffer, deadline| {
            self.line.with(|line| line.read(buffer, deadline))
        })?;
        self.stop_stream(stream)?;
        Err(LinkError::Stopped)
    }

    fn start_stream(&mut self, stream: &Stream) -> Result<(), LinkError> {
        let mut last = LinkError::Io("the profile says no way to start the stream".into());
        for _ in 0..BAD_IN_A_ROW {
            let started = if let Some((address, value)) = stream.start_register {
                self.write(Table::Holding, address, &[value])
            } else if let Some((function, data)) = stream.start_function {
                self.own_function(function, data)
            } else {
                break;
            };
            match started {
                Ok(()) => return Ok(()),
                Err(Trouble::LinkError(ended)) => return Err(ended),
                Err(Trouble::Refused(why) | Trouble::Corrupt(why)) => last = LinkError::Refused(why),
            }
        }
        Err(last)
    }
}

impl Registers for Rtu {
    fn read(&mut self, table: Table, address: u16, count: u16) -> Result<Vec<u8>, Trouble> {
        let request = rtu::read(self.unit, table.read_function(), address, count);
        let answer = self.ask(&request)?;
        self.judged(rtu::registers(&request, &answer))
    }

    fn write(&mut self, table: Table, address: u16, registers: &[u16]) -> Result<(), Trouble> {
        let request = write_request(self.unit, table, address, registers);
        let answer = self.ask(&request)?;
        let length = rtu::answer_length(&request, &answer).unwrap_or(answer.len()).min(answer.len());
        // A stream that this write starts may follow its answer at once.
        self.judged(rtu::written(&request, &answer[..length]))
    }

    fn own_function(&mut self, function: u8, data: u8) -> Result<(), Trouble> {
        let request = rtu::custom(self.unit, function, &[data], 5);
        let answer = self.ask(&request)?;
        // The first bytes of a stream may follow at once: only the answer itself is judged.
        let answered = rtu::payload(&request, &answer[..answer.len().min(5)]).map(|payload| payload[0]);
        match self.judged(answered)? {
            rtu::DONE => Ok(()),
            other => Err(Trouble::Refused(format!("function {function:#04x} was answered by {other}"))),
        }
    }

    fn wait_up_to(&mut self, answer_ms: u32) {
        self.answer_ms = answer_ms;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::endpoint::Endpoint;
    use instruments::profile::Profile;
    use serialport::{SerialPort, TTYPort};
    use std::io::{Read, Write};
    use std::sync::Arc;

    /// An amplifier with its enable in a block of its own: 'off' goes into every block without an answer.
    #[test]
    fn an_unanswered_off_is_in_every_block() {
        let text = crate::bundled::text("muprime-amplifier").unwrap();
        let switch = "[[write]]\nname = \"switch\"\naddress = 300\ncount = 1\n\n[[signal]]";
        let text = text.replacen("[[signal]]", switch, 1);
        let mut parts = text.split("[[set]]");
        let mut split = parts.next().unwrap().to_string();
        for part in parts {
            let part = match part.contains("name = \"enable\"") {
                true => format!("\nblock = \"switch\"{}", part.replacen("register = 3", "register = 0", 1)),
                false => format!("\nblock = \"command\"{part}"),
            };
            split += &format!("[[set]]{part}");
        }
        let text = split.replace("enable = 1, heartbeat = 77 }", "heartbeat = 77 }")
            + "\n[[vector]]\nframe = \"switch\"\nregisters = [1]\nexpect = { enable = 1 }\n";
        let profile = Profile::parse_with(&text, &|_| None).unwrap_or_else(|e| panic!("{e:?}"));
        let instrument = InstrumentSetup::new("muprime-amplifier", "rtu:pty");
        let (endpoint, _port) = Endpoint::amplifier(profile, &instrument).unwrap();
        let (ready, _opened) = std::sync::mpsc::sync_channel(1);
        let connection = Connection::new(endpoint, Instant::now(), Arc::default(), ready);
        let (mut instrument, driver) = TTYPort::pair().unwrap();
        let line = SharedLine::open(&driver.name().unwrap(), 115_200, "8N1").unwrap();
        let mut wire = Rtu {
            line,
            unit: 2,
            answer_ms: 5,
            quiet_ms: 5,
            silence: 1e-3,
            pending_off: PendingOff::default(),
        };
        wire.send_unanswered_off(&connection).unwrap();
        instrument.set_timeout(Duration::from_millis(50)).unwrap();
        let (mut heard, mut buffer) = (Vec::new(), [0; 256]);
        while let Ok(count) = instrument.read(&mut buffer) {
            heard.extend_from_slice(&buffer[..count]);
        }
        let switch = rtu::write(2, 300, &[0]).bytes;
        let command = rtu::write(2, 100, &[0; 5]).bytes;
        assert_eq!(heard, [switch, command].concat(), "{heard:02x?}");
    }

    /// Neither an answer that stays away nor noise on the line keeps an 'off' that waits.
    #[test]
    fn an_off_that_waits_ends_an_exchange() {
        let (mut instrument, driver) = TTYPort::pair().unwrap();
        let line = SharedLine::open(&driver.name().unwrap(), 115_200, "8N1").unwrap();
        let hour_ms = 3_600_000;
        let pending_off = PendingOff::default();
        let mut wire =
            Rtu { line, unit: 2, answer_ms: hour_ms, quiet_ms: hour_ms, silence: 1e-3, pending_off };
        wire.pending_off.commands.handed_out(true);
        wire.pending_off.stop.store(true, std::sync::atomic::Ordering::Release);
        let read = wire.read(Table::Holding, 0, 2);
        assert!(matches!(read, Err(Trouble::LinkError(LinkError::Timeout(OFF_WAITS_MS)))), "{read:?}");
        instrument.write_all(&[2, 3, 4, 0, 0, 0, 0, 0, 0]).unwrap();
        let read = wire.read(Table::Holding, 0, 2);
        assert!(matches!(read, Err(Trouble::Corrupt(_))), "{read:?}");
    }
}
