//! The thread of the loop.
//!
//! Overrun policy: a cycle that ends past the next deadline skips the deadlines it has missed, so the loop
//! never runs two cycles back to back to catch up. Skipped deadlines are counted, and the lateness of the
//! next cycle is that against the first deadline that was due: safety sees it, and the histogram holds every
//! deadline, run or skipped. Whatever ends the loop, the last command to the ports is 'off'.

use super::machine::{
    ask_for_real_time, keep_cpus_awake, monotonic_ns, pin_to, sleep_until, thread_faults, wait_until,
};
use super::{Grants, Lifeline, LoopReport, Pacing, panic_message};
use crate::clock::Participant;
use crate::cycle::{Config, CycleState};
use crate::cycle_io::{Ports, Row, Tick, run_cycle};
use crate::ports::{Nanos, SupplyCommand};
use crate::queue::CommandQueue;
use crate::safety::{DriveCommand, StageCommand};
use hdrhistogram::Histogram;
use models::FrictionModel;
use ringbuf::HeapProd;
use ringbuf::traits::Producer;
use std::panic::AssertUnwindSafe;
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// What the loop needs besides its ports.
pub struct LoopParts {
    /// Limits, timing, estimate.
    pub config: Config,
    /// The model to compare with.
    pub model: Arc<dyn FrictionModel>,
    /// The rig.
    pub ports: Ports,
    /// Commands in.
    pub commands: Arc<CommandQueue>,
    /// Rows out, to the record.
    pub rows: HeapProd<Row>,
    /// The same rows, to the sweep: so that a slow disk cannot hold the sweep up.
    pub watch: HeapProd<Row>,
    /// End and heartbeat.
    pub life: Arc<Lifeline>,
    /// CLOCK_MONOTONIC in ns that counts as loop time zero. Drivers stamp with the same origin.
    pub origin_ns: u64,
    /// The held clock of a virtual rig, as which the loop then reads time; `None`: the machine's.
    pub held: Option<Participant>,
}

#[derive(Clone, Copy, Debug)]
struct DeadlineGrid {
    period: u64,
    /// The deadline that is due next.
    due: u64,
}

impl DeadlineGrid {
    /// The first deadline of the grid that is not past: where the next cycle begins.
    const fn next(&self, now: u64) -> u64 {
        let past = now.saturating_sub(self.due);
        self.due + past.div_ceil(self.period) * self.period
    }

    /// A cycle begins: how late it is against the deadline that was due, and how many deadlines it has missed.
    const fn begin(&mut self, begun: u64) -> (u64, u64) {
        let late = begun.saturating_sub(self.due);
        let missed = late / self.period;
        self.due += (missed + 1) * self.period;
        (late, missed)
    }
}

