//! The life of a link: connect, converse until something is wrong, report to the loop, wait, connect again.
//!
//! A connection belongs to the link's thread; the loop sees its ports alone and never waits for it. A link
//! that fails is opened again after a pause that doubles, at once where an 'off' is owed; only a failure of the
//! first connection goes to whoever opened the rig. After a stop it ends once 'off' is read back, or
//! `OFF_WITHIN` is over.

use super::endpoint::Endpoint;
use super::link_error::{Closed, LinkError, OFF_WITHIN};
use super::off::PendingOff;
use realtime::clock::{Clock, Participant};
use realtime::pacing::panic_message;
use realtime::ports::{Nanos, NoData};
use std::convert::Infallible;
use std::panic::AssertUnwindSafe;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::SyncSender;
use std::thread::JoinHandle;
use std::time::Duration;

/// A thread looks at least this often whether it is to stop.
pub const LONGEST_SLEEP: Duration = Duration::from_millis(20);

/// How far a held clock may pass the time at which a driver's thread was to look at it again: a turn of
/// requests and answers on a machine with time to spare.
const SLACK: Nanos = Nanos(2_000_000);

/// Something that happens again and again.
#[derive(Debug, Clone)]
pub struct Periodic {
    period: u64,
    /// When it happens next.
    pub due: Nanos,
}

impl Periodic {
    /// From `now` on, so many times a second.
    pub fn new(rate_hz: f64, now: Nanos) -> Self {
        Self { period: Nanos::from_seconds(1.0 / rate_hz).0.max(1), due: now }
    }

    /// Whether it is time.
    pub fn is_due(&self, now: Nanos) -> bool {
        self.due <= now
    }

    /// The next time after this one; missed ones are left out, so that a pause makes no burst.
    pub fn advance(&mut self, now: Nanos) {
        let missed = now.since(self.due).0 / self.period;
        self.due = Nanos(self.due.0 + (missed + 1) * self.period);
    }
}

/// The thread of a connection, or why the instrument could not be opened.
pub type Spawned = Result<JoinHandle<Closed>, LinkError>;

/// What every transport's thread starts from.
pub struct Connection {
    /// Frames to samples, commands to set-points.
    pub endpoint: Endpoint,
    /// Time from the moment that the loop calls zero.
    pub clock: Participant,
    /// Set when the thread is to send the safe set-points and end.
    pub stop: Arc<AtomicBool>,
    /// Whether an 'off' is pending.
    pub pending_off: PendingOff,
    /// Takes the outcome of the first connection, once.
    pub ready: Option<SyncSender<Result<(), LinkError>>>,
    /// When the thread is to be done with switching off; known from the moment that it sees `stop`.
    off_by: Option<Nanos>,
}

impl Connection {
    /// A connection whose thread is not started yet. `ready` takes the outcome of the first connection, once.
    pub fn new(
        endpoint: Endpoint,
        clock: impl Into<Clock>,
        stop: Arc<AtomicBool>,
        ready: SyncSender<Result<(), LinkError>>,
    ) -> Self {
        let clock = clock.into();
        let pending_off = endpoint.pending_off(&stop, &clock);
        Self { endpoint, clock: clock.join(SLACK), stop, pending_off, ready: Some(ready), off_by: None }
    }

    /// Whether no connection has given a sample yet: nothing was commanded then, and nothing may be.
    pub fn is_first(&self) -> bool {
        self.ready.is_some()
    }

    /// Whether the time for switching off is over. It runs from the first call.
    pub fn off_time_over(&mut self) -> bool {
        let now = self.now();
        now >= *self.off_by.get_or_insert(now.plus(Nanos(OFF_WITHIN.as_nanos() as u64)))
    }

    /// Nanoseconds since the epoch.
    pub fn now(&self) -> Nanos {
        self.clock.now()
    }

    /// Tells whoever opened the rig how the first connection went. Returns whether it was the first.
    pub fn tell(&mut self, outcome: Result<(), LinkError>) -> bool {
        self.ready.take().map(|ready| ready.send(outcome)).is_some()
    }

    /// Whether the thread is to end.
    pub fn stopping(&self) -> bool {
        self.stop.load(Ordering::Acquire)
    }

