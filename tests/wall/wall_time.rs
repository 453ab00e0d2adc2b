//! Judgements in wall-clock time on a machine that others use too.
//!
//! A shared machine takes a CPU away for many milliseconds, and the safety core then trips, as it must. Four rules keep that
//! apart from a fault of the program. A trip is forgiven only beside a stall that the monitor recorded, and the sweep is tried
//! again. A test that fails all the same beside a stall has shown nothing: it is run again in the guest kernel, whose clock
//! counts instructions, so that nothing that the machine does is seen there, and that run decides. What cannot be decided
//! beside a stall is counted in `target/tests-undecided.txt`: `tests/run` prints the count, and more than two fail. A failure
//! without a recorded stall stands, and so does a wrong outcome of the safety tests: a drive that is on, a pass that is lost.

use ::tests::{file, texts};
use realtime::stall_monitor::StallMonitor;
use std::any::Any;
use std::io::Write;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::{PoisonError, RwLock};
use std::time::{Duration, Instant};

/// Seconds that a test may take in the guest, on the machine's own clock: several times as long as outside it.
const GUEST_TIMEOUT_S: u32 = 600;

/// Held for reading by tests outside the guest, for writing by one inside: a guest keeps a CPU busy, which would spoil the others.
static GUEST: RwLock<()> = RwLock::new(());

/// A stall from which on a rig that would not arm has shown nothing.
const KEEPS_FROM_ARMING: realtime::ports::Nanos = realtime::ports::Nanos(10_000_000);

/// What a test unwinds with that cannot decide: `undecided` has counted it.
struct Undecided;

/// Counts a judgement that is given up beside a recorded stall, under the name of the running test.
fn count_undecided(why: &str) {
    let name = std::thread::current().name().unwrap_or("a test").to_string();
    println!("UNDECIDED {name}: {why}");
    let list = std::fs::File::options().create(true).append(true).open(file("target/tests-undecided.txt"));
    let written = list.and_then(|mut list| writeln!(list, "{name}: {}", why.replace('\n', " ")));
    written.expect("target/ can be written");
}

/// Gives a judgement up: what is left of the test is not run, and the test is counted as undecided.
pub fn undecided(why: &str) -> ! {
    count_undecided(why);
    resume_unwind(Box::new(Undecided))
}

/// Runs a body; its failure, unless it was counted as undecided.
fn failure_of(test: impl FnOnce()) -> Result<(), Box<dyn Any + Send>> {
    catch_unwind(AssertUnwindSafe(test))
        .or_else(|failed| if failed.is::<Undecided>() { Ok(()) } else { Err(failed) })
}

/// Runs a safety test, the body of a `#[test]`: its outcome alone is judged, whatever the machine does. Times in it are a [`Stopwatch`]'s.
///
/// # Panics
/// Where the outcome is wrong.
pub fn outcome_alone(test: impl FnOnce()) {
    if let Err(failed) = failure_of(test) {
        resume_unwind(failed);
    }
}

/// A time that is judged by a bound, and what the machine did meanwhile.
pub struct Stopwatch {
    began: Instant,
    monitor: StallMonitor,
}

impl Stopwatch {
    /// Starts now.
    pub fn start() -> Self {
        let monitor = StallMonitor::start(realtime::pacing::monotonic_ns()).expect("threads");
        Stopwatch { began: Instant::now(), monitor }
    }

    /// The time since its start.
    pub fn elapsed(&self) -> Duration {
        self.began.elapsed()
    }

    /// Whether the machine stalled since its start.
    pub fn saw_a_stall(self) -> bool {
        self.monitor.finish().count > 0
    }

    /// Judges a bound. Missed beside a recorded stall it is counted as undecided.
    ///
    /// # Panics
    /// Where the bound was missed though the machine did not stall.
    pub fn judge(self, in_time: bool, what: &str) {
        let stalls = self.monitor.finish();
        if in_time {
            return;
        }
        assert!(stalls.count > 0, "{what}, and the machine did not stall");
        count_undecided(&format!(
            "{what}, beside {} stalls of up to {} ms",
            stalls.count,
            stalls.worst.0 / 1_000_000
        ));
    }
}

