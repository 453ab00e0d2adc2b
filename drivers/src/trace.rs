//! Every byte that goes over a wire, in both directions: `MUPRIME_LOG=warn,wire`.
//!
//! A line a write or read, under the target `wire`: the port, `->` for what is sent and `<-` for what comes,
//! the bytes in hexadecimal, and as text. Where nobody asks for the target one flag is looked at and nothing
//! is formatted; the threads of the links write it, the loop has none of it.

use instruments::{CanEvent, CanFrame, CanPort};
use std::pin::Pin;
use std::task::{Context, Poll};
use std::time::Instant;
use std::{fmt, io};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};

/// Bytes in hexadecimal and as text.
struct Bytes<'a>(&'a [u8]);

impl fmt::Display for Bytes<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for byte in self.0 {
            write!(f, " {byte:02X}")?;
        }
        write!(f, "  \"{}\"", self.0.escape_ascii())
    }
}

/// A frame: identifier with as many digits as its kind has, length, data.
struct Frame<'a>(&'a CanFrame);

impl fmt::Display for Frame<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = if self.0.extended { 8 } else { 3 };
        write!(f, " {:0width$X} [{}]", self.0.id, self.0.data().len())?;
        self.0.data().iter().try_for_each(|byte| write!(f, " {byte:02X}"))
    }
}

/// Bytes that go out at `port`.
pub fn sent(port: &str, bytes: &[u8]) {
    tracing::trace!(target: "wire", "{port} ->{}", Bytes(bytes));
}

/// Bytes that came in at `port`; none is not a line.
pub fn received(port: &str, bytes: &[u8]) {
    if !bytes.is_empty() {
        tracing::trace!(target: "wire", "{port} <-{}", Bytes(bytes));
    }
}

/// A stream of bytes with its port's name.
#[derive(Debug)]
pub struct Traced<T> {
    /// The stream itself.
    pub inner: T,
    /// Its name in the trace.
    pub port: String,
}

impl<T: AsyncRead + Unpin> AsyncRead for Traced<T> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buf: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let before = buf.filled().len();
        let came = Pin::new(&mut self.inner).poll_read(cx, buf);
        received(&self.port, &buf.filled()[before..]);
        came
    }
}

impl<T: AsyncWrite + Unpin> AsyncWrite for Traced<T> {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        let written = Pin::new(&mut self.inner).poll_write(cx, bytes);
        if let Poll::Ready(Ok(count)) = written {
            sent(&self.port, &bytes[..count]);
        }
        written
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.inner).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.inner).poll_shutdown(cx)
    }
}

/// The kernel's bus with its interface's name. An adapter's line shows its frames as the text that they are there.
pub struct TracedBus<P> {
    /// The bus itself.
    pub inner: P,
    /// Its interface.
    pub interface: String,
}

impl<P: CanPort> CanPort for TracedBus<P> {
    fn send(&mut self, frame: &CanFrame) -> io::Result<bool> {
        let taken = self.inner.send(frame)?;
        if taken {
            tracing::trace!(target: "wire", "{} ->{}", self.interface, Frame(frame));
        }
        Ok(taken)
    }

    fn receive(&mut self, deadline: Instant) -> io::Result<Option<CanEvent>> {
        let event = self.inner.receive(deadline)?;
        match &event {
            Some(CanEvent::Frame(frame, _)) => {
                tracing::trace!(target: "wire", "{} <-{}", self.interface, Frame(frame));
            }
            Some(other) => tracing::trace!(target: "wire", "{} <- {other:?}", self.interface),
            None => {}
        }
        Ok(event)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_and_frames_as_they_are_shown() {
        assert_eq!(Bytes(b"AMP=1\r\n\xA5").to_string(), " 41 4D 50 3D 31 0D 0A A5  \"AMP=1\\r\\n\\xa5\"");
        let short = CanFrame::new(0x1A, &[2, 0xFF]).unwrap();
        assert_eq!(Frame(&short).to_string(), " 01A [2] 02 FF");
        let long = CanFrame::build(0x1A, true, &[]).unwrap();
        assert_eq!(Frame(&long).to_string(), " 0000001A [0]");
    }
}
