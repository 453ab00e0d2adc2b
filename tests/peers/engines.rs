//! Studies on engines that know nothing of cases, on a Slurm that refuses, and results read where they are.

#[path = "slurm.rs"]
mod slurm;

use slurm::Slurm;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::{Duration, Instant};
use tests::study::{gathered, here, noop, ridge_cases, run, submitted, text};
use tests::{documents, file, muprime, python, texts};

/// The folder of the program that is tested comes first on the path.
fn path_with(folder: &Path) -> String {
    let binary = PathBuf::from(muprime().get_program());
    let own = binary.parent().unwrap().display();
    format!("{}:{own}:{}", folder.display(), std::env::var("PATH").unwrap())
}

/// In front of the real `sbatch`: refuses every second submission as a site's limit does, and notes its
/// arguments.
const REFUSES: &str = r#"#!/bin/sh
calls=$(cat "$0.calls" 2>/dev/null || echo 0)
echo $((calls + 1)) >"$0.calls"
if [ $((calls % 2)) = 0 ]; then
    echo "refused" >>"$0.log"
    echo "sbatch: error: AssocMaxSubmitJobLimit" >&2
    echo "sbatch: error: Batch job submission failed: Job violates accounting/QOS policy (job submit limit, user's size and/or time limits)" >&2
    exit 1
fi
echo "accepted $*" >>"$0.log"
exec /usr/bin/sbatch "$@"
"#;

#[test]
fn a_slurm_that_refuses_half_of_the_submissions_runs_them_all() {
    let folder = tempfile::tempdir().unwrap();
    let (cases, bin) = (folder.path().join("ridge.jsonl"), folder.path().join("bin"));
    ridge_cases(&cases, 40);
    let wanted = here(&cases, &folder.path().join("whole"));
    std::fs::create_dir(&bin).unwrap();
    let sbatch = bin.join("sbatch");
    std::fs::write(&sbatch, REFUSES).unwrap();
    std::fs::set_permissions(&sbatch, std::fs::Permissions::from_mode(0o755)).unwrap();
    let slurm = Slurm::start(folder.path());
    let out = folder.path().join("study");
    let begun = Instant::now();
    let mut submit = muprime()
        .args(["--json", "submit", text(&cases), "--out", text(&out), "--engine", "slurm"])
        .args(["--window", "16", "--cores-a-task", "2", "--task-s", "0.01"])
        .env("SLURM_CONF", slurm.0.join("slurm.conf"))
        .env("PATH", path_with(&bin))
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    while submit.try_wait().unwrap().is_none() {
        assert!(begun.elapsed() < Duration::from_secs(900), "it goes on");
        slurm.asked("resume", &[]);
        std::thread::sleep(Duration::from_millis(500));
    }
    let output = submit.wait_with_output().unwrap();
    assert!(output.status.success(), "{:?}", texts(&output));
    let said = documents(&output).pop().unwrap();
    let log = std::fs::read_to_string(bin.join("sbatch.log")).unwrap();
    let accepted: Vec<&str> = log.lines().filter(|line| *line != "refused").collect();
    let refused = log.lines().count() - accepted.len();
    println!(
        "{refused} refused, {} accepted, {:.0} s: {said}",
        accepted.len(),
        begun.elapsed().as_secs_f64()
    );
    // Each submission is accepted once, refused ones are repeated, and all arrays fit the window.
    assert!(refused >= accepted.len() && accepted.len() >= 3, "{log}");
    assert_eq!(accepted.len(), said["ids"].as_array().unwrap().len());
    let memory = 2 * (2 * said["pilot"]["peak_bytes"].as_u64().unwrap()).max(64 << 20);
    for line in &accepted {
        let value = |flag: &str| {
            let rest = line.split(flag).nth(1).unwrap_or_else(|| panic!("{flag}: {line}"));
            rest.split(' ').next().unwrap().to_string()
        };
        assert_eq!(value("--cpus-per-task="), "2");
        assert_eq!(value("--mem="), format!("{}M", memory.div_ceil(1 << 20)));
        assert!(value("--array=0-").parse::<u64>().unwrap() < 8, "{line}");
    }
    // Tasks that succeeded left no log; two workers a task.
    let job = out.join("jobs/0001");
    assert_eq!(std::fs::read_dir(job.join("logs")).unwrap().count(), 0);
    assert!(std::fs::read_to_string(job.join("task.sh")).unwrap().contains("+ 1) * 2))"));
    assert_eq!(gathered(&out), wanted);
}

#[test]
fn a_slurm_that_refuses_for_good_is_an_error_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let slurm = Slurm::start(folder.path());
    let out = folder.path().join("study");
    let cases = noop(folder.path(), 4, 0);
    let refused = run(muprime()
        .args(["submit", text(&cases), "--out", text(&out), "--engine", "slurm", "--case-s", "1"])
        .args(["--option=--partition=nowhere"])
        .env("SLURM_CONF", slurm.0.join("slurm.conf")));
    assert_eq!(refused.status.code(), Some(2));
    // As a terminal folds it.
    let why: Vec<String> = texts(&refused).1.split_whitespace().map(str::to_string).collect();
    let why = why.into_iter().filter(|w| w != "│").collect::<Vec<_>>().join(" ");
    assert!(why.contains("invalid partition specified"), "{why}");
    assert!(out.join("jobs/0001/ended").exists());
}

#[test]
fn snakemake_gathers_the_bytes_of_this_machine() {
    let folder = tempfile::tempdir().unwrap();
    let cases = folder.path().join("ridge.jsonl");
    ridge_cases(&cases, 40);
    let wanted = here(&cases, &folder.path().join("whole"));
    let out = folder.path().join("study");
    let snakemake = || {
        let mut command = python();
        command
            .args([
                "-m",
                "snakemake",
                "--snakefile",
                text(&file("examples/studies/Snakefile")),
                "--cores",
                "2",
            ])
            .args(["--config", &format!("cases={}", text(&cases)), &format!("out={}", text(&out)), "tasks=7"])
            .current_dir(folder.path())
            .env("PATH", path_with(folder.path()));
        command
    };
    let done = run(&mut snakemake());
    assert!(done.status.success(), "{:?}", texts(&done));
    assert_eq!(gathered(&out), wanted);
    let again = run(&mut snakemake());
    assert!(again.status.success() && texts(&again).1.contains("Nothing to be done"), "{:?}", texts(&again));
}

#[test]
fn the_job_for_kubernetes_is_one_by_the_published_schema() {
    let script = file("tests/peers/studies.py");
    let job = file("examples/studies/kubernetes-job.yaml");
    let checked = run(python().args([text(&script), "kubernetes", text(&job)]));
    assert!(checked.status.success(), "{:?}", texts(&checked));
    println!("{}", texts(&checked).0);
}

#[test]
fn polars_and_duckdb_read_the_shards_where_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let cases = folder.path().join("ridge.jsonl");
    ridge_cases(&cases, 24);
    let out = folder.path().join("study");
    submitted(&cases, &out, &["--case-s", "1", "--task-s", "5"]);
    // Cases that were run twice are there twice.
    let twice = ["case", "--cases", text(&cases), "--out", text(&out), "--range", "3..9"];
    assert!(run(muprime().args(twice)).status.success());
    gathered(&out);
    let script = file("tests/peers/studies.py");
    let read = run(python().args([text(&script), "rows", text(&out), text(&out.join("gathered.parquet"))]));
    assert!(read.status.success(), "{:?}", texts(&read));
    println!("{}", texts(&read).0);
}
