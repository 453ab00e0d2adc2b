//! The conversation in lines of text and blocks of bytes, whatever carries it: a serial line, a device server
//! in front of one (`tcp:HOST:PORT`), or TCP; and streams, also in datagrams.
//!
//! Every set-point is absolute and is sent when it changes, and again each second. Lines that an instrument
//! sends without a request are removed before the driver looks for an answer: they must never be taken for
//! one. A binary answer is framed by its length, since its bytes may look like the end of a line.

use super::connection::{Connection, Periodic, Spawned};
use super::endpoint::Due;
use super::link_error::{BAD_IN_A_ROW, LinkError};
use super::off::{self, OFF_ANSWER_MS, OffWay};
use super::remedy;
use super::setup::InstrumentSetup;
use super::stream::first_line;
use super::transport::{Address, Transport};
use instruments::codec::from_hex;
use instruments::codec::pattern::Pattern;
use instruments::codec::text::number;
use instruments::schema::{Init, Link, LinkKind, Query, Stream};
use instruments::{FrameId, Profile, SetId};
use std::collections::HashMap;
use std::convert::Infallible;
use std::time::{Duration, Instant};

/// An unchanged set-point is sent again after this long.
const REPEAT: Duration = Duration::from_secs(1);
/// Silence that must follow a binary answer.
const AFTER_A_BLOCK: Duration = Duration::from_micros(1500);
/// How often commands are looked for.
const COMMAND_RATE_HZ: f64 = 500.0;

/// Starts the thread of one instrument.
pub(crate) fn spawn(instrument: &InstrumentSetup, connection: Connection) -> Spawned {
    let link = connection.endpoint.profile().description.link.clone();
    let at = Address::of(&instrument.address, &link, instrument.baud)?;
    let rate_hz = instrument.rate_hz;
    connection.spawn(move |connection| {
        let transport = at.open(Duration::from_millis(u64::from(link.connect_timeout_ms)))?;
        let health = connection.endpoint.health();
        health.count(&health.connections);
        let mut talk = Talk::new(transport, link.clone());
        if !connection.is_first() && connection.endpoint.owes_off() {
            // Sent before anything is listened to: nobody knows how long the line will carry.
            talk.send_unanswered_off(connection)?;
            talk.settle()?;
        }
        if let Some(stream) = connection.endpoint.profile().description.stream.clone() {
            return talk.listen(connection, &stream);
        }
        off::at_the_beginning(connection, &mut talk)?;
        talk.initialise(connection)?;
        talk.read_state(connection)?;
        talk.go_on(connection, rate_hz)
    })
}

/// Where a line of this pattern is in what came, and its length with its end.
fn find(pattern: &Pattern, came: &[u8], end: &[u8]) -> Option<(usize, usize)> {
    let head = pattern.head().as_bytes();
    let mut begins = (0..came.len().saturating_sub(head.len())).filter(|&at| came[at..].starts_with(head));
    begins.find_map(|at| {
        let length = came[at..].windows(end.len()).position(|window| window == end)?;
        let line = std::str::from_utf8(&came[at..at + length]).ok()?;
        pattern.read(line).map(|_| (at, length + end.len()))
    })
}

struct Talk {
    transport: Transport,
    link: Link,
    came: Vec<u8>,
    requested_at: Instant,
    /// The line that was sent last.
    request: String,
    sent: HashMap<SetId, (String, Instant)>,
    newest: HashMap<SetId, f64>,
    /// Lines that the instrument sends without a request.
    alarms: Vec<Pattern>,
    bad: u32,
    patience_ms: u32,
}

impl Talk {
    fn new(transport: Transport, link: Link) -> Self {
        let patience_ms = link.response_timeout_ms;
        // The profile was read: every alarm is a pattern.
        let alarms = link.unsolicited.iter().filter_map(|alarm| Pattern::parse(alarm).ok()).collect();
        Self {
            transport,
            link,
            came: Vec::new(),
            requested_at: Instant::now(),
            request: String::new(),
            sent: HashMap::new(),
            newest: HashMap::new(),
            alarms,
            bad: 0,
            patience_ms,
        }
    }

    fn limit(&self) -> Duration {
        Duration::from_millis(u64::from(self.patience_ms))
    }

