//! Studies of many cases: the worker killed at each step and at random, what gathering refuses, and the same bytes
//! whatever the order, the ranges and the threads. From clusters and on a full disk: tests/peers/cases.rs.

use serde_json::Value;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;
use studies::cases::crash_points::{STEPS, VARIABLE};
use studies::cases::kinds::Cell;
use studies::cases::shard::{Reader, Writer};
use studies::cases::study::Study;
use tests::study::{gathered, here, noop, refusal, ridge_cases, run, said, submitted, text, worker};
use tests::waiting::pause;
use tests::{muprime, rounds, texts};

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
        let there = out.join("shards/0000/000000000000-000000000040.parquet").exists();
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
            pause(Duration::from_millis(random(120)));
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
fn folders_of_shards_stay_small() {
    let folder = tempfile::tempdir().unwrap();
    for (cases, step) in [(2_500, 1), (100_000_000, 400)] {
        let study =
            Study::begin(&noop(folder.path(), cases, 0), &folder.path().join(cases.to_string())).unwrap();
        let mut count = std::collections::BTreeMap::new();
        for start in (0..cases).step_by(step as usize) {
            let place = study.shard(&(start..start + step));
            *count.entry(place.parent().unwrap().to_path_buf()).or_insert(0) += 1;
        }
        assert!(count.len() <= 1000 && count.values().all(|n| *n <= 1000), "{} folders", count.len());
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
    let changed = |to: &Path, facts: &[(&str, &str)], change: &dyn Fn(&mut studies::cases::run::Entry)| {
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
    // So does the documented way to go on, which read names alone.
    std::fs::remove_file(&table).unwrap();
    std::fs::write(&whole, &kept[..kept.len() / 2]).unwrap();
    assert!(refused().contains("sets it aside"));
    let plan = said(&["submit", text(&cases), "--out", text(&out), "--plan", "--case-s", "0.001"]);
    assert_eq!(plan["missing"], 5, "{plan}");
    submitted(&cases, &out, &[]);
    assert_eq!(gathered(&out), wanted);
    let moved = folder.path().join("moved.jsonl");
    std::fs::rename(&cases, &moved).unwrap();
    assert!(refusal(&["gather", text(&out)]).contains("is gone help: --cases FILE"));
    assert_eq!(said(&["gather", text(&out), "--cases", text(&moved)])["sha256"], wanted);
    std::fs::rename(&moved, &cases).unwrap();
    // Another study does not get into the folder, and results of changed inputs are not taken for those that are there.
    let other = noop(&folder.path().canonicalize().unwrap(), 31, 0);
    let why = refusal(&["case", "--cases", text(&other), "--out", text(&out), "--index", "0"]);
    assert!(why.contains("results of two studies do not mix"), "{why}");
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
    let (kept, shards) = (std::fs::read(&surrogate).unwrap(), out.join("round-000/shards/0000"));
    let made = || {
        std::fs::read_dir(&shards).unwrap().map(|e| e.unwrap().metadata().unwrap().modified().unwrap()).max()
    };
    let before = made();
    assert_eq!(said(&words), found);
    assert_eq!((std::fs::read(&surrogate).unwrap(), made()), (kept, before));
}

/// Standard output was empty, though a program waits for a document there.
#[test]
fn ctrl_c_leaves_a_document_that_says_that_it_is_partial() {
    let folder = tempfile::tempdir().unwrap();
    let (file, out) = (folder.path().join("cases.jsonl"), folder.path().join("out").display().to_string());
    ridge_cases(&file, 4000);
    let cases = text(&file);
    let all = [
        vec!["submit", cases, "--out", &out, "--case-s", "1"],
        vec!["model", "patch"],
        vec!["model", "stiffness", "--survey"],
        vec!["model", "reproduce", "fig9", "--out", &out],
    ];
    for args in all {
        let mut command = muprime();
        let child =
            command.args(&args).arg("--json").stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        let status = format!("/proc/{}/status", child.id());
        // Once the program listens for SIGINT, the second of the signals that it catches.
        let listens = || {
            let facts = std::fs::read_to_string(&status).unwrap();
            let caught = facts.lines().find_map(|line| line.strip_prefix("SigCgt:")).unwrap();
            u64::from_str_radix(caught.trim(), 16).unwrap() & 2 != 0
        };
        while !listens() {
            pause(Duration::from_millis(10));
        }
        assert!(run(Command::new("kill").args(["-INT", &child.id().to_string()])).status.success());
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(130), "{args:?}");
        let document: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(document["partial"], true, "{args:?}: {document}");
    }
}

/// A study without one result ended with 0, and was said to have all of them.
#[test]
fn a_study_whose_cases_all_fail_is_a_failure_and_a_variable_stated_twice_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let asked = |args: &[&str]| {
        let output = muprime().args(args).arg("--json").output().unwrap();
        (output.status.code(), serde_json::from_slice::<Value>(&output.stdout).unwrap())
    };
    std::fs::write(at("twice.csv"), "mu0,mu0\n0.4,0.5\n").unwrap();
    std::fs::write(at("once.csv"), "mu0\n0.4\n").unwrap();
    let (twice, once) = (at("twice.csv"), at("once.csv"));
    for wrong in [
        &["--draw", "3", "--span", "mu0=0.3..0.5", "--span", "mu0=0.4..0.6"][..],
        &["--draw", "3", "--span", "mu0=0.3..0.5", "--set", "mu0=0.4"],
        &["--draw", "3", "--span", "amplitude_pp_m=0.3..5"],
        &["--from", &twice],
        &["--from", &once, "--set", "mu0=0.5"],
    ] {
        let (status, document) = asked(&[&["cases", "ridge", "-o", &at("cases.jsonl")], wrong].concat());
        assert!(status == Some(2) && document["help"].is_string(), "{wrong:?}: {document}");
    }
    let file = at("cases.jsonl");
    assert_eq!(asked(&["cases", "ridge", "-o", &file, "--draw", "2", "--span", "mu0=0.3..0.5"]).0, Some(0));
    // As a study of an earlier version has it: beyond what a ridge can have.
    let text = std::fs::read_to_string(&file).unwrap().replace("0.3", "30").replace("0.5", "50");
    std::fs::write(&file, text).unwrap();
    let (status, document) = asked(&["submit", &file, "--out", &at("study"), "--case-s", "1"]);
    assert_eq!(
        (status, &document["failed"], &document["missing"]),
        (Some(1), &2.into(), &0.into()),
        "{document}"
    );
}

/// Submitting again said that all is there, with the results of the table before.
#[test]
fn a_table_that_was_changed_since_is_no_complete_study() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let swept = run(muprime().args(["run", "--fast", "--setup", "virtual-ideal", "--out", text(&at("r"))]));
    assert!(swept.status.success(), "{:?}", texts(&swept));
    let (cases, out) = (at("c.jsonl"), at("study"));
    said(&["cases", "diagnose", text(&at("r")), "--no-pairs", "-o", text(&cases)]);
    submitted(&cases, &out, &["--case-s", "2"]);
    let table = at("r/points.csv");
    let points = std::fs::read_to_string(&table).unwrap();
    let fewer: String = points.split_inclusive('\n').take(points.lines().count() - 2).collect();
    std::fs::write(&table, fewer).unwrap();
    let share = ["case", "--cases", text(&cases), "--out", text(&out), "--task", "0", "--of", "1"];
    for again in [&["submit", text(&cases), "--out", text(&out)][..], &share] {
        let why = refusal(again);
        assert!(why.contains("is of other cases than those of") && why.contains("help: the cases"), "{why}");
    }
    std::fs::write(&table, points).unwrap();
    assert_eq!(submitted(&cases, &out, &[])["missing"], 0);
}
