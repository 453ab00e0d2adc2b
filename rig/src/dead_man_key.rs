//! The dead-man key of a trial: the space bar of the terminal that a run was started from.
//!
//! A terminal tells presses, and repeats them while a key is held; it tells no release. Each press is passed on to the loop, where
//! it counts as held for [`realtime::cycle::KEY_AGE`]. So a hand that lets go is noticed after that time: ten times later than by
//! a device of its own, which is why a setup must ask for the key. Any other key is a release at once.
//!
//! The terminal is put into a mode without lines and without echo, in which the keys that would suspend or abort the program do
//! nothing; it is given back whatever ends the run, but for a SIGKILL (`stty sane` does it then).

use realtime::cycle::Command;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::termios::{
    LocalModes, OptionalActions, SpecialCodeIndex, Termios, isatty, tcgetattr, tcgetpgrp, tcsetattr,
};
use std::io::{self, stdin};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

/// The key.
const SPACE: u8 = b' ';
/// The reader looks this often whether it is to end.
const LOOK_EVERY: Timespec = Timespec { tv_sec: 0, tv_nsec: 50_000_000 };

/// How the terminal was before. Whoever gives it back takes it out.
static BEFORE: Mutex<Option<Termios>> = Mutex::new(None);

/// Gives the terminal back as it was; does nothing where it was not taken.
pub fn give_the_terminal_back() {
    let before = BEFORE.lock().unwrap_or_else(PoisonError::into_inner).take();
    if let Some(before) = before {
        // A terminal that is gone needs nothing back.
        let _ = tcsetattr(stdin(), OptionalActions::Now, &before);
    }
}

/// A terminal whose space bar is listened to, from now until this is dropped.
pub struct DeadManKey {
    end: Arc<AtomicBool>,
    reader: Option<JoinHandle<()>>,
}

impl DeadManKey {
    /// Takes the terminal. What was typed before does not count.
    ///
    /// # Errors
    /// The standard input is no terminal, or the program is not in its foreground.
    pub fn open() -> miette::Result<Self> {
        let help = "run it in the foreground of a terminal, or fit a dead-man device at [safety_inputs]";
        let refused = |why: String| miette::miette!(help = help, "dead_man_key: {why}");
        if !isatty(stdin()) {
            return Err(refused("the standard input is no terminal, so no key can be held".into()));
        }
        let foreground = tcgetpgrp(stdin()).map_err(|e| refused(e.to_string()))?;
        if foreground != rustix::process::getpgrp() {
            return Err(refused("the program runs in the background of its terminal".into()));
        }
        let before = tcgetattr(stdin()).map_err(|e| refused(e.to_string()))?;
        let mut listening = before.clone();
        listening.local_modes.remove(LocalModes::ICANON | LocalModes::ECHO);
        // A run that is suspended leaves its rig alone: only its end is a key (Ctrl-C).
        for code in [SpecialCodeIndex::VSUSP, SpecialCodeIndex::VQUIT] {
            listening.special_codes[code] = 0;
        }
        listening.special_codes[SpecialCodeIndex::VMIN] = 1;
        listening.special_codes[SpecialCodeIndex::VTIME] = 0;
        *BEFORE.lock().unwrap_or_else(PoisonError::into_inner) = Some(before);
        let key = DeadManKey { end: Arc::default(), reader: None };
        tcsetattr(stdin(), OptionalActions::Flush, &listening).map_err(|e| refused(e.to_string()))?;
        Ok(key)
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
                    // A signal came between: nothing was pressed.
                    Err(why) if why.kind() == io::ErrorKind::Interrupted => {}
                    // The terminal is gone, and the hand with it.
                    Err(_) => return send(Command::DeadMan(false)),
                }
            }
        };
        self.reader = Some(std::thread::Builder::new().name("dead-man key".into()).spawn(read)?);
        Ok(self)
    }
}

impl Drop for DeadManKey {
    fn drop(&mut self) {
        self.end.store(true, Ordering::Relaxed);
        let _ = self.reader.take().map(JoinHandle::join);
        give_the_terminal_back();
    }
}

/// Whether the space bar, and nothing else, was pressed; `None` where no key was.
fn pressed() -> io::Result<Option<bool>> {
    let input = stdin();
    let mut looked = [PollFd::new(&input, PollFlags::IN)];
    if poll(&mut looked, Some(&LOOK_EVERY))? == 0 {
        return Ok(None);
    }
    let mut keys = [0; 256];
    match rustix::io::read(&input, &mut keys)? {
        0 => Err(io::ErrorKind::UnexpectedEof.into()),
        count => Ok(Some(keys[..count].iter().all(|key| *key == SPACE))),
    }
}
