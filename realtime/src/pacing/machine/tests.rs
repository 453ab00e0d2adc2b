//! The reported grants are compared with what the kernel reports of the thread.

use super::*;
use std::sync::{Mutex, MutexGuard};
use std::time::Duration;

/// Locked memory and page faults concern the whole process: one test at a time.
static ALONE: Mutex<()> = Mutex::new(());

pub(in crate::pacing) fn alone() -> MutexGuard<'static, ()> {
    ALONE.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

/// A file of the calling thread below /proc.
fn of_thread(name: &str) -> String {
    std::fs::read_to_string(format!("/proc/thread-self/{name}")).unwrap()
}

/// A field of /proc/thread-self/stat, numbered as in proc(5).
fn stat(field: usize) -> i64 {
    let stat = of_thread("stat");
    // The name in brackets may hold blanks.
    stat.rsplit_once(')').unwrap().1.split_whitespace().nth(field - 3).unwrap().parse().unwrap()
}

fn locked_kib() -> u64 {
    let status = of_thread("status");
    let line = status.lines().find(|line| line.starts_with("VmLck:")).unwrap();
    line.split_whitespace().nth(1).unwrap().parse().unwrap()
}

/// Whether the kernel gives a thread of this process FIFO, and locks its memory. The test uses other calls
/// than the code, and gives both back.
fn what_the_kernel_allows() -> (bool, bool) {
    std::thread::spawn(|| {
        let wanted = libc::sched_param { sched_priority: 37 };
        // SAFETY: concerns the calling thread, with a valid parameter struct.
        let fifo =
            unsafe { libc::pthread_setschedparam(libc::pthread_self(), libc::SCHED_FIFO, &wanted) } == 0;
        // SAFETY: locks what is there and gives it back; the limit is raised as far as it may be; no pointers outlive the calls.
        let locked = unsafe {
            let mut limit = libc::rlimit { rlim_cur: 0, rlim_max: 0 };
            libc::getrlimit(libc::RLIMIT_MEMLOCK, &mut limit);
            limit.rlim_cur = limit.rlim_max;
            libc::setrlimit(libc::RLIMIT_MEMLOCK, &limit);
            let locked = libc::mlockall(libc::MCL_CURRENT) == 0;
            libc::munlockall();
            locked
        };
        (fifo, locked)
    })
    .join()
    .unwrap()
}

#[test]
fn what_is_granted_is_what_the_kernel_says() {
    let _alone = alone();
    let thread = std::thread::spawn(|| {
        let allowed = what_the_kernel_allows();
        let grants = ask_for_real_time(37);
        let (priority, policy) = (stat(40), stat(41));
        let child = std::thread::spawn(|| stat(41)).join().unwrap();
        // SAFETY: asks for the calling thread's timer slack; takes no pointers.
        let slack_ns = unsafe { libc::prctl(libc::PR_GET_TIMERSLACK, 0, 0, 0, 0) };
        (grants, priority, policy, child, locked_kib(), slack_ns, allowed)
    });
    let (grants, priority, policy, child, locked, slack_ns, allowed) = thread.join().unwrap();
    // SAFETY: gives the process's pages back; takes no pointers.
    unsafe { libc::munlockall() };
    match &grants.policy_refused {
        None => assert_eq!((policy, priority), (i64::from(libc::SCHED_FIFO), 37)),
        Some(why) => assert!(policy == i64::from(libc::SCHED_OTHER) && !why.is_empty(), "{policy}: {why}"),
    }
    let named = if policy == i64::from(libc::SCHED_FIFO) { "fifo" } else { "other" };
    assert_eq!((grants.policy.as_str(), i64::from(grants.priority)), (named, priority));
    assert_eq!(child, i64::from(libc::SCHED_OTHER), "a thread of its own inherits the class");
    assert_eq!(grants.memory_locked, locked > 0, "{locked} KiB are locked");
    assert_eq!(grants.memory_locked, grants.lock_refused.is_none());
    assert_eq!((named == "fifo", grants.memory_locked), allowed, "{grants:?}");
    // A FIFO thread has no slack, whatever was requested.
    assert!(slack_ns <= 1, "{slack_ns}");
}

/// No such priority: the reason is reported, and the class stays.
#[test]
fn a_priority_that_is_none_is_refused_with_the_reason() {
    let _alone = alone();
    let grants = std::thread::spawn(|| ask_for_real_time(1000)).join().unwrap();
    // SAFETY: as above.
    unsafe { libc::munlockall() };
    assert_eq!((grants.policy.as_str(), grants.priority), ("other", 0));
    assert!(grants.policy_refused.is_some_and(|why| !why.is_empty()));
}

#[test]
fn processor_time_is_what_the_kernel_accounts() {
    let accounted = || {
        // SAFETY: rusage is plain data, valid when zeroed, and the kernel fills it.
        let usage = unsafe {
            let mut usage: libc::rusage = std::mem::zeroed();
            libc::getrusage(libc::RUSAGE_SELF, &mut usage);
            usage
        };
        let ns = |t: libc::timeval| t.tv_sec as u64 * 1_000_000_000 + t.tv_usec as u64 * 1000;
        ns(usage.ru_utime) + ns(usage.ru_stime)
    };
    // Seconds and their fraction both count: beyond the second second, as one of them is the same however it is put together.
    while accounted() < 2_200_000_000 {
        std::hint::black_box((0..1000).sum::<u64>());
    }
    let (before, ours, after) = (accounted(), process_cpu_ns(), accounted());
    // The kernel scales its two halves by ticks.
    let slack = 50_000_000;
    assert!(before <= ours + slack && ours <= after + slack, "{before} {ours} {after}");
}