    /// Takes in what comes; `false` where nothing did until the deadline.
    fn take(&mut self, deadline: Instant) -> Result<bool, LinkError> {
        let mut buffer = [0; 1024];
        let count = self.transport.read(&mut buffer, deadline)?;
        self.came.extend_from_slice(&buffer[..count]);
        Ok(count > 0)
    }

    fn send(&mut self, line: &str) -> Result<(), LinkError> {
        let gap = Duration::from_secs_f64(self.link.min_gap_ms.max(0.0) * 1e-3);
        std::thread::sleep(gap.saturating_sub(self.requested_at.elapsed()));
        self.transport.write(format!("{line}{}", self.link.tx_end()).as_bytes())?;
        self.requested_at = Instant::now();
        line.clone_into(&mut self.request);
        Ok(())
    }

    /// Takes whole lines that came unasked out of what came. Returns whether one was an alarm.
    fn unasked(&mut self, connection: &mut Connection) {
        for alarm in &self.alarms {
            while let Some((at, length)) = find(alarm, &self.came, self.link.rx_end().as_bytes()) {
                let line: Vec<u8> = self.came.drain(at..at + length).collect();
                connection.endpoint.alarm(String::from_utf8_lossy(&line).trim());
            }
        }
    }

    /// The newest value of a set-point that stands in another's line: at first its safe one, else the smallest.
    fn newest(&self, profile: &Profile, set: SetId) -> f64 {
        let described = &profile.description.set[set.0];
        let first = described.safe.or(described.range.map(|(low, _)| low));
        self.newest.get(&set).copied().or(first).unwrap_or(0.0)
    }

    /// A stream that runs by itself: only its start is sent.
    fn listen(&mut self, connection: &mut Connection, stream: &Stream) -> Result<Infallible, LinkError> {
        if !connection.endpoint.profile().description.init.is_empty() {
            self.initialise(connection)?;
        }
        // Each datagram is whole.
        let parted = matches!(self.transport, Transport::Udp(..));
        super::stream::listen(connection, stream, parted, &mut |buffer, deadline| {
            self.transport.read(buffer, deadline)
        })?;
        Err(LinkError::Stopped)
    }

    /// Before a question nothing may be left of earlier answers.
    fn clear(&mut self, connection: &mut Connection) -> Result<(), LinkError> {
        while self.take(Instant::now())? {}
        self.unasked(connection);
        self.came.clear();
        Ok(())
    }

    /// The next line, without its end, that is no unsolicited one.
    fn line(&mut self, connection: &mut Connection) -> Result<String, LinkError> {
        let end = self.link.rx_end().to_owned().into_bytes();
        let mut deadline = Instant::now() + self.limit();
        loop {
            self.unasked(connection);
            if let Some(line) = first_line(&mut self.came, &end)? {
                return Ok(String::from_utf8_lossy(&line).trim().to_string());
            }
            if !self.take(connection.pending_off.look(&mut deadline))? && Instant::now() >= deadline {
                return Err(match self.came.is_empty() {
                    true => LinkError::Timeout(connection.pending_off.limit_ms(self.patience_ms)),
                    false => LinkError::Cut(remedy::unended(&self.came, &end, &self.request)),
                });
            }
        }
    }

    /// A binary answer, framed by its length; `None` where more came than that: a line that came
    /// unasked may then stand in the middle of it.
    fn block(&mut self, connection: &mut Connection, length: usize) -> Result<Option<Vec<u8>>, LinkError> {
        let mut deadline = Instant::now() + self.limit();
        loop {
            self.unasked(connection);
            if self.came.len() < length {
                if !self.take(connection.pending_off.look(&mut deadline))? && Instant::now() >= deadline {
                    return Err(match self.came.len() {
                        0 => LinkError::Timeout(connection.pending_off.limit_ms(self.patience_ms)),
                        n => LinkError::Cut(format!(
                            "{n} bytes came in place of {length}: {}",
                            remedy::shown(&self.came)
                        )),
                    });
                }
            } else if !self.take(Instant::now() + AFTER_A_BLOCK)? {
                let block = std::mem::take(&mut self.came);
                return Ok((block.len() == length).then_some(block));
            }
        }
    }

    /// Ends a line that an earlier connection left incomplete, and drops the answers to it.
    fn settle(&mut self) -> Result<(), LinkError> {
        let quiet = Instant::now() + self.limit();
        self.send("")?;
        while self.take(quiet)? && Instant::now() < quiet {}
        self.came.clear();
        Ok(())
    }

