//! The other end of the socket: whoever looks at a run.

use super::{Ask, Message, is_ours, place};
use runs::run_dir;
use std::io::{self, BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::Duration;

/// What was heard of a run.
#[derive(Clone, Debug, PartialEq)]
pub enum Received {
    /// A message.
    Message(Box<Message>),
    /// Nothing within the time that was given.
    Nothing,
    /// The run, or this viewer's place at it, is gone.
    Gone,
}

/// A look at a run that goes on, in this process or another one of this machine.
pub struct Viewer {
    reader: BufReader<UnixStream>,
    /// A line, as far as it has come.
    begun: String,
}

impl Viewer {
    /// Looks at the run in a folder.
    ///
    /// # Errors
    /// No such folder, or nobody tells of that run: it is over, of another machine, or of another user; or
    /// another user's process answers in its place.
    pub fn connect(run: &Path) -> io::Result<Self> {
        let stream = UnixStream::connect_addr(&place(run)?)?;
        // The name is made from the folder's path: any user may have taken it before the run.
        let peer = rustix::net::sockopt::socket_peercred(&stream)?;
        if !(is_ours(&peer) || run_dir::holder(run) == u32::try_from(peer.pid.as_raw_nonzero().get()).ok()) {
            return Err(io::Error::other("another user's process answers in the run's place"));
        }
        Ok(Viewer { reader: BufReader::new(stream), begun: String::new() })
    }

    /// Waits for a message, so long at most. Messages of a later version that this one does not know are passed over.
    pub fn hear(&mut self, at_most: Duration) -> Received {
        if self.reader.get_ref().set_read_timeout(Some(at_most.max(Duration::from_millis(1)))).is_err() {
            return Received::Gone;
        }
        loop {
            match self.reader.read_line(&mut self.begun) {
                Ok(_) if self.begun.ends_with('\n') => {
                    let message = serde_json::from_str(&self.begun);
                    self.begun.clear();
                    if let Ok(message) = message {
                        return Received::Message(Box::new(message));
                    }
                }
                Err(why) if matches!(why.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut) => {
                    return Received::Nothing;
                }
                Err(why) if why.kind() == io::ErrorKind::Interrupted => {}
                Ok(_) | Err(_) => return Received::Gone,
            }
        }
    }

    /// Another handle to the same look, to ask from another thread.
    ///
    /// # Errors
    /// The system gives none.
    pub fn asking(&self) -> io::Result<impl FnMut(Ask) -> io::Result<()> + Send + 'static> {
        let mut stream = self.reader.get_ref().try_clone()?;
        Ok(move |ask: Ask| stream.write_all(format!("{}\n", ask.word()).as_bytes()))
    }
}
