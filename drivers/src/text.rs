//! The conversation in lines of text and blocks of bytes, over a serial line or SCPI over TCP.
//!
//! Every set-point is absolute and is sent when it changes, and again each second. Lines that an
//! instrument sends without being asked are taken out before an answer is looked for: they must
//! never be taken for one. A binary answer is framed by its length, since its bytes may look like
//! the end of a line.

use super::endpoint::Due;
use super::modbus_tcp::resolve;
use super::serial::Line;
use super::session::{BAD_IN_A_ROW, Ended, Periodic, Session};
use super::setup::InstrumentSetup;
use instruments::codec::text::{number, quantity};
use instruments::profile::FrameKind;
use instruments::schema::{Link, LinkKind, Query};
use instruments::{FrameId, SetId};
use std::collections::HashMap;
use std::convert::Infallible;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// An unchanged set-point is sent again after this long.
const REPEAT: Duration = Duration::from_secs(1);
/// The longest line that an instrument may send.
const LONGEST_LINE: usize = 4096;
/// Silence that must follow a binary answer.
const AFTER_A_BLOCK: Duration = Duration::from_micros(1500);
/// How often commands are looked for.
const COMMAND_RATE_HZ: f64 = 500.0;

/// Starts the thread of one instrument.
///
/// # Errors
/// Where the address makes no sense or no thread can be had.
pub fn spawn(instrument: &InstrumentSetup, session: Session) -> Result<JoinHandle<()>, String> {
    let link = session.endpoint.profile().description.link.clone();
    let address = instrument.address.clone();
    let tcp = if link.kind == LinkKind::Scpi { Some(resolve(&address, link.port)?) } else { None };
    let rate_hz = instrument.rate_hz;
    session.spawn(move |session| {
        let way = match tcp {
            Some(address) => {
                let limit = Duration::from_millis(u64::from(link.connect_timeout_ms));
                let stream = TcpStream::connect_timeout(&address, limit)?;
                stream.set_nodelay(true)?;
                Way::Tcp(stream)
            }
            None => {
                let format = link.format.clone().unwrap_or_else(|| "8N1".into());
                Way::Serial(Line::open(&address, link.baud.unwrap_or(9600), &format)?)
            }
        };
        let health = session.endpoint.health();
        health.count(&health.connections);
        let mut talk = Talk::new(way, link.clone());
        talk.begin(session)?;
        talk.go_on(session, rate_hz)
    })
}

enum Way {
    Serial(Line),
    Tcp(TcpStream),
}

impl Way {
    fn read(&mut self, buffer: &mut [u8], deadline: Instant) -> Result<usize, Ended> {
        match self {
            Way::Serial(line) => line.read(buffer, deadline),
            Way::Tcp(stream) => {
                let left = deadline.saturating_duration_since(Instant::now());
                // The kernel rounds a timeout up to its tick of some milliseconds: what is only asked whether it is
                // there is asked without waiting.
                let came = if left.is_zero() {
                    stream.set_nonblocking(true)?;
                    let came = stream.read(buffer);
                    stream.set_nonblocking(false)?;
                    came
                } else {
                    stream.set_read_timeout(Some(left.max(Duration::from_micros(100))))?;
                    stream.read(buffer)
                };
                match came {
                    Ok(0) => Err(Ended::Io("the instrument closed the connection".into())),
                    Ok(count) => Ok(count),
                    Err(error)
                        if matches!(
                            error.kind(),
                            std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut
                        ) =>
                    {
                        Ok(0)
                    }
                    Err(error) => Err(error.into()),
                }
            }
        }
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), Ended> {
        match self {
            Way::Serial(line) => line.write(bytes),
            Way::Tcp(stream) => stream.write_all(bytes).map_err(Ended::from),
        }
    }
}

struct Talk {
    way: Way,
    link: Link,
    came: Vec<u8>,
    asked_at: Instant,
    sent: HashMap<SetId, (String, Instant)>,
    bad: u32,
}

impl Talk {
    fn new(way: Way, link: Link) -> Self {
        Self { way, link, came: Vec::new(), asked_at: Instant::now(), sent: HashMap::new(), bad: 0 }
    }

