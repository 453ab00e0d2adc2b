//! Registers over Modbus TCP.
//!
//! One thread an instrument, with a current-thread runtime that runs nothing but the one request in
//! flight. The client of tokio-modbus knows no deadline and cannot go on after a late answer (its
//! issue 324), so every request has one here, and after any of them passes the connection is dropped
//! and made anew. An answer that comes late then finds no socket: it can never become a force.

use super::connection::{Connection, Spawned};
use super::link_error::{AddressError, LinkError};
use super::modbus::{Conversation, Registers, Trouble};
use super::off::{LOOK_EVERY, PendingOff};
use super::setup::InstrumentSetup;
use super::trace::Traced;
use instruments::schema::Table;
use realtime::{Clock, Nanos};
use std::future::Future;
use std::net::{SocketAddr, ToSocketAddrs};
use std::time::Duration;
use tokio::runtime::Runtime;
use tokio_modbus::client::{Context, Reader, Writer, tcp};
use tokio_modbus::prelude::Slave;

/// Starts the thread of one instrument.
pub(crate) fn spawn(instrument: &InstrumentSetup, connection: Connection) -> Spawned {
    let link = &connection.endpoint.profile().description.link;
    let address = resolve(&instrument.address, link.port)?;
    let unit = instrument.unit.or(link.unit).unwrap_or(255);
    let (connect_ms, answer_ms) = (link.connect_timeout_ms, link.response_timeout_ms);
    let rate_hz = instrument.rate_hz;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    connection.spawn(move |connection| {
        let clock = connection.clock.clock().clone();
        let mut wire = Tcp::connect((&runtime, &clock), address, unit, connect_ms, answer_ms)?;
        wire.pending_off = connection.pending_off.clone();
        let health = connection.endpoint.health();
        health.count(&health.connections);
        Conversation::begin(connection, &mut wire)?.go_on(connection, rate_hz)
    })
}

/// `host`, `host:port` or a literal address, with the profile's port where none is given.
///
/// # Errors
/// Where it stands for no address.
pub fn resolve(address: &str, port: Option<u16>) -> Result<SocketAddr, AddressError> {
    if address.starts_with('/') {
        return Err(AddressError::Serial(address.into()));
    }
    let with_port = if address.to_socket_addrs().is_ok() {
        address.to_string()
    } else {
        format!("{address}:{}", port.ok_or(AddressError::NoPort)?)
    };
    let found = with_port.to_socket_addrs();
    let mut found = found.map_err(|_| AddressError::Unknown(address.into()))?;
    found.next().ok_or_else(|| AddressError::Empty(address.into()))
}

/// Runs one request against its deadline: an 'off' that waits brings it nearer, a held clock does not.
fn within<T>(
    (runtime, clock): (&Runtime, &Clock),
    (limit_ms, pending_off): (u32, &PendingOff),
    request: impl Future<Output = T>,
) -> Result<T, LinkError> {
    let by = |limit_ms: u32| clock.now().plus(Nanos(u64::from(limit_ms) * 1_000_000));
    let mut deadline = by(limit_ms);
    runtime.block_on(async {
        let mut request = std::pin::pin!(request);
        loop {
            deadline = deadline.min(by(pending_off.limit_ms(limit_ms)));
            let left = Duration::from_nanos(deadline.since(clock.now()).0).min(LOOK_EVERY);
            if let Ok(answer) = tokio::time::timeout(left, request.as_mut()).await {
                return Ok(answer);
            }
            if deadline <= clock.now() {
                return Err(LinkError::Timeout(pending_off.limit_ms(limit_ms)));
            }
        }
    })
}

/// A connection whose every request has a deadline. After any error it must be dropped.
pub struct Tcp<'a> {
    runtime: (&'a Runtime, &'a Clock),
    context: Context,
    answer_ms: u32,
    pub(crate) pending_off: PendingOff,
}

