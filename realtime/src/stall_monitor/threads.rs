//! The threads of the monitor.
#![allow(clippy::disallowed_methods, reason = "the monitor measures how late ordinary threads wake")]

use super::{Stall, StallReport};
use crate::pacing::{monotonic_ns, pin_to, sleep_until};
use crate::ports::Nanos;
use crate::threads::refused;
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
            threads.push(builder.spawn(move || watch(cpu, origin_ns, &end)).map_err(refused)?);
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
    // Where that is not allowed the thread still sees what happens to it.
    let _ = pin_to(cpu);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_monitor_starts_and_ends() {
        let monitor = StallMonitor::start(monotonic_ns()).unwrap();
        std::thread::sleep(std::time::Duration::from_millis(20));
        let report = monitor.finish();
        assert!(report.count as usize >= report.latest.len());
    }
}
