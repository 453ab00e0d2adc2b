//! The session over Modbus TCP.
//!
//! One thread an instrument, with a current-thread runtime that runs nothing but the one request in
//! flight. The client of tokio-modbus knows no deadline and cannot go on after a late answer (its
//! issue 324), so every request has one here, and after any of them passes the connection is dropped
//! and made anew. An answer that comes late then finds no socket: it can never become a force.

use super::Session;
use super::endpoint::{BadFrame, Due};
use super::setup::InstrumentSetup;
use instruments::FrameId;
use instruments::schema::{Poll, Table};
use realtime::ports::{Nanos, NoData};
use std::future::Future;
use std::net::{SocketAddr, ToSocketAddrs};
use std::thread::JoinHandle;
use std::time::Duration;
use tokio::runtime::Runtime;
use tokio_modbus::client::{Context, Reader, Writer, tcp};
use tokio_modbus::prelude::Slave;

/// So many refusals in a row end the connection.
const EXCEPTIONS_IN_A_ROW: u32 = 3;
/// The thread looks at least this often whether it is to stop.
const LONGEST_SLEEP: Duration = Duration::from_millis(20);

/// Why a connection ended.
#[derive(Debug, thiserror::Error)]
enum Ended {
    #[error("stopped")]
    Stopped,
    #[error("no answer within {0} ms")]
    Timeout(u32),
    #[error("{0}")]
    Io(String),
    #[error("the instrument refused {EXCEPTIONS_IN_A_ROW} requests in a row: {0}")]
    Refused(String),
    #[error(transparent)]
    Frame(#[from] BadFrame),
}

/// Starts the thread of one instrument.
///
/// # Errors
/// Where the address makes no sense or no thread can be had.
pub fn spawn(instrument: &InstrumentSetup, session: Session) -> Result<JoinHandle<()>, String> {
    let link = &session.endpoint.profile().description.link;
    let address = resolve(&instrument.address, link.port)?;
    let unit = instrument.unit.or(link.unit).unwrap_or(255);
    let runtime =
        tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(|e| e.to_string())?;
    let rate = instrument.rate_hz;
    let mut line = Line { session, runtime, address, unit, rate_hz: rate, exceptions: 0, block: Vec::new() };
    std::thread::Builder::new()
        .name(format!("link {}", instrument.profile).chars().take(15).collect())
        .spawn(move || line.run())
        .map_err(|error| error.to_string())
}

/// `host`, `host:port` or a literal address, with the profile's port where none is given.
fn resolve(address: &str, port: Option<u16>) -> Result<SocketAddr, String> {
    let with_port = if address.to_socket_addrs().is_ok() {
        address.to_string()
    } else {
        format!("{address}:{}", port.ok_or("neither the address nor the profile names a port")?)
    };
    let mut found =
        with_port.to_socket_addrs().map_err(|error| format!("`{address}` cannot be resolved: {error}"))?;
    found.next().ok_or_else(|| format!("`{address}` stands for no address"))
}

struct Line {
    session: Session,
    runtime: Runtime,
    address: SocketAddr,
    unit: u8,
    rate_hz: Option<f64>,
    exceptions: u32,
    block: Vec<u8>,
}

/// Something that happens again and again.
struct Periodic {
    period: Duration,
    due: Nanos,
}

impl Periodic {
    fn new(rate_hz: f64, now: Nanos) -> Self {
        Self { period: Duration::from_secs_f64(1.0 / rate_hz), due: now }
    }

    /// The next time after this one; missed ones are left out, so that a pause makes no burst.
    fn advance(&mut self, now: Nanos) {
        let period = u64::try_from(self.period.as_nanos()).unwrap_or(u64::MAX).max(1);
        let missed = now.since(self.due).0 / period;
        self.due = Nanos(self.due.0 + (missed + 1) * period);
    }
}

impl Line {
    fn run(&mut self) {
        let link = &self.session.endpoint.profile().description.link;
        let first = Duration::from_millis(u64::from(link.backoff_first_ms));
        let longest = Duration::from_millis(u64::from(link.backoff_longest_ms));
        let health = self.session.endpoint.health();
        let mut pause = first;
        while !self.session.stopping() {
            let samples_before = health.report().samples;
            let ended = match self.connect() {
                Ok(context) => {
                    health.count(&health.connections);
                    match self.converse(context) {
                        Ok(never) => match never {},
                        Err(ended) => ended,
                    }
                }
                Err(ended) => ended,
            };
            self.session.endpoint.link_down(NoData::Disconnected);
            if matches!(ended, Ended::Stopped) {
                break;
            }
            if matches!(ended, Ended::Timeout(_)) {
                health.count(&health.timeouts);
            }
            health.problem(ended.to_string());
            tracing::warn!(instrument = self.session.endpoint.profile().id(), address = %self.address, %ended, "the link went down");
            if self.session.tell(Err(ended.to_string())) {
                return; // whoever opened the rig wants to know, not to wait
            }
            // A connection that gave samples was a good one: begin with the short pause again.
            pause = if health.report().samples > samples_before { first } else { (2 * pause).min(longest) };
            self.wait(pause);
        }
    }

    /// Sleeps, but not through a stop; commands that come meanwhile are dropped, not kept.
    fn wait(&mut self, pause: Duration) {
        let until = self.session.now().plus(Nanos(u64::try_from(pause.as_nanos()).unwrap_or(u64::MAX)));
        while self.session.now() < until && !self.session.stopping() {
            std::thread::sleep(Duration::from_nanos(until.since(self.session.now()).0).min(LONGEST_SLEEP));
            self.session.endpoint.discard_commands();
        }
    }

