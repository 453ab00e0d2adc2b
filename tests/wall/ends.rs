//! The end of a run, with the real program as one process and its rig as another: an amplifier that refuses
//! 'off', a second signal while 'off' is still owed, a standard error that nobody reads any more.

use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStderr, Stdio};
use std::time::{Duration, Instant};
use tests::muprime;
use tests::served::{self, AmplifierWatch, ServedRig};
use wall::{Stopwatch, unless_the_machine_stalls};

/// What is said where the output may be on.
const MAY_BE_ON: &str = "the output may still be on: switch the supply off";

/// A sweep that drives a served rig.
struct Driven {
    child: Child,
    stderr: Option<ChildStderr>,
    out: PathBuf,
    amplifier: AmplifierWatch,
}

impl Driven {
    /// Starts a sweep of many passes and waits until the plate is driven.
    ///
    /// # Errors
    /// The run's folder, where it ended before that.
    fn start(rig: &ServedRig, folder: &Path, attempt: u32) -> Result<Self, PathBuf> {
        let (plan, setup) = (folder.join("plan.toml"), folder.join("setup.toml"));
        let out = folder.join(format!("run-{attempt}"));
        std::fs::write(&plan, served::timed_plan("ends", 0, &[2e-6, 1e-6, 3e-6], [0.1, 4.0])).unwrap();
        std::fs::write(&setup, served::setup("ends", rig.address)).unwrap();
        let mut sweep = muprime();
        sweep.arg("run").arg(&plan).arg("--setup").arg(&setup).arg("--out").arg(&out);
        let mut child = sweep.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        let stderr = child.stderr.take();
        let mut amplifier = AmplifierWatch::connect(rig.address);
        let began = Instant::now();
        while !amplifier.read().on {
            if child.try_wait().unwrap().is_some() {
                return Err(out);
            }
            assert!(began.elapsed() < Duration::from_secs(60), "it is never driven");
            std::thread::sleep(Duration::from_millis(2));
        }
        Ok(Driven { child, stderr, out, amplifier })
    }

    fn signal(&self) {
        // SAFETY: sends SIGINT to the child that this test has started and not yet waited for.
        unsafe { libc::kill(self.child.id() as libc::pid_t, libc::SIGINT) };
    }

    /// Waits for its end: status, and what it said. The time that it took is judged by a bound.
    fn end(&mut self, within: Duration) -> (Option<i32>, String) {
        let (began, mut said) = (Stopwatch::start(), String::new());
        if let Some(mut stderr) = self.stderr.take() {
            stderr.read_to_string(&mut said).unwrap();
        }
        let status = self.child.wait().unwrap().code();
        let took = began.elapsed();
        began.judge(took < within, &format!("the end took {took:?} of {within:?}"));
        (status, said)
    }

    fn summary(&self) -> serde_json::Value {
        serde_json::from_slice(&std::fs::read(self.out.join("summary.json")).unwrap()).unwrap()
    }
}

