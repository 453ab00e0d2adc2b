//! This computer, judged by what the loop needs: the rights of its thread, the kernel, the processor, and how
//! late a sleep ends, idle and under load.

use super::Finding;
use realtime::pacing;
use serde::Serialize;
use std::path::Path;
use std::time::{Duration, Instant};

/// Quantiles of the lateness that are reported.
const QUANTILES: [f64; 4] = [0.5, 0.99, 0.999, 1.0];

/// Lateness of a bare 1 kHz sleep, without load and with every core busy, in us.
#[derive(Debug, Serialize)]
pub struct Lateness {
    /// Without load.
    pub idle: [f64; 4],
    /// With every core busy.
    pub loaded: [f64; 4],
    /// Which quantiles these are.
    pub quantiles: [f64; 4],
}

/// Judges this computer; the lateness is measured for so many s, twice.
pub fn judge(seconds: f64) -> (Vec<Finding>, Lateness) {
    let seconds = seconds.clamp(0.1, 60.0);
    let (grants, idle) = measure(seconds, 0);
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let (_, loaded) = measure(seconds, cores);
    let found = format!("99.9 % {:.0} \u{b5}s, worst {:.0} \u{b5}s", loaded[2], loaded[3]);
    let advice = "use a PREEMPT_RT kernel, isolate a core (isolcpus, nohz_full), no virtual machine";
    let late = Finding::new("lateness under load", loaded[2] < 500.0, found, advice);
    let findings = rights(&grants).into_iter().chain(kernel()).chain(hardware()).chain([late]);
    (findings.collect(), Lateness { idle, loaded, quantiles: QUANTILES })
}

/// Lateness quantiles of a 1 kHz sleep in us, with so many busy threads beside it.
fn measure(seconds: f64, busy: usize) -> (pacing::Grants, [f64; 4]) {
    let until = Instant::now() + Duration::from_secs_f64(seconds);
    let loads: Vec<_> = (0..busy).map(|i| std::thread::spawn(move || work(i as f64, until))).collect();
    let looping = std::thread::spawn(move || {
        let grants = pacing::ask_for_real_time(80);
        (grants, pacing::lateness_of_sleep(Duration::from_secs_f64(seconds), Duration::from_millis(1)))
    });
    let (grants, mut late) = looping.join().unwrap_or_default();
    loads.into_iter().for_each(|load| drop(load.join()));
    late.sort_unstable();
    let at = |q: f64| {
        let i = ((late.len() as f64 * q) as usize).min(late.len().saturating_sub(1));
        late.get(i).map_or(0.0, |ns| *ns as f64 / 1e3)
    };
    (grants, QUANTILES.map(at))
}

/// Keeps a core busy.
fn work(mut x: f64, until: Instant) -> f64 {
    while Instant::now() < until {
        for _ in 0..10_000 {
            x = (x + 1.0).sqrt();
        }
    }
    std::hint::black_box(x)
}

fn read(path: &str) -> Option<String> {
    std::fs::read_to_string(path).ok().map(|s| s.trim().to_string())
}

/// What the kernel granted the loop's thread.
fn rights(grants: &pacing::Grants) -> [Finding; 2] {
    let class = match &grants.policy_refused {
        None => format!("{} at priority {}, read back", grants.policy, grants.priority),
        Some(why) => format!("{}; SCHED_FIFO was refused: {why}", grants.policy),
    };
    let lock = grants.lock_refused.as_ref().map_or("granted".into(), |why| format!("refused: {why}"));
    let rtprio = "give the user RLIMIT_RTPRIO (limits.d: '@realtime - rtprio 98') or CAP_SYS_NICE";
    let memlock = "give the user RLIMIT_MEMLOCK (limits.d: '@realtime - memlock unlimited')";
    [
        Finding::new("scheduling class", grants.policy == "fifo", class, rtprio),
        Finding::new("memory lock", grants.memory_locked, lock, memlock),
    ]
}

/// Which kernel it is, and what it does to threads that must be in time.
fn kernel() -> [Finding; 4] {
    let preempt_rt = read("/sys/kernel/realtime").as_deref() == Some("1");
    let release = read("/proc/sys/kernel/osrelease").unwrap_or_default();
    let release = format!("{release}, {}", if preempt_rt { "PREEMPT_RT" } else { "not PREEMPT_RT" });
    let install = "install a PREEMPT_RT kernel (Debian: linux-image-rt-amd64)";
    let throttle = read("/proc/sys/kernel/sched_rt_runtime_us");
    let throttled = throttle.as_deref() != Some("0");
    let throttle = throttle.map_or("not readable".into(), |t| format!("sched_rt_runtime_us = {t}"));
    let set = "0 forbids real-time threads; set kernel.sched_rt_runtime_us to 950000";
    let group = Path::new("/sys/fs/cgroup/cpu/cpu.rt_runtime_us").exists();
    let grouped = if group { "in force" } else { "not in force" };
    let give = "outside the root group SCHED_FIFO may be taken away silently: give the group rt_runtime";
    let slack = read("/proc/self/timerslack_ns").map_or("not readable".into(), |s| {
        format!("{s} ns for ordinary threads; the loop sets its own to 1 ns")
    });
    [
        Finding::new("kernel", preempt_rt, release, install),
        Finding::new("real-time throttling", throttled, throttle, set),
        Finding::new("real-time group scheduling", !group, grouped, give),
        Finding::new("timer slack", true, slack, ""),
    ]
}

/// The processor, whether it is a real one, and CAN.
fn hardware() -> [Finding; 3] {
    let governor = read("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor");
    let performs = governor.as_deref().is_none_or(|g| g == "performance");
    let governor = governor.unwrap_or_else(|| "no frequency governor is visible".into());
    let virtual_machine = read("/proc/cpuinfo").is_some_and(|c| c.contains("hypervisor"));
    let host = if virtual_machine { "yes: its host may hold it up for milliseconds" } else { "no" };
    let can = match Path::new("/proc/net/can").exists() {
        true => "the kernel has SocketCAN",
        false => "the kernel has no SocketCAN (slcan over a serial port needs none)",
    };
    [
        Finding::new("CPU frequency", performs, governor, "set the governor to 'performance'"),
        Finding::new("virtual machine", !virtual_machine, host, "run a real rig on a machine of its own"),
        Finding::new("CAN", true, can, ""),
    ]
}