/// Runs a body of a `#[test]` that waits for other programs; beside a recorded stall it is tried three times.
///
/// # Panics
/// Where it fails without a recorded stall.
pub fn again_beside_a_stall(test: impl Fn()) {
    for attempt in 1..=3 {
        let monitor = StallMonitor::start(realtime::pacing::monotonic_ns()).expect("threads");
        let ended = failure_of(&test);
        let seen = monitor.finish();
        match ended {
            Ok(()) => return,
            Err(failed) if seen.count == 0 => resume_unwind(failed),
            Err(_) => eprintln!("attempt {attempt} failed beside {} stalls of the machine", seen.count),
        }
    }
    count_undecided("failed three times beside stalls of the machine");
}

/// Runs a test in wall-clock time: the body of a `#[test]`. Where it fails beside a stall of the machine it
/// is run again in the guest kernel, and passes or fails there.
///
/// # Panics
/// Where the test fails without a recorded stall, or in the guest.
pub fn in_wall_clock_time<T: FnOnce()>(test: T) {
    if std::env::var_os("CAN_GUEST_INSIDE").is_some() {
        return test();
    }
    let outside = GUEST.read().unwrap_or_else(PoisonError::into_inner);
    let monitor = StallMonitor::start(realtime::pacing::monotonic_ns()).expect("threads");
    let ended = failure_of(test);
    let seen = monitor.finish();
    drop(outside);
    let Err(failed) = ended else { return };
    if seen.count == 0 {
        resume_unwind(failed);
    }
    // `binary::module::name::{{closure}}`, by which the test's own binary finds it again.
    let path = std::any::type_name::<T>();
    let name = path.split_once("::").map_or(path, |(_, name)| name);
    let name = name.split("::{{closure}}").next().expect("a closure in the test's own function");
    println!(
        "{name} failed beside {} stalls of the machine, the longest of {} ms: once more in the guest, whose clock counts \
         instructions",
        seen.count,
        seen.worst.0 / 1_000_000
    );
    let _alone = GUEST.write().unwrap_or_else(PoisonError::into_inner);
    let mut guest = Command::new(file("tests/can_guest/can-guest"));
    guest.env("CAN_GUEST", "qemu").env("CAN_GUEST_TIMEOUT", GUEST_TIMEOUT_S.to_string());
    guest.arg(std::env::current_exe().expect("a test knows where it is")).args([
        "--exact",
        name,
        "--nocapture",
    ]);
    let output = guest.output().expect("the guest's script");
    let (out, err) = texts(&output);
    print!("{out}{err}");
    // The guest's own trouble: it does not start on this machine.
    if output.status.code() == Some(125) {
        return count_undecided("failed beside stalls of the machine, and no guest decides");
    }
    assert!(
        output.status.success() && out.contains("1 passed"),
        "{name} failed in the guest too, where nothing stalls"
    );
}

/// Runs a sweep in wall-clock time to its end, in a fresh folder for every attempt.
///
/// A trip is accepted only if the monitor recorded a stall of the machine in the 300 ms before it, and at
/// most four times; any other trip fails. What ends otherwise is the caller's to judge. `sweep` makes the
/// command for a folder. Returns the folder and output of the attempt that went through.
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
    undecided("five sweeps in a row were cut by stalls of the machine")
}

/// Runs a sweep in wall-clock time to its end; where a stall of the machine cut it, it is taken up again in its folder, sixteen times at
/// most, so that what was measured counts. What ends otherwise is the caller's to judge.
///
/// # Panics
/// A trip without a recorded stall.
pub fn sweep_taken_up_again(out: &Path, sweep: impl Fn() -> Command) -> Output {
    for attempt in 1..=16 {
        let output = sweep().output().unwrap();
        if output.status.code() != Some(1) {
            return output;
        }
        match cut_by_a_stall(out) {
            Some(why) => eprintln!("attempt {attempt}: {why}"),
            None => return output,
        }
    }
    undecided("sixteen times in a row a sweep was cut by stalls of the machine")
}

