//! What a link counts. Written by the link's thread, read by anyone.

use serde::Serialize;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

fn locked<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

macro_rules! counters {
    ($($(#[$doc:meta])* $name:ident,)+) => {
        /// Counters of one link.
        #[derive(Debug, Default)]
        pub struct Health {
            $($(#[$doc])* pub $name: AtomicU64,)+
            last_problem: Mutex<String>,
            fault: Mutex<String>,
            reported: Mutex<BTreeMap<String, u64>>,
        }

        /// The counters at one moment.
        #[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
        pub struct HealthReport {
            $($(#[$doc])* pub $name: u64,)+
            /// The latest problem in words; empty where there was none.
            pub last_problem: String,
            /// The fault that the instrument reports now, in its profile's words; empty for none.
            pub fault: String,
            /// States of `[[fault]]`, of any severity, that the instrument entered, and how often.
            pub reported: BTreeMap<String, u64>,
        }

        impl Health {
            /// The counters now.
            pub fn report(&self) -> HealthReport {
                HealthReport {
                    $($name: self.$name.load(Ordering::Relaxed),)+
                    last_problem: locked(&self.last_problem).clone(),
                    fault: locked(&self.fault).clone(),
                    reported: locked(&self.reported).clone(),
                }
            }
        }
    };
}

counters! {
    /// Connections made.
    connections,
    /// Samples handed to the loop.
    samples,
    /// Frames that showed no new sample.
    repeats,
    /// Samples that the instrument counted and that never came.
    lost_samples,
    /// Samples older than one already seen.
    out_of_order,
    /// Frames that failed their checks.
    corrupt_frames,
    /// Requests that the instrument refused.
    exceptions,
    /// Answers that did not come in time; each ended its connection.
    timeouts,
    /// Samples for which the loop's ring had no room.
    ring_full,
    /// Set-point blocks sent.
    commands_sent,
    /// Commands that were not sent since their time had passed.
    commands_expired,
    /// Commands that the profile's ranges refused.
    commands_refused,
    /// Times that the safe set-points were sent for want of a valid command.
    safe_sent,
    /// Alarms that the instrument raised unasked.
    alarms,
    /// Times that the instrument's clock or counter started anew.
    clock_resets,
}

impl Health {
    /// One more.
    pub fn count(&self, counter: &AtomicU64) {
        counter.fetch_add(1, Ordering::Relaxed);
    }

    /// Keeps the fault that the instrument reports now; empty for none.
    pub fn fault(&self, text: String) {
        *locked(&self.fault) = text;
    }

    /// One more time that the instrument entered this state of its profile's `[[fault]]`.
    pub fn reported(&self, text: &str) {
        *locked(&self.reported).entry(text.into()).or_default() += 1;
    }

    /// Keeps the latest problem in words.
    pub fn problem(&self, text: impl Into<String>) {
        *locked(&self.last_problem) = text.into();
    }
}
