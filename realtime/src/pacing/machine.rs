//! Requests of the loop's thread to the machine, and the machine's clocks: scheduling, memory, CPUs, sleep.
//!
//! Nothing here is needed for safety: [`Grants`] lists what was refused, and a loop that is late for it
//! trips.

use super::Grants;

/// CLOCK_MONOTONIC in ns.
pub fn monotonic_ns() -> u64 {
    clock_ns(libc::CLOCK_MONOTONIC)
}

/// Processor time that this process has used, all threads, in ns.
pub fn process_cpu_ns() -> u64 {
    clock_ns(libc::CLOCK_PROCESS_CPUTIME_ID)
}

fn clock_ns(clock: libc::clockid_t) -> u64 {
    let mut t = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: `t` is a valid timespec for the kernel to write, and both clocks above always exist on Linux.
    unsafe { libc::clock_gettime(clock, &mut t) };
    t.tv_sec as u64 * 1_000_000_000 + t.tv_nsec as u64
}

/// Sleeps until CLOCK_MONOTONIC reaches a time in ns.
pub(crate) fn sleep_until(absolute_ns: u64) {
    let t = libc::timespec {
        tv_sec: (absolute_ns / 1_000_000_000) as libc::time_t,
        tv_nsec: (absolute_ns % 1_000_000_000) as libc::c_long,
    };
    // SAFETY: `t` is a valid timespec; an absolute deadline has no remainder, so null is allowed.
    // A signal may end the sleep early: then sleep again until the same deadline.
    while unsafe {
        libc::clock_nanosleep(libc::CLOCK_MONOTONIC, libc::TIMER_ABSTIME, &t, std::ptr::null_mut())
    } == libc::EINTR
    {}
}

/// Asks for SCHED_FIFO, locked memory and a small timer slack for the calling thread, and reads back what it got.
pub fn ask_for_real_time(priority: i32) -> Grants {
    let mut grants = Grants::default();
    let refused = || std::io::Error::last_os_error().to_string();
    let wanted = libc::sched_param { sched_priority: priority };
    // SAFETY: plain calls on the calling thread (pid 0) with a valid parameter struct. SCHED_RESET_ON_FORK
    // keeps threads that are spawned later from inheriting the class.
    let got = unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO | libc::SCHED_RESET_ON_FORK, &wanted) };
    if got != 0 {
        grants.policy_refused = Some(refused());
    }
    let mut param = libc::sched_param { sched_priority: 0 };
    // SAFETY: reading back the calling thread's policy and parameters into a valid struct.
    let policy = unsafe {
        libc::sched_getparam(0, &mut param);
        libc::sched_getscheduler(0) & !libc::SCHED_RESET_ON_FORK
    };
    grants.policy = match policy {
        libc::SCHED_FIFO => "fifo".into(),
        libc::SCHED_OTHER => "other".into(),
        other => other.to_string(),
    };
    grants.priority = param.sched_priority;
    // SAFETY: raising one's own limit as far as the hard limit allows, then locking; no pointers outlive the calls.
    let locked = unsafe {
        let mut limit = libc::rlimit { rlim_cur: 0, rlim_max: 0 };
        libc::getrlimit(libc::RLIMIT_MEMLOCK, &mut limit);
        limit.rlim_cur = limit.rlim_max;
        libc::setrlimit(libc::RLIMIT_MEMLOCK, &limit);
        libc::mlockall(libc::MCL_CURRENT | libc::MCL_FUTURE) == 0
    };
    grants.memory_locked = locked;
    if !locked {
        grants.lock_refused = Some(refused());
    }
    // SAFETY: sets the calling thread's timer slack to 1 ns; takes no pointers.
    unsafe { libc::prctl(libc::PR_SET_TIMERSLACK, 1, 0, 0, 0) };
    touch_stack();
    grants
}

/// Touches the stack that the loop will use, so that its pages are there before the first deadline.
#[inline(never)]
fn touch_stack() {
    let mut pages = [0u8; 256 * 1024];
    for page in pages.chunks_mut(4096) {
        page[0] = 1;
    }
    // What nobody looks at as a whole is taken apart by the optimiser, and then its pages are never there.
    std::hint::black_box(&mut pages);
}

pub(super) fn thread_faults() -> (i64, i64) {
    // SAFETY: rusage is plain data, valid when zeroed, and the kernel fills it for the calling thread.
    let usage = unsafe {
        let mut usage: libc::rusage = std::mem::zeroed();
        libc::getrusage(libc::RUSAGE_THREAD, &mut usage);
        usage
    };
    (usage.ru_minflt, usage.ru_majflt)
}

/// Binds the calling thread to a CPU; the CPUs that it may run on then.
pub(crate) fn pin_to(cpu: usize) -> std::io::Result<Vec<usize>> {
    if cpu >= libc::CPU_SETSIZE as usize {
        return Err(std::io::Error::from_raw_os_error(libc::EINVAL));
    }
    // SAFETY: `set` is plain data, valid when zeroed; CPU_SET stays inside it by the check above; both calls
    // concern the calling thread (pid 0) and a set of the size given.
    unsafe {
        let mut set: libc::cpu_set_t = std::mem::zeroed();
        libc::CPU_SET(cpu, &mut set);
        let size = size_of::<libc::cpu_set_t>();
        if libc::sched_setaffinity(0, size, &set) != 0 || libc::sched_getaffinity(0, size, &mut set) != 0 {
            return Err(std::io::Error::last_os_error());
        }
        Ok((0..libc::CPU_SETSIZE as usize).filter(|cpu| libc::CPU_ISSET(*cpu, &set)).collect())
    }
}

/// Holds the CPUs out of deep sleep for as long as the file is open.
pub(super) fn keep_cpus_awake() -> std::io::Result<std::fs::File> {
    use std::io::Write;
    let mut file = std::fs::File::options().write(true).open("/dev/cpu_dma_latency")?;
    file.write_all(&0i32.to_ne_bytes())?;
    Ok(file)
}

/// Sleeps until `spin_ns` before a time, then spins.
pub(super) fn wait_until(absolute_ns: u64, spin_ns: u64) {
    sleep_until(absolute_ns - spin_ns.min(absolute_ns));
    while spin_ns > 0 && monotonic_ns() < absolute_ns {
        std::hint::spin_loop();
    }
}

#[cfg(test)]
pub(super) mod tests;