/// What cut a run that has ended: a trip with a recorded stall of the machine before it, or a rig that would
/// not arm beside one, in words; `None` if neither did.
///
/// # Panics
/// A trip without a stall, and a run without a summary.
pub fn cut_by_a_stall(out: &Path) -> Option<String> {
    let said = std::fs::read_to_string(out.join("summary.json"));
    let said = said.unwrap_or_else(|e| panic!("no summary in {}: {e}", out.display()));
    let summary: runs::job::Summary = serde_json::from_str(&said).unwrap();
    let stalls = summary.stalls.expect("a run in wall-clock time has a monitor");
    let trip = match summary.outcome {
        runs::sweep::Outcome::Tripped(trip) => trip,
        // The proof of the second channel has its own bounds in time, and ten seconds to go through.
        // An amplifier whose supply was cut for a stall has no fault: that cause is never forgiven.
        runs::sweep::Outcome::WouldNotArm { blocking }
            if stalls.worst.0 >= KEEPS_FROM_ARMING.0
                && blocking != Some(realtime::safety::TripCause::AmplifierFault) =>
        {
            return Some(format!(
                "would not arm, {blocking:?}, the machine stalled for {} ms",
                stalls.worst.0 / 1_000_000
            ));
        }
        _ => return None,
    };
    let before = realtime::ports::Nanos(trip.at.0.saturating_sub(300_000_000));
    let stall = stalls.within(before, trip.at).unwrap_or_else(|| {
        panic!("{trip:?} without a recorded stall of the machine (worst {:?})", stalls.worst)
    });
    Some(format!("{:?}, the machine stalled for {} ms", trip.cause, stall.lasted.0 / 1_000_000))
}

/// Tries again, eight times at most, where the machine stalled and the safety core tripped for it: the
/// attempt then gives the folder of the run that was cut.
///
/// # Panics
/// Where something else than a stall cut it.
pub fn unless_the_machine_stalls(mut attempt: impl FnMut(u32) -> Option<PathBuf>) {
    for n in 1..=8 {
        let watch = Stopwatch::start();
        let Some(out) = attempt(n) else { return };
        let seen = watch.monitor.finish();
        // Before there is a loop there is no summary: an answer stayed away while the rig was opened.
        let refused = || format!("refused beside {} stalls", seen.count);
        let why = if out.join("summary.json").exists() {
            cut_by_a_stall(&out)
        } else {
            (seen.count > 0).then(refused)
        };
        let why = why.unwrap_or_else(|| {
            let summary = std::fs::read_to_string(out.join("summary.json")).unwrap_or_default();
            panic!("nothing but a stall may end it otherwise: {summary}")
        });
        eprintln!("attempt {n}: {why}");
        // Whatever keeps the machine busy may be over then.
        std::thread::sleep(Duration::from_secs(u64::from(n)));
    }
    undecided("eight sweeps in a row were cut by stalls of the machine")
}

#[cfg(test)]
mod tests {
    use super::in_wall_clock_time;
    use std::process::Command;

    /// Stops this whole process for 30 ms, as a machine does that takes its CPUs away.
    fn stalled() {
        let ask = format!("kill -STOP {0}; sleep 0.03; kill -CONT {0}", std::process::id());
        assert!(Command::new("sh").args(["-c", &ask]).status().unwrap().success());
    }

    #[test]
    fn what_a_stall_spoils_is_decided_in_the_guest() {
        in_wall_clock_time(|| {
            if std::env::var_os("CAN_GUEST_INSIDE").is_none() {
                stalled();
                panic!("a bound was missed");
            }
        });
    }

    #[test]
    fn what_fails_in_the_guest_too_has_failed() {
        let ended = std::panic::catch_unwind(|| {
            in_wall_clock_time(|| {
                stalled();
                panic!("wrong everywhere");
            });
        });
        // Inside the guest this test must fail, so that outside it is seen to.
        assert_eq!(ended.is_err(), std::env::var_os("CAN_GUEST_INSIDE").is_none());
    }
}