#[test]
fn a_thread_is_bound_to_its_cpu_and_to_one_that_exists() {
    std::thread::spawn(|| {
        assert_eq!(pin_to(0).unwrap(), [0]);
        let allowed = of_thread("status");
        assert!(allowed.lines().any(|line| line == "Cpus_allowed_list:\t0"), "{allowed}");
        for none in [1023, 1024, usize::MAX] {
            assert_eq!(pin_to(none).unwrap_err().raw_os_error(), Some(libc::EINVAL), "{none}");
        }
    })
    .join()
    .unwrap();
}

#[test]
fn cpus_are_kept_awake_for_as_long_as_it_is_held() {
    use std::io::Read;
    let latency_us = || {
        let mut bytes = [0; 4];
        std::fs::File::open("/dev/cpu_dma_latency")?.read_exact(&mut bytes)?;
        std::io::Result::Ok(i32::from_ne_bytes(bytes))
    };
    // A machine without the device, or without the right to it, says so.
    match (keep_cpus_awake(), latency_us()) {
        (Ok(_held), Ok(now)) => assert_eq!(now, 0),
        (Err(why), _) => {
            assert!(!std::path::Path::new("/dev/cpu_dma_latency").exists() || why.raw_os_error().is_some())
        }
        (Ok(_), Err(why)) => panic!("{why}"),
    }
}

/// Before its time no wait ends, and what is to be spun is processor time.
#[test]
fn the_last_of_a_wait_is_spun_where_that_is_asked() {
    let thread_ns = || {
        let mut t = libc::timespec { tv_sec: 0, tv_nsec: 0 };
        // SAFETY: `t` is a valid timespec for the kernel to write, and this clock always exists on Linux.
        unsafe { libc::clock_gettime(libc::CLOCK_THREAD_CPUTIME_ID, &mut t) };
        t.tv_sec as u64 * 1_000_000_000 + t.tv_nsec as u64
    };
    let spent = |spin: Duration| {
        let until = monotonic_ns() + 60_000_000;
        let before = thread_ns();
        wait_until(until, spin.as_nanos() as u64);
        assert!(monotonic_ns() >= until);
        thread_ns() - before
    };
    // A busy machine leaves a few of the 60 ms to this thread (9.3 ms were the best of 20 tries at a load of 9);
    // a sleep takes some tens of microseconds.
    let spun = (0..20).map(|_| spent(Duration::from_millis(50))).max().unwrap();
    let slept = (0..20).map(|_| spent(Duration::ZERO)).min().unwrap();
    assert!(spun > 1_500_000 && spun < 58_000_000, "{spun}");
    assert!(slept < 1_000_000, "{slept}");
    // More than there is time for: nothing is slept.
    wait_until(monotonic_ns() + 1000, u64::MAX);
}

#[test]
fn new_pages_are_faults_of_the_thread_that_touches_them() {
    let _alone = alone();
    let touch = |pages: usize| {
        let before = thread_faults().0;
        let mut memory = vec![0u8; pages * 4096];
        for page in memory.chunks_mut(4096) {
            page[0] = 1;
        }
        std::hint::black_box(&memory);
        thread_faults().0 - before
    };
    // Large pages come by the half thousand: enough of them to be many either way.
    assert!(touch(40_000) >= 40);
    let (minor, major) = thread_faults();
    assert!(minor > 0 && major >= 0, "{minor} {major}");
}

/// A second of sleep has whole seconds and a rest.
#[test]
fn a_sleep_ends_at_its_time() {
    // A clock of the kernel's that is not the one slept on, for what nobody here computes.
    let uptime_s = || {
        let text = std::fs::read_to_string("/proc/uptime").unwrap();
        text.split_whitespace().next().unwrap().parse::<f64>().unwrap()
    };
    let began = uptime_s();
    sleep_until(monotonic_ns() + 1_020_000_000);
    assert!(uptime_s() - began >= 1.0, "{began}");
}

/// The stack of the loop is there before it turns: a call that needs much of it meets no new page.
#[test]
fn a_touched_stack_makes_no_faults() {
    // The pages of a frame come when its function begins, so the faults are counted around the call.
    #[inline(never)]
    fn deep() {
        let mut used = [0u8; 200 * 1024];
        for page in used.chunks_mut(4096) {
            page[0] = 1;
        }
        std::hint::black_box(&used);
    }
    let _alone = alone();
    // A stack of an ended thread is used again, pages and all; one as large as this is released.
    let on_a_new_stack = |touches: bool| {
        let thread = std::thread::Builder::new().stack_size(64 << 20).spawn(move || {
            if touches {
                touch_stack();
            }
            let before = thread_faults().0;
            deep();
            thread_faults().0 - before
        });
        thread.unwrap().join().unwrap()
    };
    let (touched, untouched) = (on_a_new_stack(true), on_a_new_stack(false));
    // Where the kernel gives stacks in large pages there is nothing to tell.
    assert!(touched <= 10, "{touched} faults where a stack that was not touched has {untouched}");
}
