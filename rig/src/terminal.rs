//! The terminal that the program was started from: taken for single keys or for a picture, and given back
//! whatever ends the program, but for a SIGKILL (`reset` does it then).
#![allow(clippy::disallowed_methods, reason = "writes to a terminal beside everything else")]

use realtime::threads;
use runs::print;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::termios::{
    LocalModes, OptionalActions, SpecialCodeIndex, Termios, isatty, tcgetattr, tcgetpgrp, tcgetwinsize,
    tcsetattr,
};
use std::io::{self, Write, stderr, stdin, stdout};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;
use std::sync::{Mutex, Once, PoisonError};
use std::time::Duration;

/// The signals that ask for a stop: none of them ends a program that drives a rig before it is off.
pub const STOPS: [i32; 4] = {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGQUIT, SIGTERM};
    [SIGINT, SIGTERM, SIGHUP, SIGQUIT]
};

/// The other screen, and back to the one that was there before: no attributes, the cursor shown.
pub(crate) const ENTER: &[u8] = b"\x1b[?1049h\x1b[?25l\x1b[2J";
const LEAVE: &[u8] = b"\x1b[0m\x1b[?25h\x1b[?1049l";
/// A terminal that takes nothing for so long keeps nobody from leaving.
const PATIENCE: Duration = Duration::from_millis(500);
/// Who waits for keys looks this often whether it is to end.
const POLL_EVERY: Timespec = Timespec { tv_sec: 0, tv_nsec: 50_000_000 };

/// How the terminal was before. Whoever gives it back takes it out.
static BEFORE: Mutex<Option<Termios>> = Mutex::new(None);
/// Whether a picture is up.
static SHOWN: AtomicBool = AtomicBool::new(false);
/// Panics are remarks from the first picture on.
static PANICS: Once = Once::new();

/// What Ctrl-C is while keys are listened to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CtrlC {
    /// SIGINT to this program, as ever.
    Signal,
    /// A key like others: the byte 3.
    Key,
}

/// Whether this program may take keys from its terminal.
///
/// # Errors
/// The standard input is not a terminal, or the program is not in its foreground: it would be stopped by the
/// first look at a key.
pub fn has_keys() -> io::Result<()> {
    if !isatty(stdin()) {
        return Err(io::Error::other("the standard input is not a terminal, so no key can be pressed"));
    }
    let foreground = tcgetpgrp(stdin())?;
    if foreground != rustix::process::getpgrp() {
        return Err(io::Error::other("the program runs in the background of its terminal"));
    }
    Ok(())
}

/// Takes the keys: without lines, without echo, and without those that would suspend or abort the program.
/// What was typed before does not count.
///
/// # Errors
/// As [`has_keys`].
pub fn listen(ctrl_c: CtrlC) -> io::Result<()> {
    has_keys()?;
    let before = tcgetattr(stdin())?;
    let mut listening = before.clone();
    listening.local_modes.remove(LocalModes::ICANON | LocalModes::ECHO);
    for code in [SpecialCodeIndex::VSUSP, SpecialCodeIndex::VQUIT] {
        listening.special_codes[code] = 0;
    }
    if ctrl_c == CtrlC::Key {
        listening.special_codes[SpecialCodeIndex::VINTR] = 0;
    }
    listening.special_codes[SpecialCodeIndex::VMIN] = 1;
    listening.special_codes[SpecialCodeIndex::VTIME] = 0;
    *BEFORE.lock().unwrap_or_else(PoisonError::into_inner) = Some(before);
    tcsetattr(stdin(), OptionalActions::Flush, &listening).map_err(|why| {
        give_back();
        why.into()
    })
}

/// The keys that were pressed, 0 where none was within 50 ms.
///
/// # Errors
/// The terminal is gone.
pub fn keys(into: &mut [u8]) -> io::Result<usize> {
    let input = stdin();
    let mut looked = [PollFd::new(&input, PollFlags::IN)];
    match poll(&mut looked, Some(&POLL_EVERY)) {
        // A signal came between: nothing was pressed.
        Ok(0) | Err(rustix::io::Errno::INTR) => return Ok(0),
        Ok(_) => {}
        Err(why) => return Err(why.into()),
    }
    match rustix::io::read(&input, into) {
        Ok(0) => Err(io::ErrorKind::UnexpectedEof.into()),
        Ok(count) => Ok(count),
        Err(rustix::io::Errno::INTR) => Ok(0),
        Err(why) => Err(why.into()),
    }
}

/// Puts up a picture's screen. Until it is given back remarks for the same terminal are held, also those of a panic.
///
/// # Errors
/// The standard output is not a terminal.
pub fn show() -> io::Result<()> {
    if !isatty(stdout()) {
        return Err(io::Error::other("the standard output is not a terminal"));
    }
    PANICS.call_once(|| {
        let usual = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            if is_shown() {
                let thread = std::thread::current();
                print::remark(&format!("thread '{}' {panic}", thread.name().unwrap_or_default()));
            } else {
                usual(panic);
            }
        }));
    });
    if isatty(stderr()) {
        print::hold();
    }
    SHOWN.store(true, Ordering::SeqCst);
    // A terminal that takes nothing now may do so later: the picture's own thread waits for it.
    Ok(())
}

/// Whether a picture may be drawn: it is up, and was not given back.
pub fn is_shown() -> bool {
    SHOWN.load(Ordering::SeqCst)
}

/// Columns and rows of the terminal; 80 and 24 where it does not say.
pub fn size() -> (u16, u16) {
    match tcgetwinsize(stdout()) {
        Ok(size) if size.ws_col > 0 && size.ws_row > 0 => (size.ws_col, size.ws_row),
        _ => (80, 24),
    }
}

/// Gives the terminal back as it was, and says what was held; does nothing where nothing was taken. It waits for half a second at most.
pub fn give_back() {
    let before = BEFORE.lock().unwrap_or_else(PoisonError::into_inner).take();
    if let Some(before) = before {
        // A terminal that is gone needs nothing back.
        let _ = tcsetattr(stdin(), OptionalActions::Now, &before);
    }
    if !SHOWN.swap(false, Ordering::SeqCst) {
        return;
    }
    let held = print::release();
    let (done, written) = channel();
    let write = move || {
        let _ = stdout().lock().write_all(LEAVE).and_then(|()| stdout().flush());
        for text in held {
            print::question(&text);
        }
        let _ = done.send(());
    };
    if threads::spawn("terminal", write).is_ok() {
        let _ = written.recv_timeout(PATIENCE);
    }
}
