//! A Modbus TCP server over emulated instruments, one unit each.

use super::SharedPlant;
use super::device::{Device, Refused};
use instruments::schema::Table;
use realtime::threads;
use std::collections::BTreeMap;
use std::future::{Future, Ready, ready};
use std::io;
use std::net::{SocketAddr, TcpListener};
use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::sync::oneshot;
use tokio_modbus::prelude::{ExceptionCode, Request, Response, SlaveRequest};
use tokio_modbus::server::Service;
use tokio_modbus::server::tcp::Server;

/// More clients than this are turned away, so that no flood exhausts the host.
pub const MOST_CLIENTS: usize = 32;
/// Where all places are taken, a client without a request for so long makes room for a new one: the rule of
/// the Modbus messaging guide (V1.0b, 4.2.2), which closes the connection that was unused for longest.
pub const IDLE: Duration = Duration::from_secs(2);
/// The world is brought up to now at least so often: the first question after a long silence is answered as fast as any.
const KEEP_UP: Duration = Duration::from_millis(50);

/// A running server; dropping it stops the server.
pub struct ModbusTcpServer {
    address: SocketAddr,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl ModbusTcpServer {
    /// Serves `devices` by unit at `address` (port 0 for any free one), on a thread of its own.
    ///
    /// # Errors
    /// Where the address cannot be bound.
    pub fn start(address: SocketAddr, devices: BTreeMap<u8, Device>, plant: SharedPlant) -> io::Result<Self> {
        let listener = TcpListener::bind(address)?;
        listener.set_nonblocking(true)?;
        plant.clock.serves(&listener);
        let address = listener.local_addr()?;
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        let (stop, stopped) = oneshot::channel();
        let units = Arc::new(Units { devices: Mutex::new(devices), plant });
        let thread = threads::spawn("modbus-tcp", move || {
            runtime.block_on(async move {
                if let Err(error) = serve(listener, units, stopped).await {
                    tracing::error!(%error, "the Modbus TCP server ended");
                }
            });
        })?;
        Ok(Self { address, stop: Some(stop), thread: Some(thread) })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }
}

impl Drop for ModbusTcpServer {
    fn drop(&mut self) {
        drop(self.stop.take());
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

async fn serve(listener: TcpListener, units: Arc<Units>, stopped: oneshot::Receiver<()>) -> io::Result<()> {
    let server = Server::new(tokio::net::TcpListener::from_std(listener)?);
    let places = Arc::new(Places::default());
    let plant = units.plant.clone();
    let on_connected = move |stream: tokio::net::TcpStream, peer: SocketAddr| {
        let (units, places) = (Arc::clone(&units), Arc::clone(&places));
        async move {
            let Some((place, evicted)) = places.take() else {
                tracing::warn!(%peer, "turned away: {MOST_CLIENTS} clients are connected");
                return Ok(None);
            };
            stream.set_nodelay(true)?;
            Ok(Some((Client { units, places, place }, Connection { stream, evicted })))
        }
    };
    let stopped = async move {
        let mut stopped = std::pin::pin!(stopped);
        while tokio::time::timeout(KEEP_UP, stopped.as_mut()).await.is_err() {
            drop(plant.now());
        }
    };
    server.serve_until(&on_connected, |error| tracing::debug!(%error, "a client was lost"), stopped).await?;
    Ok(())
}

/// The places of the connected clients.
#[derive(Default)]
struct Places(Mutex<(u64, Vec<Place>)>);

struct Place {
    number: u64,
    used: Instant,
    /// Dropping it ends the connection.
    _evicts: oneshot::Sender<()>,
}

impl Places {
    /// A place for a new client, and what tells it to leave. `None` where all are taken by clients that are at work.
    fn take(&self) -> Option<(u64, oneshot::Receiver<()>)> {
        let mut held = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let (number, places) = &mut *held;
        if places.len() >= MOST_CLIENTS {
            let idlest = (0..places.len()).min_by_key(|&i| places[i].used)?;
            if places[idlest].used.elapsed() < IDLE {
                return None;
            }
            places.swap_remove(idlest);
        }
        *number += 1;
        let (evicts, evicted) = oneshot::channel();
        places.push(Place { number: *number, used: Instant::now(), _evicts: evicts });
        Some((*number, evicted))
    }

    fn with(&self, number: u64, change: impl FnOnce(&mut Vec<Place>, usize)) {
        let mut held = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(at) = held.1.iter().position(|place| place.number == number) {
            change(&mut held.1, at);
        }
    }
}

/// A client's connection until its place is given to another.
struct Connection {
    stream: tokio::net::TcpStream,
    evicted: oneshot::Receiver<()>,
}

impl AsyncRead for Connection {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buf: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        if Pin::new(&mut self.evicted).poll(cx).is_ready() {
            return Poll::Ready(Err(io::Error::other("idle, and its place was wanted")));
        }
        Pin::new(&mut self.stream).poll_read(cx, buf)
    }
}

impl AsyncWrite for Connection {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.stream).poll_write(cx, bytes)
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(cx)
    }
}

