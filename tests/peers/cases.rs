//! Studies of many cases: clocks that are wrong, a disk that is full, and the same bytes from this machine, from a real Slurm, a real HyperQueue and a real Dask.

#[path = "slurm.rs"]
mod slurm;

use slurm::{Slurm, kill};
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use tests::study::{gathered, here, noop, refusal, ridge_cases, run, said, submitted, text, worker};
use tests::{documents, file, muprime, python, rounds, texts};

#[test]
fn a_full_disk_leaves_no_shard_and_the_next_call_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let cases = noop(folder.path(), 3000, 0);
    let wanted = here(&cases, &folder.path().join("whole"));
    let out = folder.path().join("small");
    std::fs::create_dir(&out).unwrap();
    let mount = |options: &str| {
        run(Command::new("mount").args(["-t", "tmpfs", "-o", options, "none", text(&out)])).status.success()
    };
    assert!(mount("size=64k"), "as root: a small file system of its own");
    let full = run(&mut worker(&cases, &out, "0..3000"));
    let left = std::fs::read_dir(out.join("parts")).unwrap().count()
        + std::fs::read_dir(out.join("shards")).unwrap().count();
    assert!(mount("remount,size=8m"));
    let again = run(&mut worker(&cases, &out, "0..3000"));
    let found = again.status.success().then(|| gathered(&out));
    assert!(run(Command::new("umount").arg(&out)).status.success());
    assert_eq!(full.status.code(), Some(1), "{:?}", texts(&full));
    assert!(texts(&full).1.contains("No space left"), "{:?}", texts(&full));
    assert_eq!((left, found.as_deref()), (0, Some(wanted.as_str())), "{:?}", texts(&again));
}

#[test]
fn workers_whose_clocks_differ_by_years_come_to_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let cases = noop(folder.path(), 30, 0);
    let wanted = here(&cases, &folder.path().join("whole"));
    let out = folder.path().join("skewed");
    for (clock, range) in [("-2y", "0..20"), ("+3y", "10..30"), ("-5d", "0..20")] {
        let own = worker(&cases, &out, range);
        let skewed =
            run(Command::new("faketime").args(["-f", clock]).arg(own.get_program()).args(own.get_args()));
        assert!(skewed.status.success(), "{:?}", texts(&skewed));
    }
    assert_eq!(gathered(&out), wanted);
    assert_eq!(said(&["gather", text(&out)])["agreeing_duplicates"], 10);
}

/// Tables of sealed sets, thinned out to some forty passes, to be diagnosed by four effects.
fn diagnoses(folder: &Path, path: &Path, tables: usize) {
    let sets = folder.join("sets");
    let count = tables.to_string();
    assert!(run(muprime().args(["blind", "--sets", &count, "--write", text(&sets)])).status.success());
    let mut list = String::new();
    let mut folders: Vec<PathBuf> =
        std::fs::read_dir(sets.join("open")).unwrap().map(|e| e.unwrap().path()).collect();
    folders.sort();
    for set in folders {
        let table = set.join("points.csv");
        let rows = std::fs::read_to_string(&table).unwrap();
        let rows: Vec<&str> = rows.lines().collect();
        let kept: Vec<&str> = rows[1..].iter().step_by(rows.len().div_ceil(40)).copied().collect();
        std::fs::write(&table, format!("{}\n{}\n", rows[0], kept.join("\n"))).unwrap();
        list.push_str(&format!("{}\n", table.display()));
    }
    let listed = folder.join("tables.txt");
    std::fs::write(&listed, list).unwrap();
    let mut words = vec!["cases", "diagnose", "--list", text(&listed), "--no-pairs", "-o", text(path)];
    let effects = run(muprime().args(["--json", "model", "effects"]));
    let effects = documents(&effects).pop().unwrap();
    let names: Vec<String> = effects
        .as_array()
        .or(effects["effects"].as_array())
        .expect("a list of effects")
        .iter()
        .map(|e| e["name"].as_str().unwrap().to_string())
        .collect();
    let kept = ["squeeze_film", "load_dependent_friction", "lateral_offset_drift", "stiffness_error"];
    for name in names.iter().filter(|n| !kept.contains(&n.as_str())) {
        words.extend(["--without", name]);
    }
    said(&words);
}

/// Both studies of the engines' tests, and their hashes on this machine.
fn studies(folder: &Path) -> Vec<(PathBuf, String)> {
    let (ridge, tables) = (folder.join("ridge.jsonl"), folder.join("tables.jsonl"));
    ridge_cases(&ridge, rounds(40, 2000));
    diagnoses(folder, &tables, rounds(6, 500));
    let named = |cases: PathBuf, name: &str| {
        let begun = Instant::now();
        let hash = here(&cases, &folder.join(name));
        println!("local {name}: {:.1} s", begun.elapsed().as_secs_f64());
        (cases, hash)
    };
    vec![named(ridge, "ridge"), named(tables, "tables")]
}

/// A server with two workers, in Python.
fn cluster(kind: &str, folder: &Path) -> (Child, String) {
    let place = folder.join(kind);
    std::fs::create_dir_all(&place).unwrap();
    let mut child = python()
        .args([text(&file("tests/studies/cluster.py")), kind, text(&place)])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    let server =
        lines.by_ref().map(Result::unwrap).find_map(|l| l.strip_prefix("server: ").map(str::to_string));
    // What it says later is read too: a full pipe would stop it.
    std::thread::spawn(move || lines.for_each(drop));
    (child, server.expect("a server"))
}

