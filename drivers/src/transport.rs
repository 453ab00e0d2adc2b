//! What carries lines of text, blocks of bytes and streams: a serial line, TCP, datagrams, or the attributes
//! of a device that the kernel drives.

use super::link_error::{AddressError, LinkError};
use super::modbus_tcp::resolve;
use super::serial::Line;
use super::trace;
use instruments::schema::{Link, LinkKind};
use std::io::{ErrorKind, Read, Write};
use std::net::{IpAddr, SocketAddr, TcpStream, UdpSocket};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Where an instrument of lines or streams is, before it is connected.
#[derive(Debug, Clone)]
pub enum Address {
    /// A serial line: path, symbols per second, format.
    Serial(String, u32, String),
    /// A socket, a device server's in front of a serial line included.
    Tcp(SocketAddr),
    /// Datagrams: where the instrument is, and the port here that it is set to send to.
    Udp(SocketAddr, Option<u16>),
    /// A folder of attributes.
    Folder(PathBuf),
}

impl Address {
    /// The address of an instrument by its link.
    ///
    /// # Errors
    /// Where it makes no sense.
    pub fn of(address: &str, link: &Link, baud: Option<u32>) -> Result<Self, AddressError> {
        let network = matches!(link.kind, LinkKind::Scpi | LinkKind::Tcp | LinkKind::Udp);
        match (address.strip_prefix("tcp:"), link.kind) {
            (_, LinkKind::Sysfs) => Ok(Self::Folder(address.into())),
            (_, LinkKind::Udp) => Ok(Self::Udp(resolve(address, link.port)?, link.local_port)),
            (Some(host), _) => Ok(Self::Tcp(resolve(host, link.port)?)),
            (None, _) if network => Ok(Self::Tcp(resolve(address, link.port)?)),
            (None, _) => {
                let baud = baud.or(link.baud).unwrap_or(9600);
                Ok(Self::Serial(address.into(), baud, link.line_format().into()))
            }
        }
    }

    /// Opens it within `limit`.
    ///
    /// # Errors
    /// Where nobody is there, or the port cannot be had.
    pub fn open(&self, limit: Duration) -> Result<Transport, LinkError> {
        match self {
            Self::Folder(path) if path.is_dir() => Ok(Transport::Folder(path.clone(), Vec::new())),
            Self::Folder(path) => Err(LinkError::Io(format!("{} is not a folder", path.display()))),
            Self::Serial(path, baud, format) => Ok(Transport::Serial(Line::open(path, *baud, format)?)),
            Self::Tcp(address) => {
                let stream = TcpStream::connect_timeout(address, limit)?;
                stream.set_nodelay(true)?;
                Ok(Transport::Tcp(stream, address.to_string()))
            }
            Self::Udp(address, local_port) => {
                let unspecified: IpAddr =
                    if address.is_ipv4() { [0, 0, 0, 0].into() } else { [0_u16; 8].into() };
                let socket = UdpSocket::bind((unspecified, local_port.unwrap_or(0))).map_err(|error| {
                    LinkError::Io(format!("UDP port {} of this machine: {error}", local_port.unwrap_or(0)))
                })?;
                if local_port.is_none() {
                    // What others send is then not even seen.
                    socket.connect(address)?;
                }
                Ok(Transport::Udp(socket, *address, address.to_string()))
            }
        }
    }
}

/// A connection, with its name in the trace.
pub enum Transport {
    /// A serial line.
    Serial(Line),
    /// A socket.
    Tcp(TcpStream, String),
    /// Datagrams from and to one instrument.
    Udp(UdpSocket, SocketAddr, String),
    /// A folder of attributes, and what was read of them and not taken yet.
    Folder(PathBuf, Vec<u8>),
}

impl Transport {
    /// Reads what comes until `deadline`; zero bytes mean that it passed.
    ///
    /// # Errors
    /// Where the connection is gone.
    pub fn read(&mut self, buffer: &mut [u8], deadline: Instant) -> Result<usize, LinkError> {
        let left = deadline.saturating_duration_since(Instant::now());
        match self {
            Transport::Serial(line) => line.read(buffer, deadline),
            Transport::Folder(_, came) => {
                if came.is_empty() {
                    std::thread::sleep(left);
                }
                let count = (&came[..]).read(buffer)?;
                came.drain(..count);
                Ok(count)
            }
            Transport::Tcp(stream, port) => {
                // The kernel rounds a timeout up to its tick of some milliseconds, so a check does not wait.
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
                    Ok(0) => Err(LinkError::Io("the instrument closed the connection".into())),
                    Ok(count) => {
                        trace::received(port, &buffer[..count]);
                        Ok(count)
                    }
                    Err(error) if passed(&error) => Ok(0),
                    Err(error) => Err(error.into()),
                }
            }
            Transport::Udp(socket, instrument, port) => {
                socket.set_read_timeout(Some(left.max(Duration::from_micros(100))))?;
                match socket.recv_from(buffer) {
                    Ok((count, from)) if from.ip() == instrument.ip() => {
                        trace::received(port, &buffer[..count]);
                        Ok(count)
                    }
                    // Another machine's: not this instrument's.
                    Ok(_) => Ok(0),
                    Err(error) if passed(&error) => Ok(0),
                    Err(error) if error.kind() == ErrorKind::ConnectionRefused => {
                        Err(LinkError::Io("nobody listens at the instrument's UDP port".into()))
                    }
                    Err(error) => Err(error.into()),
                }
            }
        }
    }

    /// Sends all of `bytes`.
    ///
    /// # Errors
    /// Where the connection does not take them.
    pub fn write(&mut self, bytes: &[u8]) -> Result<(), LinkError> {
        match self {
            Transport::Serial(line) => line.write(bytes),
            Transport::Folder(path, came) => attribute(path, &String::from_utf8_lossy(bytes), came),
            Transport::Tcp(stream, port) => {
                trace::sent(port, bytes);
                stream.write_all(bytes).map_err(LinkError::from)
            }
            Transport::Udp(socket, instrument, port) => {
                trace::sent(port, bytes);
                let connected = socket.peer_addr().is_ok();
                if connected { socket.send(bytes) } else { socket.send_to(bytes, *instrument) }?;
                Ok(())
            }
        }
    }
}

/// Reads the attribute that a line names, or writes to it what the line has after the name.
fn attribute(folder: &Path, line: &str, came: &mut Vec<u8>) -> Result<(), LinkError> {
    let line = line.trim();
    let (name, value) = line.split_once(' ').map_or((line, None), |(name, value)| (name, Some(value)));
    if name.is_empty() {
        return Ok(());
    }
    let file = folder.join(name);
    let port = file.display().to_string();
    let failed = |error: std::io::Error| LinkError::Io(format!("{port}: {error}"));
    if let Some(value) = value {
        trace::sent(&port, value.as_bytes());
        return std::fs::write(&file, value).map_err(failed);
    }
    let content = std::fs::read(&file).map_err(failed)?;
    trace::received(&port, &content);
    came.extend_from_slice(content.trim_ascii_end());
    came.push(b'\n');
    Ok(())
}

fn passed(error: &std::io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted)
}
