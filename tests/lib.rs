//! Helpers that several system tests share.

pub mod served;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A file of the repository.
pub fn file(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path)
}

/// A setup by name; `scpi` is the ideal virtual rig with a generator by SCPI in the place of its amplifier, which has no
/// thermometer.
pub fn setup(name: &str) -> rig::setup::Setup {
    if name != "scpi" {
        return rig::setup::Setup::load(name).expect("a bundled setup");
    }
    let ideal = rig::setup::Setup::load("virtual-ideal").expect("a bundled setup").text;
    let generator = "profile = \"keysight-33500b\"\namplitude_m_per_unit = 1e-6\n";
    let text = ideal.replace("profile = \"muprime-amplifier\"\n", generator);
    let text = text.replace("[limits]\n", "[limits]\ntemperature_fitted = false\n");
    rig::setup::Setup::parse("scpi", &text, Path::new(".")).expect("a setup")
}

/// The `muprime` that was built beside this test. A missing one fails: build the workspace first.
pub fn muprime() -> Command {
    let test = std::env::current_exe().expect("a test knows where it is");
    let folder = test.parent().and_then(Path::parent).expect("a test stands in target/<profile>/deps");
    let binary = folder.join("muprime");
    assert!(binary.exists(), "{} is missing: cargo build --release --workspace", binary.display());
    Command::new(binary)
}

/// The Python of the independent peers. Missing peers fail: nothing is skipped.
pub fn python() -> Command {
    let python = file("target/venv/bin/python");
    assert!(python.exists(), "{} is missing: run tests/venv", python.display());
    Command::new(python)
}

/// Standard output and standard error as text.
pub fn texts(output: &Output) -> (String, String) {
    (
        String::from_utf8_lossy(&output.stdout).into_owned(),
        String::from_utf8_lossy(&output.stderr).into_owned(),
    )
}

/// The JSON documents on standard output, one a line; anything else there fails.
pub fn documents(output: &Output) -> Vec<serde_json::Value> {
    let (out, _) = texts(output);
    out.lines()
        .map(|line| serde_json::from_str(line).unwrap_or_else(|e| panic!("not JSON: {line}: {e}")))
        .collect()
}

/// Runs a sweep in wall-clock time to its end, in a fresh folder for every attempt.
///
/// A shared machine takes a CPU away for many milliseconds, and the safety core then trips, as it must. Such a trip is
/// accepted only if a witness recorded a stall of the machine in the 300 ms before it, and at most four times; any
/// other trip fails. What ends otherwise is the caller's to judge. `sweep` makes the command for a folder. Returns the
/// folder and output of the attempt that went through.
pub fn sweep_unless_the_machine_stalls(folder: &Path, sweep: impl Fn(&Path) -> Command) -> (PathBuf, Output) {
    for attempt in 1..=5 {
        let out = folder.join(format!("attempt-{attempt}"));
        let output = sweep(&out).output().unwrap();
        if output.status.code() != Some(1) {
            return (out, output);
        }
        match cut_by_a_stall(&out) {
            Some(why) => eprintln!("attempt {attempt}: {why}"),
            None => return (out, output),
        }
    }
    panic!(
        "five sweeps in a row were cut by stalls of the machine: it is too busy for a test in wall-clock time"
    );
}

/// What cut a run that has ended: a trip with a recorded stall of the machine before it, in words; `None` if no trip did.
///
/// # Panics
/// A trip without a stall, and a run without a summary.
pub fn cut_by_a_stall(out: &Path) -> Option<String> {
    let said = std::fs::read_to_string(out.join("summary.json"));
    let said = said.unwrap_or_else(|e| panic!("no summary in {}: {e}", out.display()));
    let summary: rig::session::Summary = serde_json::from_str(&said).unwrap();
    let rig::sequence::Outcome::Tripped(trip) = summary.outcome else { return None };
    let stalls = summary.stalls.expect("a run in wall-clock time has witnesses");
    let before = realtime::ports::Nanos(trip.at.0.saturating_sub(300_000_000));
    let stall = stalls.within(before, trip.at).unwrap_or_else(|| {
        panic!("{trip:?} without a recorded stall of the machine (worst {:?})", stalls.worst)
    });
    Some(format!("{:?}, the machine stalled for {} ms", trip.cause, stall.lasted.0 / 1_000_000))
}

/// Tries again, four times at most, where the machine stalled and the safety core tripped for it: the attempt then gives the
/// folder of the run that was cut.
///
/// # Panics
/// Where something else than a stall cut it, or every attempt was cut.
pub fn unless_the_machine_stalls(mut attempt: impl FnMut(u32) -> Option<PathBuf>) {
    for n in 1..=4 {
        match attempt(n) {
            None => return,
            Some(out) => {
                let why = cut_by_a_stall(&out).expect("nothing but a stall may end it otherwise");
                eprintln!("attempt {n}: {why}");
            }
        }
    }
    panic!("four sweeps in a row were cut by stalls of the machine");
}
