//! Studies of many cases: the worker killed at each step and at random, a disk that is full, clocks that are wrong, what gathering
//! refuses, and the same bytes from this machine, from a real Slurm, a real HyperQueue and a real Dask.

use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};
use studies::cases::crash_points::{STEPS, VARIABLE};
use studies::cases::kinds::Cell;
use studies::cases::shard::{Reader, Writer};
use studies::cases::study::Study;
use tests::{documents, file, muprime, python, rounds, texts};

fn run(command: &mut Command) -> Output {
    command.output().expect("a command that can be run")
}

/// Runs `muprime` with these words; the JSON document that it prints.
fn said(words: &[&str]) -> Value {
    let output = run(muprime().arg("--json").args(words));
    assert!(output.status.success(), "{words:?}: {:?}", texts(&output));
    documents(&output).pop().expect("a document")
}

fn text(path: &Path) -> &str {
    path.to_str().expect("a path in UTF-8")
}

/// A file of cases that hash.
fn noop(folder: &Path, cases: u64, hashes: u64) -> PathBuf {
    let path = folder.join("noop.jsonl");
    let (cases, hashes) = (cases.to_string(), hashes.to_string());
    said(&["cases", "noop", "--cases", &cases, "--hashes", &hashes, "-o", text(&path)]);
    path
}

fn worker(cases: &Path, out: &Path, range: &str) -> Command {
    let mut command = muprime();
    command.args(["case", "--threads", "1", "--cases", text(cases), "--out", text(out), "--range", range]);
    command
}

/// SHA-256 of what is gathered.
fn gathered(out: &Path) -> String {
    let whole = said(&["gather", text(out)]);
    whole["sha256"].as_str().expect("a hash").to_string()
}

fn submitted(cases: &Path, out: &Path, more: &[&str]) -> Value {
    said(&[&["submit", text(cases), "--out", text(out)], more].concat())
}

/// A study on this machine; its hash.
fn here(cases: &Path, out: &Path) -> String {
    assert_eq!(submitted(cases, out, &[])["missing"], 0);
    gathered(out)
}

fn refusal(words: &[&str]) -> String {
    let output = run(muprime().args(words));
    assert_eq!(output.status.code(), Some(2), "{:?}", texts(&output));
    // As a terminal folds it.
    texts(&output).1.split_whitespace().filter(|w| *w != "│").collect::<Vec<_>>().join(" ")
}

#[test]
fn a_worker_that_is_killed_at_any_step_leaves_nothing_torn_and_is_run_again() {
    let folder = tempfile::tempdir().unwrap();
    let cases = noop(folder.path(), 40, 0);
    let wanted = here(&cases, &folder.path().join("whole"));
    for step in STEPS {
        let out = folder.path().join(step);
        let killed = run(worker(&cases, &out, "0..40").env(VARIABLE, step));
        assert_eq!(killed.status.code(), None, "{step}: {:?}", texts(&killed));
        // What is there by then is whole, or nothing is.
        let there = out.join("shards/000000000000-000000000040.parquet").exists();
        assert_eq!(there, matches!(step, "moved" | "folder-synced"), "{step}");
        if there {
            assert_eq!(gathered(&out), wanted, "{step}");
        }
        // Twice: the second finds it there.
        for _ in 0..2 {
            let again = run(&mut worker(&cases, &out, "0..40"));
            assert!(again.status.success(), "{step}: {:?}", texts(&again));
        }
        assert_eq!(gathered(&out), wanted, "{step}");
    }
}

