//! Monitor of the machine's stalls: one idle thread a CPU, at ordinary priority, that records its delays.
//!
//! In wall-clock time a trip for stale data may come from the rig or from the machine: a shared virtual
//! machine takes a CPU away for milliseconds, and drivers (or an embedded virtual rig) on it fall silent. The
//! monitor shows which. A thread of it sleeps to absolute deadlines as the loop does, but as an ordinary
//! thread, bound to its CPU: what delays it delays the drivers there too.
//!
//! The report is plain data on any system; the threads need Linux.

#[cfg(target_os = "linux")]
mod threads;

use crate::ports::Nanos;
use serde::{Deserialize, Serialize};
#[cfg(target_os = "linux")]
pub use threads::StallMonitor;

/// One delay of an ordinary thread.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stall {
    /// Loop time at which it was over.
    pub until: Nanos,
    /// How long the thread could not run.
    pub lasted: Nanos,
    /// On which CPU.
    pub cpu: usize,
}

/// The monitor's report. Stored in every run in wall-clock time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StallReport {
    /// Delays of 3 ms and more, all CPUs.
    pub count: u64,
    /// The longest.
    pub worst: Nanos,
    /// The latest of each CPU, at most 256 a CPU, in order of time.
    pub latest: Vec<Stall>,
}

impl StallReport {
    /// The longest stall that touches the time from `from` to `until`, if there was one.
    pub fn within(&self, from: Nanos, until: Nanos) -> Option<Stall> {
        let touches = |s: &&Stall| s.until >= from && Nanos(s.until.0.saturating_sub(s.lasted.0)) <= until;
        self.latest.iter().filter(touches).max_by_key(|s| s.lasted).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stalls_are_found_by_the_time_they_cover() {
        let stall = |until, lasted| Stall { until: Nanos(until), lasted: Nanos(lasted), cpu: 0 };
        let report = StallReport { latest: vec![stall(100, 20), stall(200, 50)], ..StallReport::default() };
        assert_eq!(report.within(Nanos(90), Nanos(95)), Some(stall(100, 20)));
        assert_eq!(report.within(Nanos(101), Nanos(149)), None);
        assert_eq!(report.within(Nanos(0), Nanos(1000)), Some(stall(200, 50)));
    }
}
