//! What is kept of a run in wall-clock time: files that vanish or lock in the middle, disks that fill at the end.

use std::collections::BTreeSet;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use tests::{documents, muprime, served};
use wall::unless_the_machine_stalls;

fn plan(folder: &Path, amplitudes: usize) -> PathBuf {
    let path = folder.join("plan.toml");
    let step = 4.8e-6 / amplitudes.max(12) as f64;
    let amplitudes: Vec<f64> = (1..=amplitudes).map(|n| n as f64 * step).collect();
    std::fs::write(&path, served::plan("keeping", 4, &amplitudes)).unwrap();
    path
}

fn sweep(plan: &Path, out: &Path) -> Command {
    let setup = tests::unhurried("virtual-ideal", plan.parent().unwrap());
    let mut command = muprime();
    command.args(["--json", "run", "--setup", &setup]).arg(plan).arg("--out").arg(out);
    command
}

fn points(run: &Path) -> BTreeSet<u64> {
    runs::run_dir::passes_in(run).unwrap().iter().map(|p| p.pass.point).collect()
}

/// A sweep in wall-clock time, struck by `strike` after its second pass.
struct Struck {
    out: PathBuf,
    status: Option<i32>,
    acknowledged: BTreeSet<u64>,
    outcome: serde_json::Value,
    stderr: String,
}

/// Sweeps in wall-clock time that are tried on a machine that others use too.
const ATTEMPTS: u32 = 8;

/// Whether a sweep was refused or cut short as a busy machine does it: an instrument of this very process
/// answered too late, or the loop ran too late. What is judged here is what is kept, not the loop.
fn too_busy(status: Option<i32>, outcome: &serde_json::Value, stderr: &str) -> bool {
    outcome == "tripped"
        || outcome == "would_not_arm"
        || (status == Some(2) && stderr.contains("no answer within"))
}

/// Sweeps until one was not cut short by a machine that is too busy; its folder is `N/run`.
fn struck(folder: &Path, mut strike: impl FnMut(&Path)) -> Struck {
    // Several times as long as the writer takes to look for its file, once a second.
    let plan = plan(folder, 40);
    for attempt in 1..=ATTEMPTS {
        let out = folder.join(format!("{attempt}/run"));
        let mut child = sweep(&plan, &out).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut stderr = child.stderr.take().unwrap();
        let said = std::thread::spawn(move || {
            let mut text = String::new();
            let _ = stderr.read_to_string(&mut text);
            text
        });
        let (mut acknowledged, mut outcome) = (BTreeSet::new(), serde_json::Value::Null);
        for line in BufReader::new(child.stdout.take().unwrap()).lines() {
            let said: serde_json::Value = serde_json::from_str(&line.unwrap()).unwrap();
            if let Some(pass) = said.get("pass") {
                acknowledged.insert(pass["pass"]["point"].as_u64().unwrap());
                if acknowledged.len() == 2 {
                    strike(&out);
                }
            }
            if let Some(summary) = said.get("summary") {
                outcome = summary["outcome"].clone();
            }
        }
        let status = child.wait().unwrap().code();
        let stderr = said.join().unwrap();
        if !too_busy(status, &outcome, &stderr) {
            return Struck { out, status, acknowledged, outcome, stderr };
        }
        eprintln!("attempt {attempt}: {outcome} {stderr}");
    }
    panic!("{ATTEMPTS} sweeps in a row tripped: this machine is too busy for a test in wall-clock time");
}

#[test]
fn a_record_that_is_removed_in_mid_run_stops_the_sweep_and_is_said() {
    wall::in_wall_clock_time(|| {
        let folder = tempfile::tempdir().unwrap();
        let run = struck(folder.path(), |out| std::fs::remove_file(out.join("run-1.mcap")).unwrap());
        assert_eq!((run.status, &run.outcome), (Some(1), &"record_lost".into()), "{}", run.stderr);
        assert!(run.stderr.contains("run-1.mcap was removed or replaced"), "{}", run.stderr);
        let kept = points(&run.out);
        assert!(run.acknowledged.is_subset(&kept) && kept.len() < 40, "{kept:?}");
        let report = muprime().args(["--json", "report"]).arg(&run.out).output().unwrap();
        assert!(documents(&report)[0]["damage"].to_string().contains("the record of session 1 is missing"));
    });
}

/// The disk fills while the record is being ended: the last tens of kilobytes are its index.
#[test]
fn a_disk_that_fills_at_the_very_end_hangs_nobody() {
    wall::in_wall_clock_time(|| {
        let folder = tempfile::tempdir().unwrap();
        let plan = plan(folder.path(), 3);
        let length = (1..=ATTEMPTS).find_map(|attempt| {
            let whole = folder.path().join(format!("whole-{attempt}"));
            let done = sweep(&plan, &whole).output().unwrap().status.code() == Some(0);
            done.then(|| std::fs::metadata(whole.join("run-1.mcap")).unwrap().len() / 1024)
        });
        let length = length.expect("a machine that is not too busy for wall-clock time");
        let mut lost = 0;
        for short_kib in [2, 6, 12, 24] {
            let out = folder.path().join(format!("short-{short_kib}"));
            let mut limited = Command::new("bash");
            limited.args([
                "-c",
                &format!("trap '' XFSZ; ulimit -f {}; exec \"$@\"", length - short_kib),
                "bash",
            ]);
            let plain = sweep(&plan, &out);
            let limited = limited.arg(plain.get_program()).args(plain.get_args());
            let mut child = limited.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
            let stdout = child.stdout.take().unwrap();
            let last =
                std::thread::spawn(move || BufReader::new(stdout).lines().map_while(Result::ok).last());
            let began = Instant::now();
            let status = loop {
                if let Some(status) = child.try_wait().unwrap() {
                    break status;
                }
                if began.elapsed() > Duration::from_secs(60) {
                    child.kill().unwrap();
                    panic!("{short_kib} kB short: it hangs");
                }
                std::thread::sleep(Duration::from_millis(20));
            };
            let last = last.join().unwrap().unwrap_or_default();
            if last.contains(r#""outcome":"record_lost""#) {
                assert_eq!(status.code(), Some(1));
                lost += 1;
            }
        }
        assert!(lost > 0, "no limit struck the record's end");
    });
}

/// Standard output and standard error are pipes that nobody reads any more: all of a sweep is made and kept.
#[test]
fn a_reader_that_goes_away_ends_no_sweep() {
    wall::in_wall_clock_time(|| {
        let folder = tempfile::tempdir().unwrap();
        let plan = plan(folder.path(), 2);
        let whole = folder.path().join("whole");
        assert_eq!(sweep(&plan, &whole).arg("--fast").output().unwrap().status.code(), Some(0));
        unless_the_machine_stalls(|attempt| {
            let silent = folder.path().join(format!("wall-{attempt}"));
            let mut shell = Command::new("bash");
            shell.args(["-c", "exec 3> >(true); wait $!; exec \"$@\" >&3 2>&3", "bash"]);
            let plain = sweep(&plan, &silent);
            let status = shell.arg(plain.get_program()).args(plain.get_args()).status().unwrap().code();
            if status == Some(0) {
                assert_eq!(points(&silent), points(&whole));
                return None;
            }
            assert!(matches!(status, Some(1 | 2)), "{status:?}");
            Some(silent)
        });
    });
}
