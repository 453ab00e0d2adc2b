//! A run on the terminal while it goes on: what `muprime watch` and `muprime run --tui` show.
//!
//! ```text
//! Viewer (or journal) --source--> Seen --painter--> screen
//!                       keys ----^ stop, pause, resume at once, whatever the painter waits for
//! ```
//!
//! Three threads beside the run: one hears, one paints, one takes keys. A terminal that takes nothing holds up the painter alone.
#![allow(clippy::disallowed_methods, reason = "a picture for people, in wall-clock time")]

mod keys;
mod numbers;
mod page;
mod plot;
mod render;
mod source;
mod style;

pub use page::{Page, draw};
pub use style::Look;

use crate::live::View;
use crate::terminal::{self, CtrlC};
use keys::Hand;
use miette::IntoDiagnostic;
use runs::Signals;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// A painter that hangs in a write keeps nobody from leaving.
const PATIENCE: Duration = Duration::from_millis(500);
/// A note stays so long.
const NOTED_FOR: Duration = Duration::from_secs(8);

/// Where the picture comes from.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Source {
    /// Nothing was heard so far.
    #[default]
    Nothing,
    /// The run's own feed.
    Feed,
    /// The run's folder; with the reason why there is no feed, where the run goes on.
    Folder(Option<String>),
}

/// Who takes the keys.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Keys {
    /// The view.
    Here,
    /// The hand at the dead-man key.
    DeadMan,
    /// Nobody; with the reason.
    None(String),
}

#[derive(Debug)]
struct Seen {
    view: View,
    source: Source,
    heard: Instant,
    note: Option<(String, Instant)>,
    help: bool,
}

/// What the threads share.
struct Shared {
    folder: PathBuf,
    seen: Mutex<Seen>,
    over: AtomicBool,
    hand: Hand,
    keys: Keys,
    /// A run in this process: its end takes the view down.
    own: bool,
}

impl Shared {
    fn seen(&self) -> MutexGuard<'_, Seen> {
        self.seen.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn is_over(&self) -> bool {
        self.over.load(Ordering::Relaxed)
    }

    fn note(&self, text: String) {
        self.seen().note = Some((text, Instant::now()));
    }
}

/// A view that is up until it is dropped.
pub struct TerminalView {
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
    painted: Receiver<()>,
}

impl TerminalView {
    /// Shows the run in a folder; `lead` are the signals of one that this process leads, whose folder need
    /// not be there yet.
    ///
    /// # Errors
    /// No terminal, or no thread can be had.
    pub fn begin(folder: &Path, lead: Option<Signals>, dead_man: bool) -> miette::Result<Self> {
        let own = lead.is_some();
        let ctrl_c = if own { CtrlC::Signal } else { CtrlC::Key };
        // The screen first: where it is refused, no keys were taken.
        terminal::show().into_diagnostic()?;
        let listen =
            || terminal::listen(ctrl_c).map_or_else(|why| Keys::None(why.to_string()), |()| Keys::Here);
        let keys = if dead_man { Keys::DeadMan } else { listen() };
        let (view, source) = (View::default(), Source::default());
        let seen = Seen { view, source, heard: Instant::now(), note: None, help: false };
        let (hand, seen) = (Hand { own: lead, feed: Mutex::default() }, Mutex::new(seen));
        let shared = Shared { folder: folder.into(), seen, over: AtomicBool::new(false), hand, keys, own };
        let shared = Arc::new(shared);
        let (done, painted) = channel();
        let mut watch = TerminalView { shared, threads: Vec::new(), painted };
        watch.thread("watch: source", source::hear)?;
        if watch.shared.keys == Keys::Here {
            watch.thread("watch: keys", keys::take_keys)?;
        }
        watch.thread("watch: painter", move |shared| {
            render::paint(shared);
            drop(done);
        })?;
        Ok(watch)
    }

    fn thread(&mut self, name: &str, body: impl FnOnce(&Shared) + Send + 'static) -> miette::Result<()> {
        let shared = Arc::clone(&self.shared);
        let run = move || {
            // A view that fails ends itself and nothing else: its panic is among the remarks.
            let _over = Over(Arc::clone(&shared));
            body(&shared);
        };
        self.threads.push(realtime::threads::spawn(name, run).into_diagnostic()?);
        Ok(())
    }

    /// Waits until somebody leaves it.
    pub fn wait(&self) {
        while !self.shared.is_over() {
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

/// A thread of the view that panics takes the view down, so that the terminal is not left with a picture that stands still.
struct Over(Arc<Shared>);

impl Drop for Over {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.0.over.store(true, Ordering::Relaxed);
            terminal::give_back();
        }
    }
}

impl Drop for TerminalView {
    fn drop(&mut self) {
        self.shared.over.store(true, Ordering::Relaxed);
        // It ends when the painter has put its end of the channel away; nothing is ever sent.
        let _ = self.painted.recv_timeout(PATIENCE);
        terminal::give_back();
    }
}

#[cfg(test)]
mod tests;