    fn limit(&self) -> Duration {
        Duration::from_millis(u64::from(self.link.response_timeout_ms))
    }

    /// Takes in what comes; `false` where nothing did until the deadline.
    fn take(&mut self, deadline: Instant) -> Result<bool, Ended> {
        let mut buffer = [0; 1024];
        let count = self.way.read(&mut buffer, deadline)?;
        self.came.extend_from_slice(&buffer[..count]);
        Ok(count > 0)
    }

    fn send(&mut self, line: &str) -> Result<(), Ended> {
        let gap = Duration::from_secs_f64(self.link.min_gap_ms.max(0.0) * 1e-3);
        std::thread::sleep(gap.saturating_sub(self.asked_at.elapsed()));
        let end = self.link.tx_terminator.clone().unwrap_or_else(|| "\n".into());
        self.way.write(format!("{line}{end}").as_bytes())?;
        self.asked_at = Instant::now();
        Ok(())
    }

    /// Takes whole lines that came unasked out of what came. Returns whether one was an alarm.
    fn unasked(&mut self, session: &mut Session) {
        let end = self.link.rx_terminator.clone().unwrap_or_else(|| "\n".into());
        for alarm in self.link.unsolicited.clone() {
            let line = format!("{alarm}{end}").into_bytes();
            while let Some(at) = self.came.windows(line.len()).position(|window| window == line) {
                self.came.drain(at..at + line.len());
                session.endpoint.alarm(&alarm);
            }
        }
    }

    /// Before a question nothing may be left of earlier answers.
    fn clear(&mut self, session: &mut Session) -> Result<(), Ended> {
        while self.take(Instant::now())? {}
        self.unasked(session);
        self.came.clear();
        Ok(())
    }

    /// The next line, without its end, that is no unsolicited one.
    fn line(&mut self, session: &mut Session) -> Result<String, Ended> {
        let end = self.link.rx_terminator.clone().unwrap_or_else(|| "\n".into()).into_bytes();
        let deadline = Instant::now() + self.limit();
        loop {
            self.unasked(session);
            if let Some(at) = self.came.windows(end.len()).position(|window| window == end) {
                let line: Vec<u8> = self.came.drain(..at + end.len()).take(at).collect();
                return Ok(String::from_utf8_lossy(&line).trim().to_string());
            }
            if self.came.len() > LONGEST_LINE {
                return Err(Ended::Corrupt("a line without an end".into()));
            }
            if !self.take(deadline)? && Instant::now() >= deadline {
                return Err(Ended::Timeout(self.link.response_timeout_ms));
            }
        }
    }

    /// A binary answer, framed by its length; `None` where more came than that: a line that came
    /// unasked may then stand in the middle of it.
    fn block(&mut self, session: &mut Session, length: usize) -> Result<Option<Vec<u8>>, Ended> {
        let deadline = Instant::now() + self.limit();
        loop {
            self.unasked(session);
            if self.came.len() < length {
                if !self.take(deadline)? && Instant::now() >= deadline {
                    return Err(Ended::Timeout(self.link.response_timeout_ms));
                }
            } else if !self.take(Instant::now() + AFTER_A_BLOCK)? {
                let block = std::mem::take(&mut self.came);
                return Ok((block.len() == length).then_some(block));
            }
        }
    }

    fn begin(&mut self, session: &mut Session) -> Result<(), Ended> {
        // Ends whatever an earlier connection left half said, and lets the answers to it pass.
        let quiet = Instant::now() + self.limit();
        self.send("")?;
        while self.take(quiet)? && Instant::now() < quiet {}
        self.came.clear();
        for init in session.endpoint.profile().description.init.clone() {
            let Some(send) = &init.send else { continue };
            self.clear(session)?;
            self.send(send)?;
            let Some(expected) = &init.expect else { continue };
            let answer = self.line(session)?;
            if !expected.iter().any(|start| answer.starts_with(start.as_str())) {
                return Err(Ended::Refused(format!("`{send}` was answered by `{answer}`: {}", init.text)));
            }
        }
        for (frame, query) in queries(session) {
            self.ask(session, frame, &query)?;
        }
        Ok(())
    }