    fn connect(&self) -> Result<Context, Ended> {
        let limit = self.session.endpoint.profile().description.link.connect_timeout_ms;
        let (address, unit) = (self.address, self.unit);
        self.within(limit, async move {
            let stream = tokio::net::TcpStream::connect(address).await?;
            stream.set_nodelay(true)?;
            // When the connection is dropped, what the kernel still holds is discarded: a command
            // queued before an outage must not be delivered after it.
            stream.set_zero_linger()?;
            Ok(tcp::attach_slave(stream, Slave(unit)))
        })?
        .map_err(|error: std::io::Error| Ended::Io(error.to_string()))
    }

    /// Runs one request against its deadline.
    fn within<T>(&self, limit_ms: u32, request: impl Future<Output = T>) -> Result<T, Ended> {
        let limit = Duration::from_millis(u64::from(limit_ms));
        self.runtime
            .block_on(async { tokio::time::timeout(limit, request).await })
            .map_err(|_| Ended::Timeout(limit_ms))
    }

    /// Reads and writes until something is wrong with the connection.
    fn converse(&mut self, mut context: Context) -> Result<std::convert::Infallible, Ended> {
        self.exceptions = 0;
        let description = &self.session.endpoint.profile().description;
        let polls: Vec<(FrameId, Poll)> =
            description.poll.iter().enumerate().map(|(i, poll)| (FrameId(i), poll.clone())).collect();
        let block = description.write.first().cloned();
        self.block = vec![0; block.as_ref().map_or(0, |block| 2 * usize::from(block.count))];
        // Everything once: then the signature is judged, before anything is commanded.
        for (frame, poll) in &polls {
            self.read(&mut context, *frame, poll)?;
        }
        self.session.tell(Ok(()));
        let now = self.session.now();
        let mut reads: Vec<(Periodic, &(FrameId, Poll))> = polls
            .iter()
            .filter_map(|poll| {
                poll.1.rate_hz.map(|rate| (Periodic::new(self.rate_hz.unwrap_or(rate), now), poll))
            })
            .collect();
        let mut write = block.as_ref().map(|block| Periodic::new(block.rate_hz.unwrap_or(100.0), now));
        loop {
            if self.session.stopping() {
                let safe = self.session.endpoint.safe_set_points();
                if let (false, Some(block)) = (safe.is_empty(), &block) {
                    self.write(&mut context, block.address, &safe)?;
                }
                return Err(Ended::Stopped);
            }
            let now = self.session.now();
            if let (Some(periodic), Some(block)) =
                (write.as_mut().filter(|periodic| periodic.due <= now), &block)
            {
                if let Due::SetPoints(set_points) = self.session.endpoint.due(now) {
                    self.write(&mut context, block.address, &set_points)?;
                }
                periodic.advance(self.session.now());
            }
            for (periodic, (frame, poll)) in &mut reads {
                if periodic.due <= self.session.now() {
                    self.read(&mut context, *frame, poll)?;
                    periodic.advance(self.session.now());
                }
            }
            let next =
                reads.iter().map(|(periodic, _)| periodic.due).chain(write.as_ref().map(|w| w.due)).min();
            let pause =
                next.map_or(LONGEST_SLEEP, |next| Duration::from_nanos(next.since(self.session.now()).0));
            std::thread::sleep(pause.min(LONGEST_SLEEP));
        }
    }

    fn read(&mut self, context: &mut Context, frame: FrameId, poll: &Poll) -> Result<(), Ended> {
        let limit = self.session.endpoint.profile().description.link.response_timeout_ms;
        let answer = match poll.table {
            Table::Holding => self.within(limit, context.read_holding_registers(poll.address, poll.count))?,
            Table::Input => self.within(limit, context.read_input_registers(poll.address, poll.count))?,
        };
        let arrived = self.session.now();
        if let Some(registers) = self.judge(answer)? {
            let bytes: Vec<u8> = registers.iter().flat_map(|register| register.to_be_bytes()).collect();
            // The library checks the length only in debug builds; a short answer is refused here.
            self.session.endpoint.frame(frame, &bytes, arrived)?;
        }
        Ok(())
    }

    fn write(
        &mut self,
        context: &mut Context,
        address: u16,
        set_points: &[(instruments::SetId, f64)],
    ) -> Result<(), Ended> {
        for (set, value) in set_points {
            // Ranges were checked when the command was taken.
            let _ = self.session.endpoint.profile().encode_set(*set, *value, &mut self.block);
        }
        let words: Vec<u16> =
            self.block.chunks_exact(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]])).collect();
        let limit = self.session.endpoint.profile().description.link.response_timeout_ms;
        let answer = self.within(limit, context.write_multiple_registers(address, &words))?;
        self.judge(answer)?;
        Ok(())
    }

    /// Tells 'the instrument refused' from 'we could not talk'. The first is borne a few times.
    fn judge<T>(&mut self, answer: tokio_modbus::Result<T>) -> Result<Option<T>, Ended> {
        match answer {
            Ok(Ok(value)) => {
                self.exceptions = 0;
                Ok(Some(value))
            }
            Ok(Err(exception)) => {
                let health = self.session.endpoint.health();
                health.count(&health.exceptions);
                health.problem(format!("the instrument refused a request: {exception}"));
                self.exceptions += 1;
                // Before the first sample there is nothing to bear with: the map is wrong.
                if self.exceptions >= EXCEPTIONS_IN_A_ROW || self.session.ready.is_some() {
                    return Err(Ended::Refused(exception.to_string()));
                }
                Ok(None)
            }
            Err(error) => Err(Ended::Io(error.to_string())),
        }
    }
}
