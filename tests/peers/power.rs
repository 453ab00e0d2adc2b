//! The power fails at any instant of a sweep. A real `muprime run` is watched by strace; its changes of the disk are then played
//! again up to a random instant, without what was not synced (`power/disk.rs`). What it had acknowledged must be there, and all
//! that is left must be read and gone on with. A thousand cuts; `MUPRIME_POWER_CUTS` makes more.

#[path = "power/disk.rs"]
mod disk;
#[path = "power/log.rs"]
mod log;

use log::Op;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;
use tests::{muprime, served, texts};

/// A folder in memory where there is one: thousands of syncs of a real disk take long.
fn folder() -> tempfile::TempDir {
    let memory = Path::new("/dev/shm");
    if memory.is_dir() { tempfile::tempdir_in(memory).unwrap() } else { tempfile::tempdir().unwrap() }
}

fn sweep(plan: &Path, out: &Path) -> Command {
    let mut command = muprime();
    command.args(["--json", "run", "--fast", "--setup", "virtual-ideal"]).arg(plan).arg("--out").arg(out);
    command
}

struct Watched {
    _folder: tempfile::TempDir,
    plan: PathBuf,
    root: PathBuf,
    ops: Vec<Op>,
    planned: usize,
}

fn watched() -> Watched {
    let folder = folder();
    let (plan, root) = (folder.path().join("plan.toml"), folder.path().join("root"));
    std::fs::write(&plan, served::plan("power", 2, &[1e-6, 2e-6, 3e-6])).unwrap();
    std::fs::create_dir(&root).unwrap();
    let log = folder.path().join("calls");
    let plain = sweep(&plan, &root.join("runs/r"));
    let output = Command::new("strace")
        .args(["-f", "-qq", "-xx", "-s", "100000000", "-e", &format!("trace={}", log::CALLS), "-o"])
        .arg(&log)
        .arg(plain.get_program())
        .args(plain.get_args())
        .output()
        .expect("strace is needed: tests/run installs it");
    assert_eq!(output.status.code(), Some(0), "{}", texts(&output).1);
    let ops = log::read(&std::fs::read_to_string(&log).unwrap(), &root);
    let planned = runs::run_dir::passes_in(&root.join("runs/r")).unwrap().len();
    Watched { _folder: folder, plan, root, ops, planned }
}

/// Points whose passes were acknowledged, and whether the end was.
fn said(ops: &[Op]) -> (BTreeSet<u64>, bool) {
    let (mut points, mut ended) = (BTreeSet::new(), false);
    for op in ops {
        let Op::Said(bytes) = op else { continue };
        for line in bytes.split(|b| *b == b'\n').filter(|l| !l.is_empty()) {
            let said: serde_json::Value = serde_json::from_slice(line).unwrap();
            points.extend(said.get("pass").map(|p| p["pass"]["point"].as_u64().unwrap()));
            ended |= said["summary"]["outcome"] == "complete";
        }
    }
    (points, ended)
}

/// Picks syncs that do nothing.
type Deaf = Box<dyn Fn(&Op) -> bool + Sync>;

/// Holds what is left after a cut against what was acknowledged.
fn judge(root: &Path, acknowledged: &BTreeSet<u64>, ended: bool) -> Result<(), String> {
    let run = root.join("runs/r");
    let mut kept = BTreeSet::new();
    if run.join("points.csv").exists() {
        let passes = runs::run_dir::passes_in(&run).map_err(|e| format!("the passes: {e:#}"))?;
        kept.extend(passes.iter().map(|p| p.pass.point));
    }
    if !acknowledged.is_subset(&kept) {
        return Err(format!("acknowledged {acknowledged:?}, kept {kept:?}"));
    }
    if root.join("runs").exists() {
        let runs =
            runs::catalogue::runs_in(&root.join("runs")).map_err(|e| format!("the list of runs: {e:#}"))?;
        let noted = runs.first().map_or(0, |r| r.passes);
        if noted < acknowledged.len() {
            return Err(format!("the list has {noted} passes of {}", acknowledged.len()));
        }
        if ended && runs[0].outcome != "complete" {
            return Err(format!("the list says '{}'", runs[0].outcome));
        }
    }
    if ended {
        let record = std::fs::read(run.join("run-1.mcap")).map_err(|e| format!("the record: {e}"))?;
        let found = tests::contents::read(&record).integrity;
        if !tests::contents::complete(&found) {
            return Err(format!("the record: {:?}", found.sentences()));
        }
        let summary = std::fs::read(run.join("summary.json")).map_err(|e| format!("the summary: {e}"))?;
        serde_json::from_slice::<runs::job::Summary>(&summary).map_err(|e| format!("the summary: {e}"))?;
        let report =
            std::fs::read_to_string(run.join("report.html")).map_err(|e| format!("the report: {e}"))?;
        if !report.trim_end().ends_with("</html>") {
            return Err("the report is torn".into());
        }
    }
    Ok(())
}

