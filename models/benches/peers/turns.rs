//! CPU seconds, and comparisons in turn: on a shared machine only a ratio within one turn says something.
#![allow(dead_code, reason = "included by several programs")]

/// CPU seconds of this thread.
pub fn cpu_seconds() -> f64 {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: the pointer is to a timespec of this frame, which the call fills and does not keep.
    let failed = unsafe { libc::clock_gettime(libc::CLOCK_THREAD_CPUTIME_ID, &raw mut time) };
    assert_eq!(failed, 0, "the system has no clock of a thread's CPU time");
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

/// CPU seconds of `run`.
pub fn timed(run: impl FnOnce()) -> f64 {
    let start = cpu_seconds();
    run();
    cpu_seconds() - start
}

/// Median, least and most.
#[derive(Clone, Copy, Debug)]
pub struct Spread {
    pub median: f64,
    pub least: f64,
    pub most: f64,
}

/// Of values, at least one.
pub fn spread(values: impl IntoIterator<Item = f64>) -> Spread {
    let mut all: Vec<f64> = values.into_iter().collect();
    all.sort_by(f64::total_cmp);
    Spread { median: all[all.len() / 2], least: all[0], most: all[all.len() - 1] }
}

/// Cycles a CPU second of this core now: a chain of multiplications of 64-bit integers takes three cycles each on every
/// x86-64 core since 2011 (Agner Fog's tables; uops.info). Squares, which no compiler can put together.
pub fn cycles_per_second() -> f64 {
    const CHAIN: u64 = 2_000_000;
    let seconds = timed(|| {
        let mut x = std::hint::black_box(3_u64);
        for _ in 0..CHAIN {
            x = x.wrapping_mul(x);
        }
        std::hint::black_box(x);
    });
    3.0 * CHAIN as f64 / seconds
}
