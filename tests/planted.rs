//! What somebody else puts into a folder that both may write to: links are not followed, and programs that are named there are not run.

use serde_json::json;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use tests::{muprime, texts};

const PRECIOUS: &str = "precious";

fn symbolic(victim: &Path, place: &Path) {
    std::os::unix::fs::symlink(victim, place).unwrap();
}

fn hard(victim: &Path, place: &Path) {
    std::fs::hard_link(victim, place).unwrap();
}

/// Links in the place of every file that a run writes: what they lead to stays as it is, and a run that is made all the same is whole.
#[test]
fn a_run_destroys_nothing_that_a_planted_link_leads_to() {
    for name in ["run/.lock", "run/run.toml.new"] {
        for (kind, plant) in [("symbolic", symbolic as fn(&Path, &Path)), ("hard", hard)] {
            let folder = tempfile::tempdir().unwrap();
            let victim = folder.path().join("victim");
            std::fs::write(&victim, PRECIOUS).unwrap();
            let runs = folder.path().join("runs");
            std::fs::create_dir_all(runs.join("run")).unwrap();
            plant(&victim, &runs.join(name));
            let mut run = muprime();
            run.args(["run", "first-sweep", "--setup", "virtual-ideal", "--fast", "--out"])
                .arg(runs.join("run"));
            let output = run.output().unwrap();
            assert_eq!(
                std::fs::read_to_string(&victim).unwrap(),
                PRECIOUS,
                "{kind} link at {name}: {:?}",
                texts(&output)
            );
            let refused = output.status.code() == Some(2);
            // A run is refused, or goes on beside what was planted and is whole.
            assert!(refused || runs.join("run/report.html").exists(), "{kind} {name}: {:?}", texts(&output));
        }
    }
}

/// The last files too, which are made when the run has ended: a link that is planted meanwhile.
#[test]
fn a_run_replaces_a_link_in_the_place_of_its_report() {
    let folder = tempfile::tempdir().unwrap();
    let (victim, out) = (folder.path().join("victim"), folder.path().join("run"));
    let run = || {
        let mut run = muprime();
        run.args(["run", "first-sweep", "--setup", "virtual-ideal", "--fast", "--out"]).arg(&out);
        run.output().unwrap()
    };
    assert_eq!(run().status.code(), Some(0));
    for (part, plant) in [("", symbolic as fn(&Path, &Path)), ("", hard), (".new", symbolic), (".new", hard)]
    {
        std::fs::write(&victim, PRECIOUS).unwrap();
        for name in ["report.html", "summary.json", "rig.toml"] {
            std::fs::remove_file(out.join(name)).unwrap();
            plant(&victim, &out.join(format!("{name}{part}")));
        }
        let output = run();
        assert_eq!(std::fs::read_to_string(&victim).unwrap(), PRECIOUS, "{part}: {:?}", texts(&output));
        for name in ["report.html", "summary.json", "rig.toml"] {
            assert!(
                out.join(name).symlink_metadata().unwrap().is_file(),
                "{name}{part}: {:?}",
                texts(&output)
            );
            assert!(!out.join(format!("{name}.new")).exists());
        }
    }
}

/// A name beside a record that leads nowhere is not made into a copy of it somewhere else.
#[test]
fn recover_follows_no_link() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run");
    let mut run = muprime();
    run.args(["run", "first-sweep", "--setup", "virtual-ideal", "--fast", "--out"]).arg(&out);
    assert_eq!(run.output().unwrap().status.code(), Some(0));
    let record = out.join("run-1.mcap");
    let whole = std::fs::read(&record).unwrap();
    std::fs::write(&record, &whole[..whole.len() / 2]).unwrap();
    let (nowhere, victim) = (folder.path().join("nowhere"), folder.path().join("victim"));
    std::fs::write(&victim, PRECIOUS).unwrap();
    symbolic(&nowhere, &out.join("run-1.mcap.original"));
    symbolic(&victim, &out.join("run-1.mcap.new"));
    let output = muprime().arg("recover").arg(&record).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{:?}", texts(&output));
    assert!(!nowhere.exists() && std::fs::read_to_string(&victim).unwrap() == PRECIOUS);
    assert_eq!(std::fs::read(out.join("run-1.mcap.original-2")).unwrap(), &whole[..whole.len() / 2]);
}

/// A study whose folder holds a job that names programs: none of them is run, by no engine, and a job's name is a number.
#[test]
fn a_studys_folder_names_no_program() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let (cases, out, ran) = (at("noop.jsonl"), at("out"), at("ran"));
    let made = muprime()
        .args(["cases", "noop", "--cases", "3", "--hashes", "0", "-o"])
        .arg(&cases)
        .output()
        .unwrap();
    assert!(made.status.success(), "{:?}", texts(&made));
    // Programs that say that they were run, and with what.
    std::fs::create_dir(at("bin")).unwrap();
    for name in ["evil", "scancel", "squeue", "sbatch", "python"] {
        let text = format!("#!/bin/sh\necho {name} \"$@\" >> '{}'\ncat > /dev/null\nexit 1\n", ran.display());
        std::fs::write(at("bin").join(name), text).unwrap();
        std::fs::set_permissions(at("bin").join(name), std::fs::Permissions::from_mode(0o755)).unwrap();
    }
    let path = format!("{}:{}", at("bin").display(), std::env::var("PATH").unwrap_or_default());
    let submit = |more: &[&str]| {
        let mut submit = muprime();
        submit.arg("submit").arg(&cases).arg("--out").arg(&out).args(more).env("PATH", &path);
        submit.output().unwrap()
    };
    let said = || std::fs::read_to_string(&ran).unwrap_or_default();
    for engine in ["hq", "slurm", "dask"] {
        let _ = std::fs::remove_dir_all(&out);
        let jobs = out.join("jobs/0001");
        std::fs::create_dir_all(&jobs).unwrap();
        let evil = at("bin").join("evil");
        let job = json!({ "engine": engine, "ids": ["-u", "root"], "kind": "noop", "command": [evil], "ranges": [],
            "limit_s": 1.0, "workers": null, "server": "x", "python": evil, "options": [evil] });
        std::fs::write(jobs.join("job.json"), job.to_string()).unwrap();
        std::fs::write(
            jobs.join("hand_over.py"),
            format!("open({:?}, 'a').write('script')", ran.display().to_string()),
        )
        .unwrap();
        let output = submit(&["--engine", "local"]);
        assert!(output.status.success(), "{engine}: {:?}", texts(&output));
        assert_eq!(said(), "", "{engine}: a program of the folder was run");
        let cancelled = submit(&["--cancel"]);
        assert!(
            !said().contains("root") && !said().contains("evil"),
            "{engine}: {} {:?}",
            said(),
            texts(&cancelled)
        );
    }
    // The engine that is named: its program is the one of the command line, and gets none of the folder's words.
    let _ = std::fs::remove_dir_all(&out);
    let jobs = out.join("jobs/0001");
    std::fs::create_dir_all(&jobs).unwrap();
    let evil = at("bin").join("evil");
    let job = json!({ "engine": "hq", "ids": ["7"], "kind": "noop", "command": [evil], "ranges": [], "limit_s": 1.0,
        "workers": null, "server": "x", "python": evil, "options": [] });
    std::fs::write(jobs.join("job.json"), job.to_string()).unwrap();
    let python = at("bin").join("python");
    let output = submit(&["--engine", "hq", "--case-s", "1", "--python", python.to_str().unwrap()]);
    assert!(said().contains("python -c") && !said().contains("evil"), "{} {:?}", said(), texts(&output));
}