/// Cuts at random instants; the first that went wrong, if any.
fn cut(watched: &Watched, cuts: u64, deaf: &(dyn Fn(&Op) -> bool + Sync)) -> Option<String> {
    (0..cuts).into_par_iter().find_map_any(|seed| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        // Every fourth comes after the end, when the most is relied upon.
        let at = match rng.next_u64() % 4 {
            0 => watched.ops.len(),
            _ => rng.next_u64() as usize % (watched.ops.len() + 1),
        };
        let left = folder();
        disk::after_a_cut(&watched.ops[..at], &watched.root, left.path(), &mut rng, deaf);
        let (acknowledged, ended) = said(&watched.ops[..at]);
        let wrong = judge(left.path(), &acknowledged, ended).err();
        wrong.map(|wrong| format!("cut {seed}, after {at} of {} changes: {wrong}", watched.ops.len()))
    })
}

#[test]
fn a_power_cut_at_any_instant_loses_nothing_that_was_acknowledged() {
    let cuts = std::env::var("MUPRIME_POWER_CUTS").map_or(1000, |n| n.parse().expect("a count of cuts"));
    let watched = watched();
    assert_eq!(said(&watched.ops), ((0..watched.planned as u64).collect(), true));
    assert_eq!(cut(&watched, cuts, &|_| false), None);
    println!(
        "{cuts} power cuts within {} changes of the disk: nothing acknowledged was lost",
        watched.ops.len()
    );

    // Negative controls: as if a sync were not in the program. Each must be seen.
    let of = |name: &'static str| move |op: &Op| matches!(op, Op::Sync { name: file, .. } if file.file_name().unwrap() == name);
    let names = |folder: PathBuf| move |op: &Op| matches!(op, Op::SyncFolder(synced) if *synced == folder);
    let (root, runs) = (watched.root.clone(), watched.root.join("runs"));
    let controls: [(&str, Deaf); 7] = [
        ("points.csv", Box::new(of("points.csv"))),
        ("passes.jsonl", Box::new(of("passes.jsonl"))),
        ("run-1.mcap", Box::new(of("run-1.mcap"))),
        ("summary.json before it is moved", Box::new(of("summary.json.new"))),
        ("names in the run's folder", Box::new(names(runs.join("r")))),
        ("names in the folder of runs", Box::new(names(runs))),
        ("the name of the folder of runs", Box::new(names(root))),
    ];
    for (what, deaf) in controls {
        let seen = cut(&watched, 1000, &*deaf);
        println!("without the sync of {what}: {seen:?}");
        assert!(seen.is_some(), "{what} need not be synced: nothing would be noticed");
    }
}

#[test]
fn what_a_power_cut_leaves_is_gone_on_with() {
    let watched = watched();
    for seed in 0..40 {
        let mut rng = ChaCha8Rng::seed_from_u64(1_000_000 + seed);
        let at = rng.next_u64() as usize % (watched.ops.len() + 1);
        let left = folder();
        disk::after_a_cut(&watched.ops[..at], &watched.root, left.path(), &mut rng, &|_| false);
        let run = left.path().join("runs/r");
        let output = sweep(&watched.plan, &run).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "cut {seed} at {at}: {}", texts(&output).1);
        let passes = runs::run_dir::passes_in(&run).unwrap();
        let points: BTreeSet<u64> = passes.iter().map(|p| p.pass.point).collect();
        assert_eq!((passes.len(), points.len()), (watched.planned, watched.planned), "cut {seed} at {at}");
    }
}