    fn go_on(mut self, session: &mut Session, rate_hz: Option<f64>) -> Result<Infallible, Ended> {
        session.tell(Ok(()));
        let now = session.now();
        let mut asks: Vec<(Periodic, FrameId, Query)> = queries(session)
            .into_iter()
            .map(|(frame, query)| (Periodic::new(rate_hz.unwrap_or(query.rate_hz), now), frame, query))
            .collect();
        let mut commands = Periodic::new(COMMAND_RATE_HZ, now);
        loop {
            if session.stopping() {
                let safe = session.endpoint.safe_set_points();
                self.sent.clear();
                self.command(session, &safe)?;
                return Err(Ended::Stopped);
            }
            let now = session.now();
            if commands.is_due(now) {
                if let Due::SetPoints(set_points) | Due::Safe(set_points) = session.endpoint.due(now) {
                    self.command(session, &set_points)?;
                }
                commands.advance(session.now());
            }
            for (periodic, frame, query) in &mut asks {
                if periodic.is_due(session.now()) {
                    self.ask(session, *frame, query)?;
                    periodic.advance(session.now());
                }
            }
            let next = asks.iter().map(|(periodic, ..)| periodic.due).chain([commands.due]).min();
            session.sleep_until(next);
        }
    }

    fn ask(&mut self, session: &mut Session, frame: FrameId, query: &Query) -> Result<(), Ended> {
        self.clear(session)?;
        self.send(&query.send)?;
        let bytes = match query.length {
            Some(length) => match self.block(session, usize::from(length))? {
                Some(block) => block,
                None => {
                    return self
                        .bear(session, format!("`{}` was answered by more than {length} bytes", query.send));
                }
            },
            None => {
                let line = self.line(session)?;
                let read = match &query.unit {
                    Some(unit) => quantity(&line, unit),
                    None => number(&line),
                };
                match read {
                    Some(number) => number.to_be_bytes().to_vec(),
                    None => return self.bear(session, format!("`{}` was answered by `{line}`", query.send)),
                }
            }
        };
        self.bad = 0;
        let arrived = session.now();
        session.endpoint.frame(frame, &bytes, arrived)?;
        Ok(())
    }

    /// Bears a few bad answers.
    fn bear(&mut self, session: &Session, said: String) -> Result<(), Ended> {
        let health = session.endpoint.health();
        health.count(&health.corrupt_frames);
        health.problem(said.clone());
        self.bad += 1;
        if self.bad >= BAD_IN_A_ROW { Err(Ended::Corrupt(said)) } else { Ok(()) }
    }

    fn command(&mut self, session: &mut Session, set_points: &[(SetId, f64)]) -> Result<(), Ended> {
        for (set, value) in set_points {
            let profile = session.endpoint.profile();
            let Some((line, answer)) = profile.line(*set, *value) else { continue };
            let answer = answer.map(|start| start.replace("{}", ""));
            if self.sent.get(set).is_some_and(|(last, at)| *last == line && at.elapsed() < REPEAT) {
                continue;
            }
            self.clear(session)?;
            self.send(&line)?;
            if let Some(start) = answer {
                let said = self.line(session)?;
                if !said.starts_with(&start) || (start.is_empty() && number(&said).is_none()) {
                    self.sent.remove(set);
                    return self.bear(session, format!("`{line}` was answered by `{said}`"));
                }
            }
            if let Some(query) = self.link.error_query.clone() {
                self.send(&query.send)?;
                let said = self.line(session)?;
                if !query.ok.iter().any(|ok| said.starts_with(ok.as_str())) {
                    self.sent.remove(set);
                    return self.bear(session, format!("`{line}` gave the error `{said}`"));
                }
            }
            self.sent.insert(*set, (line, Instant::now()));
        }
        Ok(())
    }
}

fn queries(session: &Session) -> Vec<(FrameId, Query)> {
    let profile = session.endpoint.profile();
    let frames = profile.frames().iter().enumerate();
    let query = |kind: &FrameKind| match kind {
        FrameKind::Query(index) => Some(profile.description.query[*index].clone()),
        _ => None,
    };
    frames.filter_map(|(i, frame)| query(&frame.kind).map(|query| (FrameId(i), query))).collect()
}
