//! Named threads; an error says that the system gives no further one, and what helps.

use std::io;
use std::thread::{Builder, JoinHandle};

/// Starts a thread of that name; its first 15 bytes are what the system shows.
///
/// # Errors
/// The system gives none: see [`refused`].
pub fn spawn<T: Send + 'static>(
    name: impl Into<String>,
    work: impl FnOnce() -> T + Send + 'static,
) -> io::Result<JoinHandle<T>> {
    Builder::new().name(name.into()).spawn(work).map_err(refused)
}

/// The system's error about a thread, in words and with its remedy.
pub fn refused(why: io::Error) -> io::Error {
    let remedy = "end other programs, or raise this user's limit of processes (ulimit -u)";
    io::Error::new(why.kind(), format!("the system gives no further thread ({why}): {remedy}"))
}