#[test]
fn workers_that_are_killed_at_random_and_run_twice_lose_nothing_and_double_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let cases = noop(folder.path(), 60, 5_000);
    let wanted = here(&cases, &folder.path().join("whole"));
    let out = folder.path().join("killed");
    let (mut state, mut kills) = (1_u64, 0);
    let mut random = |below: u64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) % below
    };
    // Each range has two workers at one time, which are killed some milliseconds later, until one of them comes to its end.
    for first in (0..60).step_by(10) {
        let range = format!("{first}..{}", first + 10);
        loop {
            let start =
                || worker(&cases, &out, &range).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
            let mut pair = [start(), start()];
            std::thread::sleep(Duration::from_millis(random(120)));
            if random(4) > 0 {
                pair.iter_mut().for_each(|w| w.kill().unwrap());
            }
            let ended: Vec<bool> = pair.iter_mut().map(|w| w.wait().unwrap().success()).collect();
            kills += ended.iter().filter(|good| !**good).count();
            if ended.contains(&true) {
                break;
            }
        }
    }
    let whole = said(&["gather", text(&out)]);
    assert_eq!((&whole["sha256"], &whole["cases"]), (&Value::from(wanted), &Value::from(60)));
    assert!(kills > 2, "{kills} kills");
}

#[test]
fn the_bytes_know_no_engine_no_order_no_ranges_and_no_threads() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let (ridge, faults, blind) = (at("ridge.jsonl"), at("faults.jsonl"), at("blind.jsonl"));
    ridge_cases(&ridge, 9);
    said(&["cases", "faults", "--seeds", "9", "-o", text(&faults)]);
    said(&["cases", "blind", "--sets", "9", "--stratum", "none", "--no-pairs", "-o", text(&blind)]);
    let studies = rounds(vec![ridge, faults], vec![at("ridge.jsonl"), at("faults.jsonl"), blind]);
    for (n, cases) in studies.iter().enumerate() {
        let wanted = here(cases, &at(&format!("whole-{n}")));
        let out = at(&format!("parts-{n}"));
        for range in ["5..9", "3..6", "0..2"] {
            assert!(run(&mut worker(cases, &out, range)).status.success());
        }
        let one = run(muprime().args(["case", "--cases", text(cases), "--out", text(&out), "--index", "2"]));
        assert!(one.status.success(), "{:?}", texts(&one));
        let whole = said(&["gather", text(&out)]);
        assert_eq!(whole["sha256"], wanted, "{}", cases.display());
        assert_eq!((&whole["shards"], &whole["agreeing_duplicates"]), (&4.into(), &1.into()));
    }
}

#[test]
fn failing_cases_are_results_with_a_reason() {
    let folder = tempfile::tempdir().unwrap();
    let (table, cases, out) =
        (folder.path().join("t.csv"), folder.path().join("c.jsonl"), folder.path().join("s"));
    std::fs::write(&table, "amplitude_pp_m,mu0\n1e-6,0.5\n1e-6,500\n").unwrap();
    said(&[
        "cases",
        "ridge",
        "--from",
        text(&table),
        "--elements",
        "128",
        "--at-most",
        "14",
        "-o",
        text(&cases),
    ]);
    here(&cases, &out);
    assert_eq!(said(&["gather", text(&out)])["failed"], 1);
    let study = Study::in_folder(&out, None).unwrap();
    let rows: Vec<_> =
        Reader::open(study.kind, &out.join("gathered.parquet")).unwrap().map(Result::unwrap).collect();
    assert!(rows[0].outcome.as_ref().is_ok_and(|cells| cells.len() == study.kind.columns.len()));
    assert!(rows[1].outcome.as_ref().is_err_and(|why| why.contains("mu0 is 500")), "{:?}", rows[1]);
    // What is no case is refused before anything is written.
    std::fs::write(&table, "amplitude_pp_m,mu\n1e-6,0.5\n").unwrap();
    let why = refusal(&["cases", "ridge", "--from", text(&table), "-o", text(&folder.path().join("not"))]);
    assert!(why.contains("no variable 'mu'") && !folder.path().join("not").exists(), "{why}");
}