#[test]
fn hyperqueue_and_dask_gather_the_bytes_of_this_machine() {
    let folder = tempfile::tempdir().unwrap();
    let studies = studies(folder.path());
    for engine in ["hq", "dask"] {
        let (mut child, server) = cluster(engine, folder.path());
        let python = file("target/venv/bin/python");
        for (n, (cases, wanted)) in studies.iter().enumerate() {
            let out = folder.path().join(format!("{engine}-{n}"));
            let more = ["--engine", engine, "--server", &server, "--python", text(&python), "--workers", "2"];
            let said = submitted(cases, &out, &more);
            println!("{engine} {}: {said}", cases.display());
            assert_eq!(said["missing"], 0, "{said}");
            assert_eq!(&gathered(&out), wanted, "{engine}");
        }
        drop(child.stdin.take());
        child.wait().unwrap();
    }
}

/// Processes whose command or environment names the folder: those of a node that goes down with it.
fn processes_of(folder: &Path, words: &[&str]) -> Vec<i32> {
    let named = |pid: &i32| {
        let of = |what: &str| std::fs::read(format!("/proc/{pid}/{what}")).unwrap_or_default();
        let (command, environment) = (of("cmdline"), of("environ"));
        let has = |bytes: &[u8], word: &str| bytes.windows(word.len()).any(|w| w == word.as_bytes());
        words.iter().any(|w| has(&command, w))
            && (has(&command, text(folder)) || has(&environment, text(folder)))
    };
    let all =
        std::fs::read_dir("/proc").unwrap().filter_map(|e| e.unwrap().file_name().to_str()?.parse().ok());
    all.filter(|pid| *pid != std::process::id() as i32).filter(named).collect()
}

/// Whether a job of the study has not been seen to end.
fn submit_goes_on(out: &Path) -> bool {
    !out.join("jobs/0001/ended").exists()
}

#[test]
fn slurm_gathers_the_bytes_of_this_machine_though_controller_and_node_die() {
    let folder = tempfile::tempdir().unwrap();
    let studies = studies(folder.path());
    let slurm = Slurm::start(folder.path());
    let conf = slurm.0.join("slurm.conf");
    for (n, (cases, wanted)) in studies.iter().enumerate() {
        let out = folder.path().join(format!("slurm-{n}"));
        let begun = Instant::now();
        let mut submit = muprime()
            .args([
                "--json",
                "submit",
                text(cases),
                "--out",
                text(&out),
                "--engine",
                "slurm",
                "--workers",
                "2",
            ])
            .args(["--case-s", rounds("0.2", "0.1"), "--task-s", rounds("1", "5"), "--time", "30"])
            .env("SLURM_CONF", &conf)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let shards = || std::fs::read_dir(out.join("shards/0000")).map_or(0, Iterator::count);
        let wait = |more: usize| {
            let until = shards() + more;
            while shards() < until && submit_goes_on(&out) && begun.elapsed() < Duration::from_secs(60) {
                slurm.asked("resume", &[]);
                std::thread::sleep(Duration::from_millis(100));
            }
        };
        if n == 0 {
            wait(1);
            // The controller dies and comes back; what runs goes on meanwhile.
            slurm.kill("slurmctld");
            std::thread::sleep(Duration::from_secs(2));
            slurm.asked("controller", &[]);
            wait(1);
            // The node goes down: its daemon, what watches over the tasks, and the workers.
            slurm.kill("slurmd");
            processes_of(&slurm.0, &["slurmstepd", "slurm_script"]).into_iter().for_each(kill);
            processes_of(&out, &["slurm_script", "\0case\0"]).into_iter().for_each(kill);
            slurm.asked("node", &[]);
        }
        let output = loop {
            if submit.try_wait().unwrap().is_some() {
                break submit.wait_with_output().unwrap();
            }
            if begun.elapsed() > Duration::from_secs(rounds(900, 3000)) {
                submit.kill().unwrap();
                panic!("{} shards", shards());
            }
            slurm.asked("resume", &[]);
            std::thread::sleep(Duration::from_millis(500));
        };
        println!("slurm {}: {:?}", cases.display(), texts(&output).0);
        // What Slurm gave up with the node is what the same command runs.
        let again = run(muprime()
            .args([
                "--json",
                "submit",
                text(cases),
                "--out",
                text(&out),
                "--engine",
                "slurm",
                "--workers",
                "2",
            ])
            .env("SLURM_CONF", &conf));
        assert!(again.status.success(), "{:?}", texts(&again));
        assert_eq!(&gathered(&out), wanted);
    }
    // What waits and what runs is cancelled, and the same command goes on from there.
    let cases = noop(folder.path(), 40, 20_000_000);
    let out = folder.path().join("cancelled");
    let more =
        ["submit", text(&cases), "--out", text(&out), "--engine", "slurm", "--detach", "--case-s", "5"];
    let begun = run(muprime().args(more).env("SLURM_CONF", &conf));
    assert!(begun.status.success(), "{:?}", texts(&begun));
    let cancelled = run(muprime().args(["submit", "--cancel", "--out", text(&out)]).env("SLURM_CONF", &conf));
    assert!(cancelled.status.success(), "{:?}", texts(&cancelled));
    let until = Instant::now() + Duration::from_secs(600);
    while !run(Command::new("squeue").arg("-h").env("SLURM_CONF", &conf)).stdout.is_empty() {
        assert!(Instant::now() < until, "jobs go on");
        slurm.asked("resume", &[]);
        std::thread::sleep(Duration::from_millis(200));
    }
    assert!(refusal(&["gather", text(&out)]).contains("cases have no result"));
}