struct Units {
    devices: Mutex<BTreeMap<u8, Device>>,
    plant: SharedPlant,
}

/// One connected client; leaving frees its place.
struct Client {
    units: Arc<Units>,
    places: Arc<Places>,
    place: u64,
}

impl Drop for Client {
    fn drop(&mut self) {
        self.places.with(self.place, |places, at| drop(places.swap_remove(at)));
    }
}

impl Service for Client {
    type Request = SlaveRequest<'static>;
    type Response = Response;
    type Exception = ExceptionCode;
    type Future = Ready<Result<Response, ExceptionCode>>;

    fn call(&self, request: Self::Request) -> Self::Future {
        self.places.with(self.place, |places, at| places[at].used = Instant::now());
        ready(self.units.answer(request.slave, request.request))
    }
}

impl Units {
    fn answer(&self, unit: u8, request: Request<'static>) -> Result<Response, ExceptionCode> {
        let mut devices = self.devices.lock().unwrap_or_else(PoisonError::into_inner);
        let device = devices.get_mut(&unit).ok_or(ExceptionCode::GatewayTargetDevice)?;
        let (mut plant, now) = self.plant.now();
        let refused = |refused| match refused {
            Refused::Address => ExceptionCode::IllegalDataAddress,
            Refused::Value => ExceptionCode::IllegalDataValue,
        };
        let counted = |count: u16| {
            if (1..=125).contains(&count) { Ok(count) } else { Err(ExceptionCode::IllegalDataValue) }
        };
        let listed = |length: usize| counted(u16::try_from(length).unwrap_or(u16::MAX));
        let mut read = |table, address, count| {
            device.read(table, address, counted(count)?, &mut *plant, now).map_err(refused)
        };
        let (table, address, words, done) = match request {
            Request::ReadHoldingRegisters(at, count) => {
                return read(Table::Holding, at, count).map(Response::ReadHoldingRegisters);
            }
            Request::ReadInputRegisters(at, count) => {
                return read(Table::Input, at, count).map(Response::ReadInputRegisters);
            }
            Request::ReadCoils(at, count) => {
                return read(Table::Coil, at, count).map(|coils| Response::ReadCoils(bits(&coils)));
            }
            Request::ReadDiscreteInputs(at, count) => {
                return read(Table::Discrete, at, count)
                    .map(|inputs| Response::ReadDiscreteInputs(bits(&inputs)));
            }
            Request::WriteSingleCoil(at, closed) => {
                (Table::Coil, at, vec![u16::from(closed)], Response::WriteSingleCoil(at, closed))
            }
            Request::WriteMultipleCoils(at, coils) => {
                let words = coils.iter().map(|closed| u16::from(*closed)).collect();
                (Table::Coil, at, words, Response::WriteMultipleCoils(at, listed(coils.len())?))
            }
            Request::WriteSingleRegister(at, word) => {
                (Table::Holding, at, vec![word], Response::WriteSingleRegister(at, word))
            }
            Request::WriteMultipleRegisters(at, words) => (
                Table::Holding,
                at,
                words.to_vec(),
                Response::WriteMultipleRegisters(at, listed(words.len())?),
            ),
            _ => return Err(ExceptionCode::IllegalFunction),
        };
        device.write(table, address, &words, &mut *plant).map(|()| done).map_err(refused)
    }
}

fn bits(registers: &[u16]) -> Vec<bool> {
    registers.iter().map(|register| *register != 0).collect()
}
