//! The thread of the loop: absolute deadlines, priority, locked memory, lateness histogram.
//!
//! What a loop is to ask of the machine and what it reports is plain data on any system; the thread itself
//! ([`run`], in `pacing/thread.rs`) and its calls of the machine (`pacing/machine.rs`) need Linux.

#[cfg(target_os = "linux")]
mod machine;
#[cfg(target_os = "linux")]
mod thread;

use crate::ports::Nanos;
use serde::{Deserialize, Serialize};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

#[cfg(target_os = "linux")]
pub use machine::{ask_for_real_time, monotonic_ns, process_cpu_ns};
#[cfg(target_os = "linux")]
pub(crate) use machine::{pin_to, sleep_until};
#[cfg(target_os = "linux")]
pub use thread::{LoopParts, lateness_of_sleep, run};

/// What a loop has to tell when it ends. Stored in every run.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct LoopReport {
    /// Scheduling and memory.
    pub grants: Grants,
    /// Period in ns.
    pub period_ns: u64,
    /// Cycles run.
    pub cycles: u64,
    /// Deadlines missed: skipped because a cycle ended too late, or past by a period when the thread woke.
    pub overruns: u64,
    /// Rows lost because the record's ring was full.
    pub ring_drops: u64,
    /// Rows that the sweep did not see because its ring was full.
    pub watch_drops: u64,
    /// Minor page faults of the thread after its first cycle.
    pub minor_faults: i64,
    /// Major page faults of the thread after its first cycle.
    pub major_faults: i64,
    /// Lateness quantiles in ns over all deadlines, skipped ones included: 0.5, 0.9, 0.99, 0.999, maximum.
    pub lateness_ns: [u64; 5],
    /// Message of a port's panic, which ended the loop with the drive off; `None` otherwise.
    pub panicked: Option<String>,
    /// Lateness counts: upper bound of a bucket in ns, deadlines in it.
    pub histogram: Vec<(u64, u64)>,
}

/// Shared between the loop's thread and its supervisor.
#[derive(Debug, Default)]
pub struct Lifeline {
    /// Set to end the loop after its present cycle.
    pub end: AtomicBool,
    /// Counts cycles: the supervisor sees that the loop lives.
    pub heartbeat: AtomicU64,
    /// Time that the plate was driven in this run, in ns.
    pub driven_ns: AtomicU64,
    /// The squared rms velocity summed over that, in m2/s: the bits of an `f64`.
    pub dose_bits: AtomicU64,
}

impl Lifeline {
    /// Time that the plate was driven in this run, and its dose in m2/s.
    pub fn driven(&self) -> (Nanos, f64) {
        let dose = f64::from_bits(self.dose_bits.load(Ordering::Relaxed));
        (Nanos(self.driven_ns.load(Ordering::Relaxed)), dose)
    }
}

/// What the thread requested of the machine and what it got.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Grants {
    /// Scheduling policy as read back: `fifo`, `other`, or a number.
    pub policy: String,
    /// Priority as read back.
    pub priority: i32,
    /// Why SCHED_FIFO was not granted.
    pub policy_refused: Option<String>,
    /// Whether all memory is locked.
    pub memory_locked: bool,
    /// Why memory could not be locked.
    pub lock_refused: Option<String>,
    /// CPUs that the thread may run on, as read back; empty where it was not pinned.
    #[serde(default)]
    pub pinned_to: Vec<usize>,
    /// Why it could not be pinned, or the CPUs could not stay awake.
    pub pace_refused: Option<String>,
    /// Whether deep sleep of the CPUs is held off.
    #[serde(default)]
    pub cpus_awake: bool,
}

/// What the loop's thread is to ask of the machine. All of it is optional; each has its price.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pacing {
    /// FIFO priority to ask for, with locked memory; `None` leaves scheduling and memory alone.
    pub priority: Option<i32>,
    /// CPU to run on and no other. Worth it on a CPU that is free of other work; on a shared one it is worse.
    pub cpu: Option<usize>,
    /// Keeps CPUs out of deep sleep (`/dev/cpu_dma_latency`): a shorter wake-up for some watts.
    pub keep_cpus_awake: bool,
    /// The last so many ns before a deadline are spun, not slept: of a CPU this costs that share of the period.
    pub spin_ns: u64,
}

/// The message of a panic.
pub fn panic_message(cause: &(dyn std::any::Any + Send)) -> String {
    let text = cause.downcast_ref::<&str>().map(ToString::to_string);
    text.or_else(|| cause.downcast_ref::<String>().cloned()).unwrap_or_else(|| "no words".into())
}
