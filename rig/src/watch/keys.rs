//! What the keys do. A stop takes one key and no question: it is the safe direction.

use super::{Shared, Source};
use crate::live::{self, Ask};
use crate::terminal;
use runs::Signals;
use std::io;
use std::path::Path;
use std::sync::atomic::Ordering;
use std::sync::{Mutex, PoisonError};

/// A way to ask a run through its feed.
pub(super) type Asking = Box<dyn FnMut(Ask) -> io::Result<()> + Send>;

/// The way from the keys to the run.
pub(super) struct Hand {
    /// The signals of a run that this process leads.
    pub own: Option<Signals>,
    pub feed: Mutex<Option<Asking>>,
}

impl Hand {
    /// Sets the feed for requests to the run; `None` where its feed is gone.
    pub fn reach(&self, feed: Option<Asking>) {
        *self.feed.lock().unwrap_or_else(PoisonError::into_inner) = feed;
    }

    fn by_feed(&self, ask: Ask) -> bool {
        let mut feed = self.feed.lock().unwrap_or_else(PoisonError::into_inner);
        feed.as_mut().is_some_and(|feed| feed(ask).is_ok())
    }

    /// Stops the run; returns how.
    fn stop(&self, folder: &Path) -> String {
        if let Some(signals) = &self.own {
            signals.stops.fetch_add(1, Ordering::Relaxed);
            return "stop requested: the rig goes to its safe state first".into();
        }
        live::stop(folder).unwrap_or_else(|why| why)
    }

    /// Has the run rest before its next pass, or go on; says what comes of it.
    fn pause(&self, ask: Ask) -> String {
        let done = match &self.own {
            Some(signals) => {
                signals.paused.store(ask == Ask::Pause, Ordering::Relaxed);
                true
            }
            None => self.by_feed(ask),
        };
        match (done, ask) {
            (true, Ask::Pause) => {
                "pause requested: it rests after the pass that slides, no drive, lifted off".into()
            }
            (true, _) => "it goes on".into(),
            (false, ask) => format!("no {}: the run's feed cannot be had", ask.word()),
        }
    }
}

/// Takes keys until the view is over.
pub(super) fn take_keys(shared: &Shared) {
    let mut pressed = [0; 64];
    while !shared.is_over() {
        match terminal::keys(&mut pressed) {
            Ok(count) => take(shared, &pressed[..count]),
            // The terminal is gone, and whoever looked with it. A run is not: its signals say what becomes of it.
            Err(_) => return shared.over.store(!shared.own, Ordering::Relaxed),
        }
    }
}

/// The byte of Ctrl-C where it is not a signal.
const CTRL_C: u8 = 3;
/// What a terminal's longer codes begin with: an arrow is not a letter.
const ESCAPE: u8 = 27;

fn take(shared: &Shared, pressed: &[u8]) {
    let long = pressed.contains(&ESCAPE);
    for key in pressed.iter().map(u8::to_ascii_lowercase).filter(|key| !long || *key == CTRL_C) {
        // What asks of the run does not wait for the picture: the lock of what is seen is taken for the note alone.
        match key {
            b's' | CTRL_C => {
                shared.note("stop requested".into());
                shared.note(shared.hand.stop(&shared.folder));
            }
            b'p' | b'r' => shared.note(rest(shared, if key == b'p' { Ask::Pause } else { Ask::Resume })),
            b'q' if shared.own => shared.note("the view ends with the run: s stops the run".into()),
            b'q' => shared.over.store(true, Ordering::Relaxed),
            b'?' | b'h' => {
                let mut seen = shared.seen();
                seen.help = !seen.help;
            }
            _ => {}
        }
    }
}

fn rest(shared: &Shared, ask: Ask) -> String {
    let (run, ended, source) = {
        let seen = shared.seen();
        (seen.view.run.clone(), seen.view.ended.is_some(), seen.source.clone())
    };
    match run {
        _ if ended => "the run is over".into(),
        Some(run) if run.fast => format!("no {}: in virtual time nothing waits", ask.word()),
        _ if !shared.own && matches!(source, Source::Folder(_)) => {
            format!("no {}: there is no feed to ask through; s stops", ask.word())
        }
        _ => shared.hand.pause(ask),
    }
}
