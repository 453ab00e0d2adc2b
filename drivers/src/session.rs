//! The life of a link: connect, converse until something is wrong, tell the loop, back off, connect anew.

use super::endpoint::{BadFrame, Endpoint};
use realtime::ports::{Nanos, NoData};
use std::convert::Infallible;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::SyncSender;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// A thread looks at least this often whether it is to stop.
pub const LONGEST_SLEEP: Duration = Duration::from_millis(20);

/// So many bad answers in a row end a connection.
pub const BAD_IN_A_ROW: u32 = 3;

/// Why a conversation ended.
#[derive(Debug, thiserror::Error)]
pub enum Ended {
    /// The thread is to end.
    #[error("stopped")]
    Stopped,
    /// A deadline passed.
    #[error("no answer within {0} ms")]
    Timeout(u32),
    /// The line itself failed.
    #[error("{0}")]
    Io(String),
    /// The instrument refuses what it is asked.
    #[error("the instrument refused: {0}")]
    Refused(String),
    /// Answers do not pass their checks.
    #[error("{BAD_IN_A_ROW} bad answers in a row; the last: {0}")]
    Corrupt(String),
    /// A frame that must not become a sample.
    #[error(transparent)]
    Frame(#[from] BadFrame),
}

impl From<std::io::Error> for Ended {
    fn from(error: std::io::Error) -> Self {
        Self::Io(error.to_string())
    }
}

/// Something that happens again and again.
#[derive(Debug, Clone)]
pub struct Periodic {
    period: u64,
    /// When it happens next.
    pub due: Nanos,
}

impl Periodic {
    /// From `now` on, so many times a second.
    #[must_use]
    pub fn new(rate_hz: f64, now: Nanos) -> Self {
        Self { period: Nanos::from_seconds(1.0 / rate_hz).0.max(1), due: now }
    }

    /// Whether it is time.
    #[must_use]
    pub fn is_due(&self, now: Nanos) -> bool {
        self.due <= now
    }

    /// The next time after this one; missed ones are left out, so that a pause makes no burst.
    pub fn advance(&mut self, now: Nanos) {
        let missed = now.since(self.due).0 / self.period;
        self.due = Nanos(self.due.0 + (missed + 1) * self.period);
    }
}

/// What every transport's thread starts from.
pub struct Session {
    /// Frames to samples, commands to set-points.
    pub endpoint: Endpoint,
    /// The moment that the loop calls zero.
    pub epoch: Instant,
    /// Set when the thread is to send the safe set-points and end.
    pub stop: Arc<AtomicBool>,
    /// Takes the outcome of the first connection, once.
    pub ready: Option<SyncSender<Result<(), String>>>,
}

impl Session {
    /// Nanoseconds since the epoch.
    #[must_use]
    pub fn now(&self) -> Nanos {
        Nanos(u64::try_from(self.epoch.elapsed().as_nanos()).unwrap_or(u64::MAX))
    }

    /// Tells whoever opened the rig how the first connection went. Returns whether it was the first.
    pub fn tell(&mut self, outcome: Result<(), String>) -> bool {
        self.ready.take().is_some_and(|ready| {
            let _ = ready.send(outcome);
            true
        })
    }

    /// Whether the thread is to end.
    #[must_use]
    pub fn stopping(&self) -> bool {
        self.stop.load(Ordering::Acquire)
    }

    /// Sleeps until `due`, but never long.
    pub fn sleep_until(&self, due: Option<Nanos>) {
        let pause = due.map_or(LONGEST_SLEEP, |due| Duration::from_nanos(due.since(self.now()).0));
        std::thread::sleep(pause.min(LONGEST_SLEEP));
    }

    /// Starts the thread, which converses again and again until it is told to stop.
    ///
    /// # Errors
    /// Where no thread can be had.
    pub fn spawn(
        mut self,
        mut converse: impl FnMut(&mut Session) -> Result<Infallible, Ended> + Send + 'static,
    ) -> Result<JoinHandle<()>, String> {
        let name: String = self.endpoint.profile().id().chars().take(15).collect();
        let run = move || self.keep_up(&mut converse);
        std::thread::Builder::new().name(name).spawn(run).map_err(|error| error.to_string())
    }

    fn keep_up(&mut self, converse: &mut dyn FnMut(&mut Session) -> Result<Infallible, Ended>) {
        let link = &self.endpoint.profile().description.link;
        let first = Duration::from_millis(u64::from(link.backoff_first_ms));
        let longest = Duration::from_millis(u64::from(link.backoff_longest_ms));
        let health = self.endpoint.health();
        let mut pause = first;
        while !self.stopping() {
            let samples_before = health.report().samples;
            let ended = match converse(self) {
                Ok(never) => match never {},
                Err(ended) => ended,
            };
            self.endpoint.link_down(NoData::Disconnected);
            if matches!(ended, Ended::Stopped) {
                break;
            }
            if matches!(ended, Ended::Timeout(_)) {
                health.count(&health.timeouts);
            }
            health.problem(ended.to_string());
            tracing::warn!(instrument = self.endpoint.profile().id(), %ended, "the link went down");
            if self.tell(Err(ended.to_string())) {
                return; // whoever opened the rig wants to know, not to wait
            }
            // A connection that gave samples was a good one: begin with the short pause again.
            pause = if health.report().samples > samples_before { first } else { (2 * pause).min(longest) };
            self.back_off(pause);
        }
    }

    /// Sleeps, but not through a stop; commands that come meanwhile are dropped, not kept.
    fn back_off(&mut self, pause: Duration) {
        let until = self.now().plus(Nanos(u64::try_from(pause.as_nanos()).unwrap_or(u64::MAX)));
        while self.now() < until && !self.stopping() {
            self.sleep_until(Some(until));
            self.endpoint.discard_commands();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pause_makes_no_burst() {
        let mut periodic = Periodic::new(1000.0, Nanos(0));
        periodic.advance(Nanos(100));
        assert_eq!(periodic.due, Nanos(1_000_000));
        periodic.advance(Nanos(5_500_000));
        assert_eq!(periodic.due, Nanos(6_000_000));
    }
}
