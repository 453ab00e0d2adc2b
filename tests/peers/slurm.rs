//! A real Slurm of one node, for the tests that need one.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};
use tests::study::{run, text};
use tests::{file, texts};

/// A Slurm in a folder, ended with its tests.
pub struct Slurm(pub PathBuf);

impl Slurm {
    /// Starts it, with ports of this process that no other Slurm of it has.
    pub fn start(folder: &Path) -> Slurm {
        static STARTED: AtomicU32 = AtomicU32::new(0);
        let slurm = Slurm(folder.join("slurm"));
        std::fs::create_dir(&slurm.0).unwrap();
        let number = 8 * std::process::id() + STARTED.fetch_add(1, Ordering::Relaxed);
        let port = 20_000 + 2 * (number % 5_000);
        slurm.asked("start", &[&port.to_string()]);
        slurm
    }

    /// A verb of `tests/studies/slurm`.
    pub fn asked(&self, verb: &str, more: &[&str]) {
        let done = run(Command::new(file("tests/studies/slurm")).args([verb, text(&self.0)]).args(more));
        assert!(done.status.success(), "{verb}: {:?}", texts(&done));
    }

    /// Kills a daemon by the number in its file, and waits until it is gone.
    #[allow(dead_code, reason = "not every test kills")]
    pub fn kill(&self, daemon: &str) {
        let number = std::fs::read_to_string(self.0.join(format!("{daemon}.pid"))).unwrap();
        kill(number.trim().parse().unwrap());
    }
}

impl Drop for Slurm {
    fn drop(&mut self) {
        let _ = run(Command::new(file("tests/studies/slurm")).args(["stop", text(&self.0)]));
    }
}

/// Kills a process and waits until it is gone.
pub fn kill(pid: i32) {
    // SAFETY: kill() takes two numbers and touches no memory of ours.
    unsafe { libc::kill(pid, libc::SIGKILL) };
    let begun = Instant::now();
    let gone = || {
        let state = std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
        state.is_empty() || state.rsplit(')').next().is_some_and(|s| s.trim().starts_with('Z'))
    };
    while !gone() {
        assert!(begun.elapsed() < Duration::from_secs(20), "{pid} does not die");
        std::thread::sleep(Duration::from_millis(20));
    }
}
