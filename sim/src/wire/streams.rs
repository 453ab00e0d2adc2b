//! Emulated instruments that send by themselves over a network: a stream over TCP to whoever connects, or in datagrams.

use super::device::Device;
use super::serial::frames;
use super::{Service, SharedPlant};
use instruments::LinkKind;
use std::io::{self, Write};
use std::net::{SocketAddr, TcpListener, TcpStream, UdpSocket};
use std::time::Duration;

/// How often what is due is sent.
const TURN: Duration = Duration::from_micros(500);
/// More clients than this are turned away.
const MOST_CLIENTS: usize = 8;

/// A running emulator; dropping it stops it.
pub struct NetworkStream {
    address: SocketAddr,
    _thread: Service,
}

/// Where it sends.
enum Sink {
    Tcp(TcpListener, Vec<TcpStream>),
    /// The last client, or the port that the profile states.
    Udp(UdpSocket, Option<SocketAddr>),
}

impl NetworkStream {
    /// Serves an instrument's stream at `address` (port 0 for any free one): over TCP to whoever connects, in
    /// datagrams to whoever has sent one, or to the profile's `local_port` on this machine.
    ///
    /// # Errors
    /// Where the address cannot be bound, or the profile has no stream.
    pub fn start(address: SocketAddr, mut device: Device, plant: SharedPlant) -> io::Result<Self> {
        let link = &device.profile().description.link;
        let stream = device.profile().description.stream.clone();
        let stream = stream.ok_or_else(|| io::Error::other("the profile has no stream"))?;
        let (mut sink, address) = if link.kind == LinkKind::Udp {
            let socket = UdpSocket::bind(address)?;
            socket.set_nonblocking(true)?;
            let address = socket.local_addr()?;
            let to = link.local_port.map(|port| SocketAddr::from(([127, 0, 0, 1], port)));
            (Sink::Udp(socket, to), address)
        } else {
            let listener = TcpListener::bind(address)?;
            listener.set_nonblocking(true)?;
            let address = listener.local_addr()?;
            (Sink::Tcp(listener, Vec::new()), address)
        };
        let mut due = plant.now().1;
        let turn = move |_: &_| {
            let sent = frames(&mut device, &stream, &plant, &mut due);
            sink.serve(&sent, &device);
            std::thread::sleep(TURN);
        };
        Ok(Self { address, _thread: Service::start("stream-emulator", turn)? })
    }

    /// Where it is.
    pub fn address(&self) -> SocketAddr {
        self.address
    }
}

impl Sink {
    /// Sends frames to whoever is there.
    fn serve(&mut self, sent: &[Vec<u8>], device: &Device) {
        match self {
            Sink::Tcp(listener, clients) => {
                if let (Ok((client, _)), true) = (listener.accept(), clients.len() < MOST_CLIENTS) {
                    // One that does not read is disconnected, not waited for.
                    let ready = client.set_nodelay(true).and_then(|()| client.set_nonblocking(true));
                    clients.extend(ready.is_ok().then_some(client));
                }
                clients.retain_mut(|client| sent.iter().all(|frame| client.write_all(frame).is_ok()));
            }
            Sink::Udp(socket, to) => {
                let mut datagram = [0; 1500];
                while let Ok((_, from)) = socket.recv_from(&mut datagram) {
                    if device.profile().description.link.local_port.is_none() {
                        *to = Some(from);
                    }
                }
                if let Some(to) = *to {
                    // Nobody there is no trouble of a sender's.
                    sent.iter().for_each(|frame| drop(socket.send_to(frame, to)));
                }
            }
        }
    }
}