    /// Sleeps until `due`, but never long.
    pub fn sleep_until(&self, due: Option<Nanos>) {
        let latest = self.now().plus(Nanos(LONGEST_SLEEP.as_nanos() as u64));
        self.clock.sleep_until(due.map_or(latest, |due| due.min(latest)));
    }

    /// Starts the thread, which repeats the conversation until it is stopped and the instrument is off.
    ///
    /// # Errors
    /// Where no thread can be had.
    pub fn spawn(
        mut self,
        mut converse: impl FnMut(&mut Connection) -> Result<Infallible, LinkError> + Send + 'static,
    ) -> Spawned {
        let name: String = self.endpoint.profile().id().chars().take(15).collect();
        // At the level of the terminal's default, so that what is shown has its instrument.
        let span = tracing::warn_span!("instrument", id = self.endpoint.profile().id());
        let run = move || span.in_scope(|| self.keep_up(&mut converse));
        realtime::threads::spawn(name, run).map_err(LinkError::from)
    }

    fn keep_up(
        &mut self,
        converse: &mut dyn FnMut(&mut Connection) -> Result<Infallible, LinkError>,
    ) -> Closed {
        let link = &self.endpoint.profile().description.link;
        let first = Duration::from_millis(u64::from(link.backoff_first_ms));
        let longest = Duration::from_millis(u64::from(link.backoff_longest_ms));
        let health = self.endpoint.health();
        let mut pause = first;
        let mut last_words = String::from("the link was down");
        while !self.stopping() || (self.endpoint.owes_off() && !self.off_time_over()) {
            let samples_before = health.report().samples;
            let ended = self.guarded(converse);
            let stopped = matches!(ended, LinkError::Stopped);
            let off = self.endpoint.reads_off();
            self.endpoint.link_down(NoData::Disconnected);
            if stopped {
                return if self.endpoint.is_actuator() && off {
                    Closed::ReadBackOff
                } else {
                    self.closed("stopped before a state came".into())
                };
            }
            if matches!(ended, LinkError::Timeout(_) | LinkError::Cut(_)) {
                health.count(&health.timeouts);
            }
            last_words = ended.to_string();
            health.problem(last_words.clone());
            tracing::info!(%ended, "the link went down");
            if self.tell(Err(ended)) {
                return self.closed(last_words); // whoever opened the rig wants to know, not to wait
            }
            // A connection that gave samples was a good one: begin with the short pause again.
            let was_good = health.report().samples > samples_before;
            pause = if was_good { first } else { (2 * pause).min(longest) };
            // Where 'off' is owed the first try is made at once. The end of the program waits for no long pause, owed or not.
            if !(self.endpoint.owes_off() && was_good) {
                self.back_off(if self.stopping() { pause.min(LONGEST_SLEEP) } else { pause });
            }
        }
        self.closed(last_words)
    }

    /// How the link was closed where no last 'off' was read back in an orderly end.
    fn closed(&self, why: String) -> Closed {
        if !self.endpoint.is_actuator() {
            Closed::NothingToSwitch
        } else if self.endpoint.reads_off() {
            Closed::ReadBackOff
        } else {
            Closed::NotReadBack(why)
        }
    }

    /// One conversation. A panic in it is the end of it, and of nothing else: the next one switches off.
    fn guarded(
        &mut self,
        converse: &mut dyn FnMut(&mut Connection) -> Result<Infallible, LinkError>,
    ) -> LinkError {
        match std::panic::catch_unwind(AssertUnwindSafe(|| converse(self))) {
            Ok(Ok(never)) => match never {},
            Ok(Err(ended)) => ended,
            Err(cause) => LinkError::Panicked(panic_message(&*cause)),
        }
    }

    /// Sleeps, but not through a stop; commands that come meanwhile are dropped.
    fn back_off(&mut self, pause: Duration) {
        let until = self.now().plus(Nanos(u64::try_from(pause.as_nanos()).unwrap_or(u64::MAX)));
        let stopping = self.stopping();
        while self.now() < until && self.stopping() == stopping {
            self.sleep_until(Some(until));
            self.endpoint.discard_commands();
        }
    }
}

#[cfg(test)]
mod tests;
