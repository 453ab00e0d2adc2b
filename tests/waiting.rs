//! The only waits of the deterministic tests: for an event that comes on any machine, however slow, with a
//! bound that only a program that hangs can reach. Nothing here says how long anything took.
#![allow(clippy::disallowed_methods, reason = "waits for processes, with a bound that only a hang can reach")]

use std::process::{Child, ExitStatus};
use std::time::{Duration, Instant};

/// Longer than any machine takes for what is waited for here.
const A_HANG: Duration = Duration::from_secs(600);

/// Waits until it is so.
///
/// # Panics
/// Where it never is.
pub fn until(what: &str, mut is_so: impl FnMut() -> bool) {
    let began = Instant::now();
    while !is_so() {
        assert!(began.elapsed() < A_HANG, "never: {what}");
        pause(Duration::from_millis(5));
    }
}

/// Waits for the end of a program, and ends one that hangs.
///
/// # Panics
/// Where it hangs.
pub fn end_of(what: &str, child: &mut Child) -> ExitStatus {
    let began = Instant::now();
    loop {
        if let Some(status) = child.try_wait().expect("a child of this test") {
            return status;
        }
        if began.elapsed() > A_HANG {
            let _ = child.kill();
            panic!("{what} hangs");
        }
        pause(Duration::from_millis(10));
    }
}

/// Lets others run: a test that draws the instant of a kill, whatever it strikes.
pub fn pause(how_long: Duration) {
    std::thread::sleep(how_long);
}

/// Seconds since 1970, to be compared with what a program wrote meanwhile.
pub fn now_unix_s() -> f64 {
    let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    now.expect("a clock after 1970").as_secs_f64()
}
