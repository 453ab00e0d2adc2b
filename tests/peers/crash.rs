//! The process dies at EVERY step of a sweep: `kill -9` at each system call that changes the disk, one run a step, by an
//! independent tool (strace's fault injection, which counts each kind of call for itself). Each crashed sweep is resumed, and resumed again when nothing is left.

use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::{Command, Output};
use tests::{documents, muprime, served, texts};

/// System calls that make, change, name or remove files.
const CHANGES: &str = "openat,write,pwrite64,writev,pwritev,fsync,fdatasync,rename,renameat,renameat2,unlink,unlinkat,\
                       mkdir,mkdirat,ftruncate,fallocate,link,linkat,symlink";

fn sweep(plan: &Path, out: &Path) -> Command {
    let mut command = muprime();
    command.args(["--json", "run", "--fast", "--setup", "virtual-ideal"]).arg(plan).arg("--out").arg(out);
    command
}

/// Every change of the disk that a sweep makes: which call, and the how many-th of its kind in its thread, as strace counts
/// when it injects. Where two threads have as many, the first to get there is the one that dies.
fn steps(plan: &Path, folder: &Path) -> Vec<(String, u64)> {
    let log = folder.join("calls");
    let plain = sweep(plan, &folder.join("traced"));
    let mut traced = Command::new("strace");
    traced.args(["-f", "-qq", "-e", &format!("trace={CHANGES}"), "-o"]).arg(&log);
    traced.arg(plain.get_program()).args(plain.get_args());
    let output = traced.output().expect("strace is needed: tests/run installs it");
    assert_eq!(output.status.code(), Some(0), "{}", texts(&output).1);
    let mut counts: BTreeMap<(String, String), u64> = BTreeMap::new();
    let log = std::fs::read_to_string(log).unwrap();
    for line in log.lines() {
        let mut words = line.split_whitespace();
        let (thread, call) = (words.next(), words.next().and_then(|call| call.split_once('(')));
        if let (Some(thread), Some((call, _))) = (thread, call) {
            *counts.entry((call.to_string(), thread.to_string())).or_default() += 1;
        }
    }
    let mut most: BTreeMap<String, u64> = BTreeMap::new();
    for ((call, _), count) in counts {
        let one = most.entry(call).or_default();
        *one = count.max(*one);
    }
    most.into_iter().flat_map(|(call, count)| (1..=count).map(move |n| (call.clone(), n))).collect()
}

/// The sweep under strace, killed at the n-th of its calls of one kind.
fn killed_at((call, n): &(String, u64), plan: &Path, out: &Path) -> Output {
    let plain = sweep(plan, out);
    Command::new("strace")
        .args(["-f", "-qq", "-o", "/dev/null"])
        .args(["-e", &format!("trace={call}"), "-e", &format!("inject={call}:signal=KILL:when={n}")])
        .arg(plain.get_program())
        .args(plain.get_args())
        .output()
        .expect("strace is needed: tests/run installs it")
}

fn acknowledged(output: &Output) -> BTreeSet<u64> {
    // The kill may cut the last line: then it acknowledged nothing.
    let (out, _) = texts(output);
    let said = out.lines().filter_map(|l| serde_json::from_str::<serde_json::Value>(l).ok());
    said.filter_map(|d| d.get("pass").map(|p| p["pass"]["point"].as_u64().unwrap())).collect()
}

fn points(run: &Path) -> Vec<u64> {
    runs::run_dir::passes_in(run).unwrap().iter().map(|p| p.pass.point).collect()
}

/// One crash and its repair; false when the sweep came to its end before that step: its threads share the calls out anew.
fn crash(step: &(String, u64), plan: &Path, folder: &Path, planned: usize) -> bool {
    let out = folder.join("run");
    let died = killed_at(step, plan, &out);
    let n = format!("{} {}", step.0, step.1);
    if died.status.code() == Some(0) {
        return false;
    }
    let promised = acknowledged(&died);
    let resumed = sweep(plan, &out).output().unwrap();
    assert_eq!(resumed.status.code(), Some(0), "step {n}: {}", texts(&resumed).1);
    assert_eq!(documents(&resumed).last().unwrap()["summary"]["outcome"], "complete", "step {n}");
    let kept = points(&out);
    let unique: BTreeSet<u64> = kept.iter().copied().collect();
    assert_eq!(
        (kept.len(), unique.len()),
        (planned, planned),
        "step {n}: a pass is lost or doubled: {kept:?}"
    );
    assert!(promised.is_subset(&unique), "step {n}");
    for record in runs::run_dir::records_in(&out).unwrap() {
        let read = tests::contents::read(&std::fs::read(&record).unwrap());
        // A kill cuts a record and damages nothing: what the file holds of the last write may be torn.
        assert_eq!(read.integrity.damaged_places, 0, "step {n}: {}", record.display());
        assert!(read.integrity.missing.is_empty(), "step {n}: {}", record.display());
    }
    // Every step twice: a sweep that is done stays as it is.
    let table = std::fs::read(out.join("points.csv")).unwrap();
    let again = sweep(plan, &out).output().unwrap();
    assert_eq!(again.status.code(), Some(0), "step {n}: {}", texts(&again).1);
    assert_eq!(std::fs::read(out.join("points.csv")).unwrap(), table, "step {n}: a whole run was changed");
    std::fs::remove_dir_all(&out).unwrap();
    true
}

#[test]
fn a_crash_at_every_step_of_a_sweep_loses_and_doubles_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let plan = folder.path().join("plan.toml");
    std::fs::write(&plan, served::plan("steps", 2, &[2e-6])).unwrap();
    let whole = folder.path().join("whole");
    let output = sweep(&plan, &whole).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", texts(&output).1);
    let planned = points(&whole).len();
    let steps = steps(&plan, folder.path());
    let crashed: Vec<bool> = steps
        .par_iter()
        .map(|step| {
            let own = folder.path().join(format!("{}-{}", step.0, step.1));
            std::fs::create_dir(&own).unwrap();
            let crashed = crash(step, &plan, &own, planned);
            std::fs::remove_dir_all(&own).unwrap();
            crashed
        })
        .collect();
    let died = crashed.iter().filter(|c| **c).count();
    println!(
        "{died} of {} steps of a sweep of {planned} passes, a crash at each: nothing lost, nothing doubled",
        steps.len()
    );
    assert!(steps.len() > 100 && 20 * died > 19 * steps.len(), "strace saw too little of the sweep");
}

#[test]
fn a_read_only_folder_is_refused_before_anything_moves() {
    let folder = tempfile::tempdir().unwrap();
    let plan = folder.path().join("plan.toml");
    std::fs::write(&plan, served::plan("steps", 2, &[2e-6])).unwrap();
    // A file where the folder should be: refused for every user, root included.
    let blocked = folder.path().join("blocked");
    std::fs::write(&blocked, "not a folder").unwrap();
    let output = sweep(&plan, &blocked.join("run")).output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", texts(&output).1);
    assert_eq!(std::fs::read(&blocked).unwrap(), b"not a folder");
}