#[test]
fn gathering_refuses_holes_contradictions_and_mixed_versions() {
    let folder = tempfile::tempdir().unwrap();
    let cases = noop(folder.path(), 30, 0);
    let out = folder.path().join("study");
    let shard = |range: &str| assert!(run(&mut worker(&cases, &out, range)).status.success());
    shard("0..10");
    shard("20..30");
    let table = out.join("gathered.parquet");
    let refused = || {
        let why = refusal(&["gather", text(&out)]);
        assert!(!table.exists() && !runs::files::beside(&table).exists(), "{why}");
        why
    };
    assert!(refused().contains("10 of 30 cases have no result: 10..20"));
    shard("10..20");
    let wanted = gathered(&out);
    std::fs::remove_file(&table).unwrap();
    // A shard made anew with something changed in it.
    let study = Study::in_folder(&out, None).unwrap();
    let whole = study.shard(&(10..20));
    let kept = std::fs::read(&whole).unwrap();
    let changed = |to: &Path, facts: &[(&str, &str)], change: &dyn Fn(&mut studies::cases::shard::Entry)| {
        std::fs::write(&whole, &kept).unwrap();
        let reader = Reader::open(study.kind, &whole).unwrap();
        let mut told = reader.facts.clone();
        told.extend(facts.iter().map(|(k, v)| (k.to_string(), v.to_string())));
        let mut writer = Writer::new(study.kind, Vec::new()).unwrap();
        for entry in reader {
            let mut entry = entry.unwrap();
            change(&mut entry);
            writer.push(entry).unwrap();
        }
        std::fs::write(to, writer.end(&told).unwrap()).unwrap();
    };
    changed(&whole, &[("version", "muprime 0.0.9, noop 1")], &|_| ());
    assert!(refused().contains("its version is 'muprime 0.0.9, noop 1'"));
    changed(&whole, &[("program", "another")], &|_| ());
    assert!(refused().contains("made by another build"));
    assert_eq!(said(&["gather", text(&out), "--any-build"])["sha256"], wanted);
    std::fs::remove_file(&table).unwrap();
    changed(&whole, &[("header", "0")], &|_| ());
    assert!(refused().contains("its header is '0'"));
    changed(&whole, &[], &|entry| entry.key[0] ^= 1);
    assert!(refused().contains("its row for case 10 is of another case"));
    // A second shard over the same cases: alike it is counted, different it is refused.
    let double = study.shard(&(10..21));
    changed(&double, &[("range", "10..21")], &|_| ());
    assert!(refused().contains("10 rows, where its name says 11"));
    std::fs::remove_file(&double).unwrap();
    shard("15..25");
    assert_eq!(said(&["gather", text(&out)])["agreeing_duplicates"], 10);
    std::fs::remove_file(&table).unwrap();
    changed(&whole, &[], &|entry| {
        if entry.index == 17 {
            entry.outcome = Ok(vec![Cell::Text("else".into())]);
        }
    });
    assert!(refused().contains("case 17 has two results that differ"));
    for keep in [0, kept.len() / 2, kept.len() - 1] {
        std::fs::write(&whole, &kept[..keep]).unwrap();
        assert!(refused().contains("000000000010-000000000020.parquet"));
    }
    // The worker sets a torn shard aside with a word, and makes it again.
    let again = run(&mut worker(&cases, &out, "10..20"));
    assert!(again.status.success() && texts(&again).1.contains("set aside"), "{:?}", texts(&again));
    assert_eq!(gathered(&out), wanted);
    // Another study does not get into the folder, and results of changed inputs are not taken for those that are there.
    let other = noop(&folder.path().canonicalize().unwrap(), 31, 0);
    let why = refusal(&["case", "--cases", text(&other), "--out", text(&out), "--index", "0"]);
    assert!(why.contains("results of two studies do not mix"), "{why}");
}

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