    /// Writes the safe set-points and waits for no answer. The 'off' that is answered and read back follows.
    fn send_unanswered_off(&mut self, connection: &Connection) -> Result<(), LinkError> {
        self.send("")?;
        for (set, value) in connection.endpoint.safe_set_points() {
            let profile = connection.endpoint.profile();
            if let Some((line, _)) = profile.line(set, value, &|other| self.newest(profile, other)) {
                self.send(&line)?;
            }
        }
        Ok(())
    }

    fn initialise(&mut self, connection: &mut Connection) -> Result<(), LinkError> {
        // A socket is new with every connection: no line is incomplete there.
        if matches!(self.link.kind, LinkKind::Serial | LinkKind::Scpi) {
            self.settle()?;
        }
        for init in connection.endpoint.profile().description.init.clone() {
            let send = match &init {
                Init { send: Some(send), .. } => send,
                Init { hex: Some(hex), .. } => {
                    // The profile was read: they are bytes.
                    self.transport.write(&from_hex(hex).unwrap_or_default())?;
                    continue;
                }
                _ => continue,
            };
            self.clear(connection)?;
            self.send(send)?;
            let Some(expected) = &init.expect else { continue };
            let answer = self.line(connection)?;
            if !expected.iter().any(|start| answer.starts_with(start.as_str())) {
                return Err(LinkError::Refused(format!(
                    "`{send}` was answered by `{answer}`: {}",
                    init.text
                )));
            }
        }
        Ok(())
    }

    fn go_on(mut self, connection: &mut Connection, rate_hz: Option<f64>) -> Result<Infallible, LinkError> {
        connection.tell(Ok(()));
        let now = connection.now();
        let often = |(frame, query): (FrameId, Query)| {
            (Periodic::new(rate_hz.unwrap_or(query.rate_hz), now), frame, query)
        };
        let mut asks: Vec<_> = queries(connection).into_iter().map(often).collect();
        let mut commands = Periodic::new(COMMAND_RATE_HZ, now);
        loop {
            if connection.stopping() {
                return Err(off::at_the_end(connection, &mut self));
            }
            let now = connection.now();
            if commands.is_due(now) {
                match connection.endpoint.due(now) {
                    Due::Nothing => {}
                    Due::SetPoints(set_points) => self.command(connection, &set_points)?,
                    Due::Safe(_) => self.send_off(connection)?,
                }
                commands.advance(connection.now());
            }
            for (periodic, frame, query) in &mut asks {
                if periodic.is_due(connection.now()) {
                    self.ask(connection, *frame, query)?;
                    periodic.advance(connection.now());
                }
            }
            let next = asks.iter().map(|(periodic, ..)| periodic.due).chain([commands.due]).min();
            connection.sleep_until(next);
        }
    }

    fn ask(&mut self, connection: &mut Connection, frame: FrameId, query: &Query) -> Result<(), LinkError> {
        self.clear(connection)?;
        self.send(&query.send)?;
        let bytes = match query.length {
            Some(length) => {
                let block = self.block(connection, usize::from(length))?;
                block.ok_or_else(|| format!("more than {length} bytes"))
            }
            None => {
                let line = self.line(connection)?;
                let echo = if line == query.send { ": switch the instrument's echo off" } else { "" };
                let numbers = connection.endpoint.profile().frames()[frame.0].read_line(&line);
                numbers.ok_or_else(|| format!("`{line}`{echo}"))
            }
        };
        let bytes = match bytes {
            Ok(bytes) => bytes,
            Err(by) => {
                let problem = format!("`{}` was answered by {by}", query.send);
                self.note(connection, problem.clone());
                // A few bad answers are borne.
                return if self.bad >= BAD_IN_A_ROW { Err(LinkError::Corrupt(problem)) } else { Ok(()) };
            }
        };
        self.bad = 0;
        let arrived = connection.now();
        connection.endpoint.frame(frame, &bytes, arrived)?;
        Ok(())
    }

    fn note(&mut self, connection: &Connection, problem: String) {
        let health = connection.endpoint.health();
        health.count(&health.corrupt_frames);
        health.problem(problem);
        self.bad += 1;
    }