/// Runs the loop on the calling thread until its lifeline says to end. Call it on a thread of its own.
/// `pacing` is what to ask of the machine.
pub fn run(parts: LoopParts, pacing: Pacing) -> LoopReport {
    let LoopParts { config, model, mut ports, commands, mut rows, mut watch, life, origin_ns, held } = parts;
    // On the machine's scale, whichever clock it is.
    let now_ns = || held.as_ref().map_or_else(monotonic_ns, |clock| origin_ns + clock.now().0);
    let period = config.limits.timing.cycle.0;
    let mut lateness_histogram = lateness_histogram();
    let mut grants = match pacing.priority {
        Some(priority) => ask_for_real_time(priority),
        None => Grants { policy: "unchanged".into(), ..Grants::default() },
    };
    if let Some(cpu) = pacing.cpu {
        match pin_to(cpu) {
            Ok(cpus) => grants.pinned_to = cpus,
            Err(why) => grants.pace_refused = Some(format!("cpu {cpu}: {why}")),
        }
    }
    let awake = pacing.keep_cpus_awake.then(keep_cpus_awake);
    grants.cpus_awake = matches!(awake, Some(Ok(_)));
    if let Some(Err(why)) = &awake {
        grants.pace_refused = Some(format!("/dev/cpu_dma_latency: {why}"));
    }
    let mut state = CycleState::default();
    let (mut cycles, mut overruns, mut ring_drops, mut watch_drops) = (0u64, 0u64, 0u64, 0u64);
    let mut faults_at_start = (0, 0);
    let mut panicked = None;
    let mut grid = DeadlineGrid { period, due: now_ns() + period };
    loop {
        let due = grid.next(now_ns());
        match &held {
            None => wait_until(due, pacing.spin_ns),
            Some(clock) => clock.sleep_until(Nanos(due - origin_ns)),
        }
        let begun = now_ns();
        let (late, missed) = grid.begin(begun);
        overruns += missed;
        cycles += 1;
        let now = Nanos(begun.saturating_sub(origin_ns));
        let tick = Tick { number: cycles, lateness: Nanos(late), now };
        // A port is foreign code: if it panics, the drive goes off before anything else, and the loop ends.
        let turned = std::panic::catch_unwind(AssertUnwindSafe(|| {
            run_cycle(&config, &*model, &mut state, &mut ports, &mut || commands.pop(), tick)
        }));
        let row = match turned {
            Ok(row) => row,
            Err(cause) => {
                panicked = Some(panic_message(&*cause));
                break;
            }
        };
        // After the commands have left: a long stall has many deadlines.
        count_deadlines(&mut lateness_histogram, late, missed, period);
        if rows.try_push(row).is_err() {
            ring_drops += 1;
        }
        if watch.try_push(row).is_err() {
            watch_drops += 1;
        }
        let (driven, dose_m2_s) = state.exposure();
        life.driven_ns.store(driven.0, Ordering::Relaxed);
        life.dose_bits.store(dose_m2_s.to_bits(), Ordering::Relaxed);
        life.heartbeat.store(cycles, Ordering::Relaxed);
        if life.end.load(Ordering::Relaxed) {
            break;
        }
        if cycles == 1 {
            faults_at_start = thread_faults();
        }
    }
    switch_off(&mut ports, Nanos(now_ns().saturating_sub(origin_ns)));
    drop(awake);
    let (minor_faults, major_faults) = thread_faults();
    let [half, most, hundredth, thousandth] =
        [0.5, 0.9, 0.99, 0.999].map(|q| lateness_histogram.value_at_quantile(q));
    LoopReport {
        grants,
        period_ns: period,
        cycles,
        overruns,
        ring_drops,
        watch_drops,
        minor_faults: minor_faults - faults_at_start.0,
        major_faults: major_faults - faults_at_start.1,
        lateness_ns: [half, most, hundredth, thousandth, lateness_histogram.max()],
        panicked,
        histogram: lateness_histogram
            .iter_log(1_000, 2.0)
            .map(|step| (step.value_iterated_to(), step.count_since_last_iteration()))
            .collect(),
    }
}

/// Longest resolved lateness, in ns.
const LONGEST_NS: u64 = 10_000_000_000;

/// 1 us to 10 s at two digits: some 40 kB, allocated once.
fn lateness_histogram() -> Histogram<u64> {
    Histogram::new_with_bounds(1_000, LONGEST_NS, 2).expect("the bounds are constants")
}

/// Counts the lateness of a cycle and of the deadlines that were missed before it. Those were late as well,
/// each by one period less: without them a stall would count once.
fn count_deadlines(histogram: &mut Histogram<u64>, late: u64, missed: u64, period: u64) {
    for k in 0..=missed.min(LONGEST_NS / period) {
        histogram.saturating_record(late - k * period);
    }
}

/// Commands every port: off, at rest. A port that panics does not stop the others; its instrument then has
/// its own watchdog and the second channel.
fn switch_off(ports: &mut Ports, now: Nanos) {
    let expires_at = now.plus(Nanos(1_000_000_000));
    let off = DriveCommand::off(u32::MAX, expires_at);
    let commanded = std::panic::catch_unwind(AssertUnwindSafe(|| ports.amplifier.command(off, now))).is_ok();
    let stop = StageCommand::stop(u32::MAX, expires_at);
    let _ = std::panic::catch_unwind(AssertUnwindSafe(|| ports.stage.command(stop, now)));
    if !commanded {
        let cut = AssertUnwindSafe(|| ports.supply.command(SupplyCommand::Cut, now));
        let _ = std::panic::catch_unwind(cut);
    }
}

/// Lateness in ns of a bare absolute sleep of that period, for so long: what the machine itself gives.
pub fn lateness_of_sleep(during: std::time::Duration, period: std::time::Duration) -> Vec<u64> {
    let period_ns = (period.as_nanos() as u64).max(1);
    let count = (during.as_nanos() as u64 / period_ns).max(1);
    let mut late = Vec::with_capacity(count as usize);
    let mut deadline = monotonic_ns() + period_ns;
    for _ in 0..count {
        sleep_until(deadline);
        let begun = monotonic_ns();
        late.push(begun.saturating_sub(deadline));
        deadline = deadline_after(deadline, begun, period_ns);
    }
    late
}

/// The deadline after one that was met at `begun`: on the grid, or a period from now where that one is past as well.
const fn deadline_after(deadline: u64, begun: u64, period: u64) -> u64 {
    let next = deadline + period;
    if begun > next { begun + period } else { next }
}

#[cfg(test)]
mod tests;
