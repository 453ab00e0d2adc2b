//! A Modbus TCP server over emulated instruments, one unit each.

use super::SharedPlant;
use super::device::{Device, Refused};
use instruments::schema::Table;
use std::collections::BTreeMap;
use std::future::{Ready, ready};
use std::io;
use std::net::{SocketAddr, TcpListener};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use tokio_modbus::prelude::{ExceptionCode, Request, Response, SlaveRequest};
use tokio_modbus::server::Service;
use tokio_modbus::server::tcp::Server;

/// More clients than this are turned away, so that no flood exhausts the host.
pub const MOST_CLIENTS: usize = 32;

/// A running server; dropping it stops the server.
pub struct ModbusTcpServer {
    address: SocketAddr,
    stop: Option<tokio::sync::oneshot::Sender<()>>,
    thread: Option<std::thread::JoinHandle<()>>,
}

impl ModbusTcpServer {
    /// Serves `devices` by unit at `address` (port 0 for any free one), on a thread of its own.
    ///
    /// # Errors
    /// Where the address cannot be bound.
    pub fn start(address: SocketAddr, devices: BTreeMap<u8, Device>, plant: SharedPlant) -> io::Result<Self> {
        let listener = TcpListener::bind(address)?;
        listener.set_nonblocking(true)?;
        let address = listener.local_addr()?;
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        let (stop, stopped) = tokio::sync::oneshot::channel();
        let units = Arc::new(Units { devices: Mutex::new(devices), plant });
        let thread = std::thread::Builder::new().name("modbus-tcp".into()).spawn(move || {
            runtime.block_on(async move {
                if let Err(error) = serve(listener, units, stopped).await {
                    tracing::error!(%error, "the Modbus TCP server ended");
                }
            });
        })?;
        Ok(Self { address, stop: Some(stop), thread: Some(thread) })
    }

    /// Where it listens.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }
}

impl Drop for ModbusTcpServer {
    fn drop(&mut self) {
        drop(self.stop.take());
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

async fn serve(
    listener: TcpListener,
    units: Arc<Units>,
    stopped: tokio::sync::oneshot::Receiver<()>,
) -> io::Result<()> {
    let server = Server::new(tokio::net::TcpListener::from_std(listener)?);
    let clients = Arc::new(AtomicUsize::new(0));
    let on_connected = move |stream: tokio::net::TcpStream, peer: SocketAddr| {
        let (units, clients) = (Arc::clone(&units), Arc::clone(&clients));
        async move {
            if clients.fetch_add(1, Ordering::Relaxed) >= MOST_CLIENTS {
                clients.fetch_sub(1, Ordering::Relaxed);
                tracing::warn!(%peer, "turned away: {MOST_CLIENTS} clients are connected");
                return Ok(None);
            }
            stream.set_nodelay(true)?;
            Ok(Some((Client { units, clients }, stream)))
        }
    };
    let stopped = async {
        let _ = stopped.await;
    };
    server.serve_until(&on_connected, |error| tracing::debug!(%error, "a client was lost"), stopped).await?;
    Ok(())
}

struct Units {
    devices: Mutex<BTreeMap<u8, Device>>,
    plant: SharedPlant,
}

/// One connected client; leaving frees its place.
struct Client {
    units: Arc<Units>,
    clients: Arc<AtomicUsize>,
}

impl Drop for Client {
    fn drop(&mut self) {
        self.clients.fetch_sub(1, Ordering::Relaxed);
    }
}

impl Service for Client {
    type Request = SlaveRequest<'static>;
    type Response = Response;
    type Exception = ExceptionCode;
    type Future = Ready<Result<Response, ExceptionCode>>;

    fn call(&self, request: Self::Request) -> Self::Future {
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
        match request {
            Request::ReadHoldingRegisters(address, count) => device
                .read(Table::Holding, address, counted(count)?, &mut *plant, now)
                .map(Response::ReadHoldingRegisters)
                .map_err(refused),
            Request::ReadInputRegisters(address, count) => device
                .read(Table::Input, address, counted(count)?, &mut *plant, now)
                .map(Response::ReadInputRegisters)
                .map_err(refused),
            Request::WriteSingleRegister(address, word) => device
                .write(address, &[word], &mut *plant)
                .map(|()| Response::WriteSingleRegister(address, word))
                .map_err(refused),
            Request::WriteMultipleRegisters(address, words) => {
                let count = counted(u16::try_from(words.len()).unwrap_or(u16::MAX))?;
                device
                    .write(address, &words, &mut *plant)
                    .map(|()| Response::WriteMultipleRegisters(address, count))
                    .map_err(refused)
            }
            _ => Err(ExceptionCode::IllegalFunction),
        }
    }
}
