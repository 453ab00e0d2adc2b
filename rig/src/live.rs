//! A run while it goes on, for whoever looks: the terminal view and the browser, in the run's own process or in another one.
//!
//! ```text
//! session --Update--> Feed (bounded queue, a thread) --JSON lines over a local socket--> Viewer -> View -> terminal, browser
//!                    ^ stop, pause, resume, one word a line, of the same user only ----'
//! ```
//!
//! Viewers never hold the loop up: the thread that has the updates puts messages into a bounded queue and
//! waits for nothing. A viewer that is too slow is disconnected, and gets the whole state when it returns.

mod feed;
mod message;
mod stop;
mod view;
mod viewer;

pub use feed::Feed;
pub use message::{Ended, Message, Progress, Run, State, TimedEvent};
pub use stop::stop;
pub use view::View;
pub use viewer::{Received, Viewer};

use serde::{Deserialize, Serialize};
use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::SocketAddr;
use std::path::Path;

/// What a viewer may ask of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Ask {
    /// Safe state, and the end of the run.
    Stop,
    /// Rest before the next pass.
    Pause,
    /// Go on after a pause.
    Resume,
}

impl Ask {
    /// The word on the wire.
    pub const fn word(self) -> &'static str {
        match self {
            Ask::Stop => "stop",
            Ask::Pause => "pause",
            Ask::Resume => "resume",
        }
    }

    /// Of a word on the wire.
    pub fn of(word: &str) -> Option<Ask> {
        [Ask::Stop, Ask::Pause, Ask::Resume].into_iter().find(|ask| ask.word() == word)
    }
}

/// Where a run is to be looked at: a name of the kernel's own (see `unix(7)`), made from its folder. It leaves nothing on the disk and ends with the process.
fn place(run: &Path) -> std::io::Result<SocketAddr> {
    let whole = run.canonicalize()?;
    let name = calibration::certificate::sha256_hex(whole.as_os_str().as_encoded_bytes());
    SocketAddr::from_abstract_name(format!("muprime-run-{}", &name[..32]))
}

/// Whether the other end of a socket is a process of the same user, or of the one who may do everything.
fn is_ours(peer: &rustix::net::UCred) -> bool {
    peer.uid == rustix::process::geteuid() || peer.uid.is_root()
}

#[cfg(test)]
mod tests;