impl<'a> Tcp<'a> {
    /// Connects to a unit within `connect_ms`; answers may take `answer_ms`.
    ///
    /// # Errors
    /// Nobody there, or not in time.
    pub fn connect(
        runtime: (&'a Runtime, &'a Clock),
        address: SocketAddr,
        unit: u8,
        connect_ms: u32,
        answer_ms: u32,
    ) -> Result<Self, LinkError> {
        let pending_off = PendingOff::default();
        let context = within(runtime, (connect_ms, &pending_off), async move {
            let stream = tokio::net::TcpStream::connect(address).await?;
            stream.set_nodelay(true)?;
            // When the connection is dropped, what the kernel still holds is discarded: a command
            // queued before an outage must not be delivered after it.
            stream.set_zero_linger()?;
            let traced = Traced { inner: stream, port: address.to_string() };
            Ok(tcp::attach_slave(traced, Slave(unit)))
        })?
        .map_err(|error: std::io::Error| LinkError::from(error))?;
        Ok(Tcp { runtime, context, answer_ms, pending_off })
    }
}

/// What is wrong with an answer whose head does not fit its question, in words.
fn mismatch(error: &tokio_modbus::Error) -> String {
    use tokio_modbus::{Error, ProtocolError};
    match error {
        Error::Protocol(ProtocolError::HeaderMismatch { message, .. }) => {
            let number = |half: &str, name: &str| -> Option<u32> {
                let rest = half.split_once(&format!("{name}: "))?.1;
                rest.split(|c: char| !c.is_ascii_digit()).next()?.parse().ok()
            };
            let (expected, came) = message.split_once("actual").unwrap_or((message, ""));
            let both = |name: &str| Some((number(expected, name)?, number(came, name)?));
            match (both("unit_id"), both("transaction_id")) {
                (Some((expected, came)), _) if expected != came => format!(
                    "another unit answers, {came} in place of {expected}: set `unit` to the one that is meant (255 or 0 for a device \
                     without a gateway)"
                ),
                (_, Some((expected, came))) if expected != came => format!(
                    "an answer carries transaction {came} in place of {expected}: a gateway that does not number as Modbus TCP does is reached \
                     as RTU over TCP (address tcp:HOST:PORT with a profile of kind modbus_rtu)"
                ),
                _ => "an answer carries another head than its question".into(),
            }
        }
        Error::Protocol(ProtocolError::FunctionCodeMismatch { request, .. }) => {
            format!(
                "another function than {request} was answered: the transaction is another program's, or the device mixes them up"
            )
        }
        other => other.to_string(),
    }
}

/// Parts what tokio-modbus parts: an exception of the instrument, and trouble on the way.
fn part<T>(answer: Result<tokio_modbus::Result<T>, LinkError>) -> Result<T, Trouble> {
    match answer {
        Ok(Ok(Ok(value))) => Ok(value),
        Ok(Ok(Err(exception))) => Err(Trouble::Refused(super::remedy::exception(exception.into()))),
        Ok(Err(error)) => Err(Trouble::LinkError(LinkError::Io(mismatch(&error)))),
        Err(ended) => Err(Trouble::LinkError(ended)),
    }
}

impl Registers for Tcp<'_> {
    fn read(&mut self, table: Table, address: u16, count: u16) -> Result<Vec<u8>, Trouble> {
        let (runtime, limit, wire) = (self.runtime, (self.answer_ms, &self.pending_off), &mut self.context);
        let bits = |bits: Vec<bool>| bits.into_iter().map(u16::from).collect();
        let registers: Vec<u16> = match table {
            Table::Holding => part(within(runtime, limit, wire.read_holding_registers(address, count)))?,
            Table::Input => part(within(runtime, limit, wire.read_input_registers(address, count)))?,
            Table::Coil => bits(part(within(runtime, limit, wire.read_coils(address, count)))?),
            Table::Discrete => bits(part(within(runtime, limit, wire.read_discrete_inputs(address, count)))?),
        };
        Ok(registers.iter().flat_map(|register| register.to_be_bytes()).collect())
    }

    fn write(&mut self, table: Table, address: u16, registers: &[u16]) -> Result<(), Trouble> {
        let (runtime, limit) = (self.runtime, (self.answer_ms, &self.pending_off));
        if table.is_bits() {
            let coils: Vec<bool> = registers.iter().map(|register| *register != 0).collect();
            return part(within(runtime, limit, self.context.write_multiple_coils(address, &coils)));
        }
        part(within(runtime, limit, self.context.write_multiple_registers(address, registers)))
    }

    fn wait_up_to(&mut self, answer_ms: u32) {
        self.answer_ms = answer_ms;
    }
}

#[cfg(test)]
mod tests;
