//! Long computations at a terminal: a bar with the time that is left, and what there is so far where somebody presses Ctrl-C.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use miette::IntoDiagnostic;
use realtime::threads;
use runs::exit::exit_now;
use runs::say;
use std::io::IsTerminal;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, Once, PoisonError};

/// Status of what Ctrl-C ended: 128 and the number of the signal.
pub const INTERRUPTED: u8 = 130;

/// Whether a command answers with documents: what there is on Ctrl-C is one too.
pub static JSON: AtomicBool = AtomicBool::new(false);

/// What says what there is so far of the part at work; it gets the bar's position.
type Partial = (ProgressBar, Box<dyn FnOnce(u64) + Send>);

/// That of the part that began last: a command may have several.
static AT_WORK: Mutex<Option<Partial>> = Mutex::new(None);

/// A bar on standard error with the time that is left, hidden where that is not a terminal: a log holds no
/// bars.
pub fn bar(length: u64, what: &str) -> ProgressBar {
    let target = if std::io::stderr().is_terminal() {
        ProgressDrawTarget::stderr()
    } else {
        ProgressDrawTarget::hidden()
    };
    let bar = ProgressBar::with_draw_target(Some(length), target);
    let template = format!("{{bar:30}} {{pos}}/{{len}} {what}, {{eta}} to go {{msg}}");
    if let Ok(style) = ProgressStyle::with_template(&template) {
        bar.set_style(style);
    }
    bar
}

/// On Ctrl-C the bar goes, `partial` says what there is so far (it gets the bar's position), and the program
/// ends with [`INTERRUPTED`]. A second Ctrl-C waits for nothing. A later call takes the place of this one.
///
/// # Errors
/// As [`on_signals`].
pub fn on_interrupt(bar: &ProgressBar, partial: impl FnOnce(u64) + Send + 'static) -> miette::Result<()> {
    static WATCHED: Once = Once::new();
    *AT_WORK.lock().unwrap_or_else(PoisonError::into_inner) = Some((bar.clone(), Box::new(partial)));
    let (mut watching, mut is_first) = (Ok(()), true);
    WATCHED.call_once(|| {
        watching = on_signals(&[signal_hook::consts::SIGINT], move || {
            let at_work = AT_WORK.lock().unwrap_or_else(PoisonError::into_inner).take();
            let Some((bar, partial)) = at_work.filter(|_| std::mem::take(&mut is_first)) else {
                return exit_now(INTERRUPTED);
            };
            let position = bar.position();
            bar.finish_and_clear();
            say!("stopped by Ctrl-C: what follows is partial");
            // Printing it may take long, or fail: the next Ctrl-C does not wait for it.
            let thread = threads::spawn("partial", move || {
                partial(position);
                exit_now(INTERRUPTED);
            });
            if thread.is_err() {
                exit_now(INTERRUPTED);
            }
        })
    });
    watching
}

/// Calls `caught` at each of these signals, on a thread of its own.
///
/// # Errors
/// The system gives no thread or no signals.
pub fn on_signals(signals: &[i32], mut caught: impl FnMut() + Send + 'static) -> miette::Result<()> {
    let mut signals = signal_hook::iterator::Signals::new(signals).into_diagnostic()?;
    let each = move || signals.forever().for_each(|_| caught());
    threads::spawn("signals", each).into_diagnostic()?;
    Ok(())
}

/// A study of many parts at a terminal: how many are done, and what they found, for who presses Ctrl-C.
pub struct Study<T> {
    /// Its bar.
    pub bar: ProgressBar,
    found: Arc<Mutex<Vec<T>>>,
}

impl<T: Clone + Send + 'static> Study<T> {
    /// Of so many parts. On Ctrl-C `partial` gets what was found, and how many parts were done.
    ///
    /// # Errors
    /// As [`on_signals`].
    pub fn begin(
        parts: u64,
        what: &str,
        partial: impl FnOnce(Vec<T>, u64) + Send + 'static,
    ) -> miette::Result<Self> {
        let (bar, found) = (bar(parts, what), Arc::<Mutex<Vec<T>>>::default());
        let results = Arc::clone(&found);
        on_interrupt(&bar, move |done| {
            let so_far = results.lock().unwrap_or_else(PoisonError::into_inner).clone();
            partial(so_far, done);
        })?;
        Ok(Study { bar, found })
    }

    /// One part more, and what it found.
    pub fn done(&self, found: Option<T>) {
        self.found.lock().unwrap_or_else(PoisonError::into_inner).extend(found);
        self.bar.inc(1);
    }
}

impl<T> Drop for Study<T> {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