/// Ridge cases on the coarsest mesh.
fn ridge_cases(path: &Path, cases: usize) {
    let count = cases.to_string();
    let words =
        ["cases", "ridge", "--draw", &count, "--elements", "128", "--at-most", "14", "--tolerance", "0.05"];
    let spans = ["amplitude_pp_m=0.3e-6..5e-6:log", "frequency_hz=2e4..1e5:log", "mu0=0.2..1"];
    let spans: Vec<&str> = spans.into_iter().flat_map(|s| ["--span", s]).collect();
    said(&[&words[..], &spans, &["-o", text(path)]].concat());
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

/// A Slurm in a folder, ended with its tests.
struct Slurm(PathBuf);

impl Slurm {
    fn asked(&self, verb: &str, more: &[&str]) {
        let done = run(Command::new(file("tests/studies/slurm")).args([verb, text(&self.0)]).args(more));
        assert!(done.status.success(), "{verb}: {:?}", texts(&done));
    }

    /// Kills a daemon by the number in its file, and waits until it is gone.
    fn kill(&self, daemon: &str) {
        let number = std::fs::read_to_string(self.0.join(format!("{daemon}.pid"))).unwrap();
        kill(number.trim().parse().unwrap());
    }
}

impl Drop for Slurm {
    fn drop(&mut self) {
        let _ = run(Command::new(file("tests/studies/slurm")).args(["stop", text(&self.0)]));
    }
}

fn kill(pid: i32) {
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

#[test]
fn slurm_gathers_the_bytes_of_this_machine_though_controller_and_node_die() {
    let folder = tempfile::tempdir().unwrap();
    let studies = studies(folder.path());
    let slurm = Slurm(folder.path().join("slurm"));
    std::fs::create_dir(&slurm.0).unwrap();
    let port = 20_000 + std::process::id() % 20_000;
    slurm.asked("start", &[&port.to_string()]);
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
        let shards = || std::fs::read_dir(out.join("shards")).map_or(0, Iterator::count);
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
            if begun.elapsed() > Duration::from_secs(rounds(150, 3000)) {
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
    let until = Instant::now() + Duration::from_secs(30);
    while !run(Command::new("squeue").arg("-h").env("SLURM_CONF", &conf)).stdout.is_empty() {
        assert!(Instant::now() < until, "jobs go on");
        std::thread::sleep(Duration::from_millis(200));
    }
    assert!(refusal(&["gather", text(&out)]).contains("cases have no result"));
}

#[test]
fn a_surrogate_grows_in_rounds_until_held_out_cases_are_met() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("surrogate");
    let words = [
        "model",
        "adapt",
        "--out",
        text(&out),
        "--elements",
        "128",
        "--at-most",
        "14",
        "--tolerance",
        "0.05",
    ];
    let spans = ["--span", "amplitude_pp_m=0.3e-6..5e-6:log", "--span", "mu0=0.2..1"];
    let ends = ["--round", "15", "--held-out", "20", "--wanted", "0.03", "--nodes", "80"];
    let words = [&words[..], &spans, &ends].concat();
    let found = said(&words);
    let rounds = found["rounds"].as_array().unwrap();
    let rms = |n: usize| rounds[n]["rms"].as_f64().unwrap();
    assert!(
        rounds.len() > 1 && rms(rounds.len() - 1) < 0.03 && rms(rounds.len() - 1) < 0.5 * rms(0),
        "{found}"
    );
    // The same command goes on from what is there: it runs no case, and comes to the same bytes.
    let surrogate = out.join("surrogate.json");
    let (kept, shards) = (std::fs::read(&surrogate).unwrap(), out.join("round-000/shards"));
    let made = || {
        std::fs::read_dir(&shards).unwrap().map(|e| e.unwrap().metadata().unwrap().modified().unwrap()).max()
    };
    let before = made();
    assert_eq!(said(&words), found);
    assert_eq!((std::fs::read(&surrogate).unwrap(), made()), (kept, before));
}

/// Whether a job of the study has not been seen to end.
fn submit_goes_on(out: &Path) -> bool {
    !out.join("jobs/0001/ended").exists()
}