    /// Sends the loop's command. One that drives or moves ends with the first set-point that is not taken, that comes too
    /// late or that an 'off' has overtaken, and is followed by an 'off'. One that does not goes on to its last set-point.
    fn command(&mut self, connection: &mut Connection, set_points: &[(SetId, f64)]) -> Result<(), LinkError> {
        let on = connection.endpoint.wants_on();
        let mut all = true;
        for one in set_points {
            if on && !connection.endpoint.still_wanted(connection.now()) {
                return self.send_off(connection);
            }
            all &= self.set(connection, *one)?;
            if on && !all {
                connection.endpoint.refused();
                return self.send_off(connection);
            }
        }
        if !all {
            connection.endpoint.refused();
        }
        if self.bad >= BAD_IN_A_ROW {
            let last = connection.endpoint.health().report().last_problem;
            return Err(LinkError::Corrupt(format!("set-points are not taken: {last}")));
        }
        Ok(())
    }

    /// Sends one set-point. Whether the instrument took it.
    fn set(&mut self, connection: &mut Connection, (set, value): (SetId, f64)) -> Result<bool, LinkError> {
        let profile = connection.endpoint.profile();
        self.newest.insert(set, value);
        let newest = |other| self.newest(profile, other);
        let Some((line, answer)) = profile.line(set, value, &newest) else { return Ok(true) };
        let answer = answer.map(|start| start.replace("{}", ""));
        if self.sent.get(&set).is_some_and(|(last, at)| *last == line && at.elapsed() < REPEAT) {
            return Ok(true);
        }
        self.sent.remove(&set);
        self.clear(connection)?;
        self.send(&line)?;
        if let Some(start) = answer {
            let answered = self.line(connection)?;
            if !answered.starts_with(&start) || (start.is_empty() && number(&answered).is_none()) {
                self.note(connection, format!("`{line}` was answered by `{answered}`"));
                return Ok(false);
            }
        }
        if let Some(query) = self.link.error_query.clone() {
            self.send(&query.send)?;
            let answered = self.line(connection)?;
            if !query.ok.iter().any(|ok| answered.starts_with(ok.as_str())) {
                self.note(connection, format!("`{line}` gave the error `{answered}`"));
                return Ok(false);
            }
        }
        self.sent.insert(set, (line, Instant::now()));
        Ok(true)
    }
}

impl OffWay for Talk {
    fn send_off(&mut self, connection: &mut Connection) -> Result<(), LinkError> {
        let safe = connection.endpoint.hand_out_off(connection.now());
        let patience_ms = self.patience_ms;
        self.be_patient(connection);
        self.sent.clear();
        let mut all = true;
        for one in safe {
            // An answer that stays away is not waited for twice, and keeps nothing from being sent.
            all &= match self.set(connection, one) {
                Ok(taken) => taken,
                Err(LinkError::Timeout(_) | LinkError::Cut(_) | LinkError::Corrupt(_)) => false,
                Err(ended) => return Err(ended),
            };
        }
        if !all {
            connection.endpoint.refused();
        }
        self.patience_ms = patience_ms;
        Ok(())
    }

    fn be_patient(&mut self, _connection: &Connection) {
        self.patience_ms = self.link.response_timeout_ms.max(OFF_ANSWER_MS);
    }

    fn read_state(&mut self, connection: &mut Connection) -> Result<(), LinkError> {
        queries(connection).into_iter().try_for_each(|(frame, query)| self.ask(connection, frame, &query))
    }
}

fn queries(connection: &Connection) -> Vec<(FrameId, Query)> {
    connection.endpoint.profile().queries().map(|(frame, query)| (frame, query.clone())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::endpoint::tests::{DriveSetPoint, amplifier, on};
    use std::net::{TcpListener, TcpStream};

    #[test]
    fn an_off_that_waits_ends_a_question() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let (endpoint, mut port) = amplifier();
        let (ready, _opened) = std::sync::mpsc::sync_channel(1);
        let mut connection = Connection::new(endpoint, Instant::now(), std::sync::Arc::default(), ready);
        port.push(on(1, u64::MAX));
        connection.endpoint.due(connection.now());
        port.push(DriveSetPoint { enable: false, ..on(2, u64::MAX) });
        let mut link = connection.endpoint.profile().description.link.clone();
        link.response_timeout_ms = 3_600_000;
        let transport = Transport::Tcp(TcpStream::connect(address).unwrap(), String::new());
        let mut talk = Talk::new(transport, link);
        let cut = Err(LinkError::Timeout(off::OFF_WAITS_MS));
        assert_eq!(talk.line(&mut connection), cut);
        assert_eq!(talk.block(&mut connection, 4).map(|_| String::new()), cut);
    }
}
