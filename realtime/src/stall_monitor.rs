//! Monitor of the machine's stalls: one idle thread a CPU, at ordinary priority, that records its delays.
//!
//! In wall-clock time a trip for stale data may come from the rig or from the machine: a shared virtual
//! machine takes a CPU away for milliseconds, and drivers (or an embedded virtual rig) on it fall silent. The
//! monitor shows which. A thread of it sleeps to absolute deadlines as the loop does, but as an ordinary
//! thread, bound to its CPU: what delays it delays the drivers there too.
#![allow(clippy::disallowed_methods, reason = "the monitor measures how late ordinary threads wake")]

use crate::pacing::{monotonic_ns, sleep_until};
use crate::ports::Nanos;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

/// Sleep of a monitor thread.
const PERIOD_NS: u64 = 1_000_000;
/// Delays from here on are noted: the age that the fastest channels are allowed.
const STALL_NS: u64 = 3_000_000;
/// Latest stalls that are stored for each CPU; all are counted.
const STORED: usize = 256;
/// Most monitored CPUs: more show nothing new.
const CPUS: usize = 16;

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

/// The running monitor.
pub struct StallMonitor {
    end: Arc<AtomicBool>,
    threads: Vec<JoinHandle<StallReport>>,
}

impl StallMonitor {
    /// Starts one thread a CPU; `origin_ns` is the loop's time zero on the monotonic clock.
    ///
    /// # Errors
    /// A thread that the system refuses.
    pub fn start(origin_ns: u64) -> std::io::Result<Self> {
        let end = Arc::new(AtomicBool::new(false));
        let cpus = std::thread::available_parallelism().map_or(1, usize::from).min(CPUS);
        let mut threads = Vec::with_capacity(cpus);
        for cpu in 0..cpus {
            let end = Arc::clone(&end);
            let builder = std::thread::Builder::new().name(format!("monitor-{cpu}")).stack_size(64 * 1024);
            threads.push(builder.spawn(move || watch(cpu, origin_ns, &end))?);
        }
        Ok(StallMonitor { end, threads })
    }

    /// Ends them and gathers what they saw.
    pub fn finish(self) -> StallReport {
        self.end.store(true, Ordering::Relaxed);
        let mut all = StallReport::default();
        for seen in self.threads.into_iter().filter_map(|t| t.join().ok()) {
            all.count += seen.count;
            all.worst = all.worst.max(seen.worst);
            all.latest.extend(seen.latest);
        }
        all.latest.sort_by_key(|s| s.until);
        all
    }
}

fn watch(cpu: usize, origin_ns: u64, end: &AtomicBool) -> StallReport {
    bind_to(cpu);
    let mut seen = StallReport { latest: Vec::with_capacity(STORED), ..StallReport::default() };
    let mut deadline = monotonic_ns() + PERIOD_NS;
    while !end.load(Ordering::Relaxed) {
        sleep_until(deadline);
        let now = monotonic_ns();
        let late = now.saturating_sub(deadline);
        if late >= STALL_NS {
            if seen.latest.len() == STORED {
                seen.latest.remove(0);
            }
            let lasted = Nanos(late);
            seen.latest.push(Stall { until: Nanos(now.saturating_sub(origin_ns)), lasted, cpu });
            seen.count += 1;
            seen.worst = seen.worst.max(lasted);
        }
        deadline = if late >= PERIOD_NS { now + PERIOD_NS } else { deadline + PERIOD_NS };
    }
    seen
}

/// Binds the calling thread to a CPU. Where that is not allowed the thread still sees what happens to it.
fn bind_to(cpu: usize) {
    // SAFETY: `set` is plain data, valid when zeroed; CPU_SET stays inside it as `cpu` is below CPUS; the call reads
    // it for the calling thread (pid 0) only.
    unsafe {
        let mut set: libc::cpu_set_t = std::mem::zeroed();
        libc::CPU_SET(cpu, &mut set);
        libc::sched_setaffinity(0, size_of::<libc::cpu_set_t>(), &set);
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

    #[test]
    fn the_monitor_starts_and_ends() {
        let monitor = StallMonitor::start(monotonic_ns()).unwrap();
        std::thread::sleep(std::time::Duration::from_millis(20));
        let report = monitor.finish();
        assert!(report.count as usize >= report.latest.len());
    }
}
