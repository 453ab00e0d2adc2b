//! The dead-man key of a trial: the space bar of the terminal that a run was started from.
//!
//! A terminal tells presses, and repeats them while a key is held; it tells no release. Each press is passed on to the loop, where
//! it counts as held for [`realtime::cycle::KEY_AGE`]. So a hand that lets go is noticed after that time: ten times later than by
//! a device of its own, which is why a setup must ask for the key. Any other key is a release at once.
//!
//! The terminal is put into a mode without lines and without echo, in which the keys that would suspend or abort the program do
//! nothing; it is given back whatever ends the run, but for a SIGKILL (`stty sane` does it then).

use crate::terminal::{self, CtrlC};
use realtime::{Command, threads};
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

/// The key.
const SPACE: u8 = b' ';

/// A terminal whose space bar is listened to, from now until this is dropped.
pub struct DeadManKey {
    end: Arc<AtomicBool>,
    reader: Option<JoinHandle<()>>,
}

impl DeadManKey {
    /// Takes the terminal. What was typed before does not count.
    ///
    /// # Errors
    /// The standard input is not a terminal, or the program is not in its foreground.
    pub fn open() -> miette::Result<Self> {
        let help = "run it in the foreground of a terminal, or fit a dead-man device at [safety_inputs]";
        // A run that is suspended leaves its rig alone: only its end is a key (Ctrl-C).
        terminal::listen(CtrlC::Signal).map_err(|why| miette::miette!(help = help, "dead_man_key: {why}"))?;
        Ok(DeadManKey { end: Arc::default(), reader: None })
    }

    /// Passes every press on to the loop, on a thread of its own.
    ///
    /// # Errors
    /// No thread can be had.
    pub fn hold(mut self, send: impl Fn(Command) + Send + 'static) -> io::Result<Self> {
        let end = Arc::clone(&self.end);
        let read = move || {
            while !end.load(Ordering::Relaxed) {
                match pressed() {
                    Ok(None) => {}
                    Ok(Some(held)) => send(Command::DeadMan(held)),
                    // The terminal is gone, and the hand with it.
                    Err(_) => return send(Command::DeadMan(false)),
                }
            }
        };
        self.reader = Some(threads::spawn("dead-man key", read)?);
        Ok(self)
    }
}

impl Drop for DeadManKey {
    fn drop(&mut self) {
        self.end.store(true, Ordering::Relaxed);
        let _ = self.reader.take().map(JoinHandle::join);
        terminal::give_back();
    }
}

/// Whether the space bar, and nothing else, was pressed; `None` where no key was.
fn pressed() -> io::Result<Option<bool>> {
    let mut keys = [0; 256];
    Ok(match terminal::keys(&mut keys)? {
        0 => None,
        count => Some(keys[..count].iter().all(|key| *key == SPACE)),
    })
}