impl Drop for Driven {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn refusing(folder: &Path) -> ServedRig {
    let defects = folder.join("refuses.toml");
    std::fs::write(&defects, "[[defect]]\nname = \"amplifier_refuses_off\"\nseed = 1\n").unwrap();
    ServedRig::start(1, Some(&defects))
}

#[test]
fn an_amplifier_that_refuses_off_is_told_after_an_interrupt() {
    wall::outcome_alone(|| {
        let folder = tempfile::tempdir().unwrap();
        unless_the_machine_stalls(|n| {
            let rig = refusing(folder.path());
            let mut run = match Driven::start(&rig, folder.path(), n) {
                Ok(run) => run,
                Err(out) => return Some(out),
            };
            run.signal();
            // Some seconds until it gives up, and the report after that.
            let (status, said) = run.end(Duration::from_secs(30));
            let summary = run.summary();
            if summary["outcome"] == "tripped" {
                return Some(run.out.clone());
            }
            assert!(run.amplifier.read().on, "else this test shows nothing");
            assert_eq!((status, &summary["outcome"]), (Some(1), &"stopped".into()), "{said}");
            assert_eq!(summary["off"]["read_back"], false);
            assert!(said.contains(MAY_BE_ON) && !said.contains("the drive is off"), "{said}");
            None
        });
    });
}

#[test]
fn a_second_interrupt_while_off_is_owed_leaves_and_says_so() {
    wall::outcome_alone(|| {
        let folder = tempfile::tempdir().unwrap();
        unless_the_machine_stalls(|n| {
            let rig = refusing(folder.path());
            let mut run = match Driven::start(&rig, folder.path(), n) {
                Ok(run) => run,
                Err(out) => return Some(out),
            };
            run.signal();
            std::thread::sleep(Duration::from_millis(200));
            if run.child.try_wait().unwrap().is_some() {
                return Some(run.out.clone());
            }
            run.signal();
            let (status, said) = run.end(Duration::from_secs(3));
            assert!(run.amplifier.read().on, "else this test shows nothing");
            assert_eq!(status, Some(1), "{said}");
            assert!(said.contains("leaving at once") && said.contains(MAY_BE_ON), "{said}");
            None
        });
    });
}

/// The first one switches off, and the second one hurries nothing away: off by the instrument's own state.
#[test]
fn two_interrupts_at_once_switch_off() {
    wall::outcome_alone(|| {
        let folder = tempfile::tempdir().unwrap();
        unless_the_machine_stalls(|n| {
            let rig = ServedRig::start(1, None);
            let mut run = match Driven::start(&rig, folder.path(), n) {
                Ok(run) => run,
                Err(out) => return Some(out),
            };
            run.signal();
            std::thread::sleep(Duration::from_millis(20));
            run.signal();
            let (status, said) = run.end(Duration::from_secs(30));
            assert_eq!(status, Some(1), "{said}");
            assert!(!run.amplifier.read().on);
            None
        });
    });
}

/// `muprime run ... 2>&1 | head -1`: nobody reads what is said any more. The sweep is led and recorded as
/// before; an interrupt then ends it as it does any other.
#[test]
fn a_sweep_whose_standard_error_is_gone_is_stopped_and_kept_whole() {
    wall::outcome_alone(|| {
        let folder = tempfile::tempdir().unwrap();
        unless_the_machine_stalls(|n| {
            let rig = ServedRig::start(1, None);
            let mut run = match Driven::start(&rig, folder.path(), n) {
                Ok(run) => run,
                Err(out) => return Some(out),
            };
            let mut reader = BufReader::new(run.stderr.take().unwrap());
            reader.read_line(&mut String::new()).unwrap();
            drop(reader);
            // It is told of a pass that was made: into a pipe that is closed.
            let began = Instant::now();
            while !std::fs::read_to_string(run.out.join("points.csv"))
                .is_ok_and(|table| table.lines().count() > 1)
            {
                if let Some(ended) = run.child.try_wait().unwrap() {
                    assert_eq!(ended.code(), Some(1), "it ends with a trip or not at all");
                    return Some(run.out.clone());
                }
                assert!(began.elapsed() < Duration::from_secs(30), "no pass");
                std::thread::sleep(Duration::from_millis(5));
            }
            run.signal();
            let (status, _) = run.end(Duration::from_secs(5));
            let summary = run.summary();
            if summary["outcome"] == "tripped" {
                return Some(run.out.clone());
            }
            assert!(!run.amplifier.read().on);
            assert_eq!((status, &summary["outcome"]), (Some(1), &"stopped".into()));
            assert_eq!((&summary["off"]["read_back"], &summary["record_lost"]), (&true.into(), &0.into()));
            let record = tests::contents::read(&std::fs::read(run.out.join("run-1.mcap")).unwrap());
            assert!(tests::contents::complete(&record.integrity), "{:?}", record.integrity);
            let last = record.rows().last().unwrap();
            assert!(!last.armed && last.drive_pp_m == 0.0);
            None
        });
    });
}
