//! What is kept of a run, and what is said of it: files that vanish or lock in the middle, disks that fill at the end, readers
//! that go away, runs that are taken up again or were finished before, refusals that leave nothing behind.

use runs::job::{Job, Signals, Update};
use runs::{Plan, Setup};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use tests::waiting::{self, now_unix_s};
use tests::{documents, file, muprime, served, texts};

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

#[test]
fn the_same_command_on_a_finished_run_says_so_and_touches_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let (plan, out) = (plan(folder.path(), 2), folder.path().join("run"));
    for clock in [Some("--fast"), None] {
        let again = |n: u32| {
            let output =
                sweep(&plan, &out).args(if n == 0 { Some("--fast") } else { clock }).output().unwrap();
            assert_eq!(output.status.code(), Some(0), "{}", texts(&output).1);
            documents(&output).pop().unwrap()["summary"].clone()
        };
        let first = again(0);
        let files = |out: &Path| {
            let entries = std::fs::read_dir(out).unwrap().map(|e| e.unwrap().path());
            let mut all: Vec<_> = entries.map(|p| (p.clone(), std::fs::read(&p).unwrap())).collect();
            all.retain(|(path, _)| !path.ends_with(".lock"));
            all.sort();
            all
        };
        let before = files(&out);
        let second = again(1);
        assert!(files(&out) == before, "a finished run was changed");
        assert_eq!((&first["outcome"], &second["outcome"]), (&"complete".into(), &"complete".into()));
        assert_eq!(second["finished_before"], true);
        let said = sweep(&plan, &out).output().unwrap();
        assert!(!documents(&said).iter().any(|d| d["event"]["event"] == "armed"), "nothing is armed");
    }
}

#[test]
fn runs_in_virtual_time_are_catalogued_when_they_were_made() {
    let folder = tempfile::tempdir().unwrap();
    let plan = plan(folder.path(), 1);
    let before = now_unix_s();
    for name in ["b", "a"] {
        assert_eq!(sweep(&plan, &folder.path().join(name)).arg("--fast").status().unwrap().code(), Some(0));
    }
    let record = |name: &str| std::fs::read(folder.path().join(name).join("run-1.mcap")).unwrap();
    assert!(record("a") == record("b"), "the records are the same, byte for byte");
    let runs = muprime().args(["--json", "runs", "--folder"]).arg(folder.path()).output().unwrap();
    let runs = documents(&runs).remove(0);
    let started = |i: usize| runs[i]["started_unix_s"].as_f64().unwrap();
    assert!(started(0) <= now_unix_s() && started(1) >= before - 1.0, "{runs}");
    assert_eq!((&runs[0]["folder"], &runs[1]["folder"]), (&"a".into(), &"b".into()), "newest first");
}

#[test]
fn a_run_that_was_copied_in_is_listed_and_one_without_a_summary_has_no_ending() {
    let folder = tempfile::tempdir().unwrap();
    let (plan, made) = (plan(folder.path(), 2), folder.path().join("elsewhere/made"));
    assert_eq!(sweep(&plan, &made).arg("--fast").status().unwrap().code(), Some(0));
    let runs = folder.path().join("runs");
    let list = || {
        let output = muprime().args(["--json", "runs", "--folder"]).arg(&runs).output().unwrap();
        (output.status.code(), documents(&output).pop())
    };
    std::fs::create_dir(&runs).unwrap();
    assert_eq!(list().0, Some(2), "a folder without a run is refused");
    for name in ["copied", "killed"] {
        std::fs::create_dir(runs.join(name)).unwrap();
        for file in std::fs::read_dir(&made).unwrap().map(|file| file.unwrap()) {
            std::fs::copy(file.path(), runs.join(name).join(file.file_name())).unwrap();
        }
    }
    std::fs::remove_file(runs.join("killed/summary.json")).unwrap();
    let listed = list().1.unwrap();
    for (i, (name, outcome)) in [("killed", ""), ("copied", "complete")].into_iter().enumerate() {
        let run = &listed[i];
        assert_eq!((&run["folder"], &run["outcome"]), (&name.into(), &outcome.into()), "{listed}");
        assert_eq!((&run["plan"], &run["setup"]), (&"keeping".into(), &listed[0]["setup"]), "{listed}");
        let passes = points(&made).len();
        assert_eq!((&run["passes"], &run["planned"]), (&passes.into(), &passes.into()), "{listed}");
    }
}

/// The offset drift of the virtual rig, measured in one go and in two sessions: named in both.
#[test]
fn a_drift_is_named_when_the_run_was_stopped_and_taken_up_again() {
    const DRIFT: &str = "[[defect]]\nname = \"lateral_offset_drift\"\nparameters = { end_n = 0.02, start_over_end = -0.5, time_s = 40 }\n";
    let folder = tempfile::tempdir().unwrap();
    let run = |name: &str, stop_after: &[usize]| {
        let out = folder.path().join(name);
        for stop in stop_after.iter().copied().map(Some).chain([None]) {
            let setup = Setup::load("virtual-ideal").unwrap();
            let model = Arc::new(models::prediction::SpringSlider::new(setup.tip.finger).unwrap());
            let defects = Some(sim::defects::Defects::parse(DRIFT).unwrap());
            let plan = Plan::load("first-sweep").unwrap();
            let job = Job {
                seed: 11,
                setup,
                plan,
                model,
                model_file: None,
                defects,
                out: out.clone(),
                fast: true,
                notes: Default::default(),
                answers: None,
            };
            let (signals, mut made) = (Signals::default(), 0);
            let stops = Arc::clone(&signals.stops);
            rig::wall_clock_run::run(job, &signals, &mut |update| {
                made += usize::from(matches!(update, Update::Pass(_)));
                if stop == Some(made) {
                    stops.store(1, Ordering::Relaxed);
                }
            })
            .unwrap();
        }
        let table = std::fs::File::open(out.join("points.csv")).unwrap();
        let passes = models::pass::read_passes(table).unwrap();
        assert_eq!(passes.len(), 98);
        assert!(passes.is_sorted_by_key(|p| p.time_s), "the run's time goes on");
        let sessions: Vec<u64> = passes.iter().map(|p| p.session.unwrap()).collect();
        assert!(
            sessions.is_sorted() && sessions.last() == Some(&(stop_after.len() as u64 + 1)),
            "{sessions:?}"
        );
        for session in 1..=stop_after.len() + 1 {
            let record = std::fs::read(out.join(format!("run-{session}.mcap"))).unwrap();
            assert!(tests::contents::complete(&tests::contents::read(&record).integrity));
        }
        let replayed = muprime().arg("replay").arg(&out).output().unwrap();
        assert_eq!(replayed.status.code(), Some(0), "{}", texts(&replayed).0);
        let verdict = muprime().args(["--json", "diagnose"]).arg(&out).output().unwrap();
        let verdict = documents(&verdict).remove(0);
        verdict["verdict"].to_string() + &verdict["hypotheses"][0].to_string()
    };
    for verdict in [run("whole", &[]), run("resumed", &[45]), run("twice", &[20, 30])] {
        assert!(verdict.contains("lateral_offset_drift"), "{verdict}");
    }
}

#[test]
fn a_refusal_leaves_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    let plan = plan(folder.path(), 1);
    let setup = folder.path().join("setup.toml");
    // Nobody listens at the discard port.
    std::fs::write(&setup, served::setup("nobody", "127.0.0.1:9".parse().unwrap())).unwrap();
    let out = folder.path().join("runs/deep/r");
    let output =
        muprime().arg("run").arg(&plan).arg("--setup").arg(&setup).arg("--out").arg(&out).output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", texts(&output).1);
    assert!(!folder.path().join("runs").exists(), "a refusal left folders");
    // A run that is there stays as it is.
    let made = sweep(&plan, &out).arg("--fast").output().unwrap();
    assert_eq!(made.status.code(), Some(0), "{}", texts(&made).1);
    let mut refused = muprime();
    refused
        .args(["run", "--fast", "--setup", "virtual-ideal", "--seed", "99"])
        .arg(&plan)
        .arg("--out")
        .arg(&out);
    assert_eq!(refused.output().unwrap().status.code(), Some(2));
    assert!(out.join("points.csv").exists());
    for verb in ["watch", "runs"] {
        let output = muprime().arg(verb).env("MUPRIME_RUNS", folder.path().join("none")).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{verb}");
        assert!(!folder.path().join("none").exists(), "{verb} left a folder");
    }
}

#[test]
fn names_that_are_no_text_and_files_that_are_none_are_refused_at_once() {
    use std::os::unix::ffi::OsStringExt;
    let folder = tempfile::tempdir().unwrap();
    let name = std::ffi::OsString::from_vec(b"r\xff".to_vec());
    let output = muprime().args(["run", "--fast", "--out"]).arg(folder.path().join(&name)).output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", texts(&output).1);
    assert!(texts(&output).1.contains("UTF-8") && std::fs::read_dir(folder.path()).unwrap().next().is_none());

    let pipe = folder.path().join("pipe");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let pipe = pipe.to_str().unwrap();
    let cases = [
        ["check", "/dev/zero"].as_slice(),
        &["check", pipe],
        &["check", "/"],
        &["run", pipe],
        &["run", "--setup", "/dev/zero"],
        &["run", "--model", pipe],
        &["diagnose", pipe, "--rig", pipe],
        &["recover", pipe],
    ];
    for case in cases {
        let mut child = muprime().args(case).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        let status = waiting::end_of(&format!("{case:?}"), &mut child).code();
        assert_eq!(status, Some(2), "{case:?}");
    }
}

#[test]
fn a_huge_plan_is_refused_by_check_as_by_run() {
    let folder = tempfile::tempdir().unwrap();
    let plan = folder.path().join("huge.toml");
    let list = |step: f64| format!("{:?}", (1..=3000).map(|n| f64::from(n) * step).collect::<Vec<_>>());
    let text = served::plan("huge", 0, &[1e-6])
        + &format!("speed_m_s = {}\nposition_m = {}\n", list(1e-5), list(1e-6));
    std::fs::write(&plan, text).unwrap();
    for verb in ["check", "run"] {
        let output = muprime().arg(verb).arg(&plan).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{verb}: {}", texts(&output).1);
        assert!(texts(&output).1.contains("18000000 passes"), "{verb}: {}", texts(&output).1);
    }
}

/// One bit in the middle of a record: whoever looks at the run is told, with the place and the cycles that are missing.
#[test]
fn one_flipped_bit_is_told_by_replay_report_recover_and_diagnose() {
    let folder = tempfile::tempdir().unwrap();
    let (plan, out) = (plan(folder.path(), 6), folder.path().join("run"));
    assert_eq!(sweep(&plan, &out).arg("--fast").output().unwrap().status.code(), Some(0));
    let record = out.join("run-1.mcap");
    let ask = |verb: &[&str], of: &Path| {
        let output = muprime().arg("--json").args(verb).arg(of).output().unwrap();
        (output.status.code(), documents(&output).remove(0))
    };
    for verb in ["replay", "report", "diagnose"] {
        let (status, said) = ask(&[verb], &out);
        assert_eq!(status, Some(0), "{verb}: {said}");
        assert!(said.get("damage").is_none_or(|d| d.as_array().is_some_and(Vec::is_empty)), "{verb}: {said}");
    }
    let mut bytes = std::fs::read(&record).unwrap();
    // Within the messages of a chunk: behind the name of its compression.
    let half = bytes.len() / 2;
    let middle = half + 100 + bytes[half..].windows(3).position(|w| w == b"lz4").unwrap();
    bytes[middle] ^= 1;
    std::fs::write(&record, &bytes).unwrap();
    let (status, replay) = ask(&["replay"], &out);
    assert_eq!((status, &replay["holds"]), (Some(1), &false.into()));
    let missing = replay["integrity"]["missing"]["/cycle"].as_u64().unwrap();
    assert!(missing > 0 && replay["replay"]["missing"] == missing, "{replay}");
    let place = &replay["integrity"]["places"][0];
    assert!(
        place["from"].as_u64().unwrap() <= middle as u64 && place["to"].as_u64().unwrap() > middle as u64
    );
    let words = format!("{missing} cycles are missing");
    for verb in ["report", "diagnose"] {
        let said = ask(&[verb], &out).1["damage"].to_string();
        assert!(said.contains("run-1.mcap: bytes") && said.contains(&words), "{verb}: {said}");
    }
    assert!(std::fs::read_to_string(out.join("report.html")).unwrap().contains(&words));
    let (status, recovered) = ask(&["recover"], &record);
    assert_eq!((status, &recovered["recovered"], &recovered["damaged"]), (Some(0), &true.into(), &1.into()));
    assert!(recovered["because"].as_str().unwrap().contains(&words), "{recovered}");
    let (status, after) = ask(&["replay"], &out);
    assert_eq!((status, &after["integrity"]["missing"]["/cycle"]), (Some(1), &missing.into()), "{after}");
    assert_eq!(after["replay"]["cycles"], replay["replay"]["cycles"], "every other cycle is kept");
    assert_eq!(std::fs::read(out.join("run-1.mcap.original")).unwrap(), bytes);
    // A pass that was changed by hand, or by the disk.
    let table = std::fs::read_to_string(out.join("points.csv")).unwrap();
    std::fs::write(out.join("points.csv"), table.replacen("27500", "27600", 1)).unwrap();
    assert!(ask(&["report"], &out).1["damage"].to_string().contains("points.csv and passes.jsonl differ"));
    // The run was said to be complete.
    let again = sweep(&plan, &out).arg("--fast").output().unwrap();
    assert_eq!(again.status.code(), Some(2), "{}", texts(&again).1);
    let error = documents(&again).pop().unwrap()["error"].to_string();
    assert!(error.contains("points.csv and passes.jsonl differ: one of them was changed"), "{error}");
    std::fs::remove_file(out.join("points.csv")).unwrap();
    assert_eq!(sweep(&plan, &out).arg("--fast").output().unwrap().status.code(), Some(0));
    assert_eq!(std::fs::read_to_string(out.join("points.csv")).unwrap(), table);
}

/// A record that was cut and recovered was called a failure, though every cycle in it agrees.
#[test]
fn the_replay_of_a_cut_record_holds_once_it_is_recovered() {
    let folder = tempfile::tempdir().unwrap();
    let (plan, out) = (plan(folder.path(), 2), folder.path().join("run"));
    assert_eq!(sweep(&plan, &out).arg("--fast").output().unwrap().status.code(), Some(0));
    let record = out.join("run-1.mcap");
    let bytes = std::fs::read(&record).unwrap();
    std::fs::write(&record, &bytes[..bytes.len() / 2]).unwrap();
    let replayed = || muprime().args(["--json", "replay"]).arg(&record).output().unwrap();
    assert_eq!(replayed().status.code(), Some(1));
    let recovered = || muprime().arg("recover").arg(&record).output().unwrap().status.code();
    assert_eq!(recovered(), Some(0));
    // What is whole needs no lock: it was refused where the folder takes none, as one that cannot be written.
    std::fs::remove_file(out.join(runs::run_dir::LOCK)).unwrap();
    std::fs::create_dir(out.join(runs::run_dir::LOCK)).unwrap();
    assert_eq!(recovered(), Some(0));
    let (status, found) = (replayed().status.code(), documents(&replayed()).remove(0));
    assert_eq!((status, &found["holds"]), (Some(0), &true.into()), "{found}");
    assert!(found["integrity"]["recovered"].as_str().unwrap().contains("is cut"), "{found}");
    assert_eq!(found["replay"]["equal"], found["replay"]["cycles"]);
}

/// A table that is cut, empty or gone: every command says so, and the same command puts every pass back and
/// drives none.
#[test]
fn a_table_that_lost_passes_is_told_and_written_again_from_the_journal() {
    let folder = tempfile::tempdir().unwrap();
    let (plan, out) = (plan(folder.path(), 2), folder.path().join("run"));
    assert_eq!(sweep(&plan, &out).arg("--fast").output().unwrap().status.code(), Some(0));
    let (table, record) = (out.join("points.csv"), out.join("run-1.mcap"));
    let whole = std::fs::read_to_string(&table).unwrap();
    let lines: Vec<&str> = whole.split_inclusive('\n').collect();
    let lost = format!("{} passes of passes.jsonl are not in points.csv", lines.len() - 3);
    let ask = |words: &[&str]| muprime().arg("--json").args(words).arg(&out).output().unwrap();
    for left in [lines[..3].concat(), lines[0][..9].to_string(), String::new()] {
        std::fs::write(&table, &left).unwrap();
        if !left.is_empty() && left.len() > lines[0].len() {
            for words in [&["report"][..], &["export", "--to", "csv"]] {
                assert!(documents(&ask(words))[0]["damage"].to_string().contains(&lost), "{words:?}");
            }
            let checked = ask(&["check", "--offline"]);
            let said = documents(&checked).remove(0);
            assert_eq!(checked.status.code(), Some(2), "{said}");
            assert_eq!(said["problem"].as_str().unwrap().matches(&lost).count(), 1, "{said}");
            assert!(said["help"].as_str().unwrap().contains("repeat the command"), "{said}");
        }
        if left.is_empty() {
            std::fs::remove_file(&table).unwrap();
            let said = texts(&ask(&["report"])).1;
            assert!(said.contains("points.csv is missing") && said.contains("repeat the command"), "{said}");
            assert!(!said.contains("holds no run"), "{said}");
        }
        let again = sweep(&plan, &out).output().unwrap();
        assert_eq!(again.status.code(), Some(0), "{}", texts(&again).1);
        assert!(!documents(&again).iter().any(|d| d["event"]["event"] == "armed"), "nothing is driven again");
        assert!(
            texts(&again).1.contains("of passes.jsonl were not in points.csv and are put back"),
            "{}",
            texts(&again).1
        );
        assert_eq!(std::fs::read_to_string(&table).unwrap(), whole);
        assert!(record.exists() && !out.join("run-2.mcap").exists());
    }
    // The other way round nobody knows which of the two holds.
    let journal = std::fs::read_to_string(out.join("passes.jsonl")).unwrap();
    std::fs::write(out.join("passes.jsonl"), journal.split_inclusive('\n').take(2).collect::<String>())
        .unwrap();
    let refused = sweep(&plan, &out).output().unwrap();
    let said = texts(&refused).1;
    assert_eq!(refused.status.code(), Some(2), "{said}");
    assert!(
        said.contains("points.csv") && said.contains("passes.jsonl") && said.contains("a copy"),
        "{said}"
    );
    assert_eq!(std::fs::read_to_string(&table).unwrap(), whole);
}

/// What a run is of belongs to all of its passes: a session with another operator or sample is refused.
#[test]
fn another_sample_or_operator_does_not_take_over_a_run() {
    let folder = tempfile::tempdir().unwrap();
    let (plan, out) = (plan(folder.path(), 1), folder.path().join("run"));
    let with = |words: &[&str]| sweep(&plan, &out).arg("--fast").args(words).output().unwrap();
    let told = texts(&with(&["--licence", "free for all"])).1;
    assert!(told.contains("SPDX") && !out.exists(), "{told}");
    let first = with(&["--operator", "Ada", "--sample", "tip 3"]);
    assert_eq!(first.status.code(), Some(0), "{}", texts(&first).1);
    let before = std::fs::read(out.join("run.toml")).unwrap();
    for (option, other, was) in [("--operator", "Bob", "Ada"), ("--sample", "tip 4", "tip 3")] {
        let refused = with(&[option, other]);
        let said = texts(&refused).1;
        assert_eq!(refused.status.code(), Some(2), "{said}");
        assert!(said.contains(other) && said.contains(was) && said.contains("--out"), "{said}");
    }
    // Whose exposure was counted for the operator has no other subject afterwards.
    for (words, was) in [(["--subject", "P7"], "Ada"), (["--operator", "Bob"], "Ada")] {
        assert!(texts(&with(&words)).1.contains(&format!("'{was}'")), "{words:?}");
    }
    assert_eq!(with(&["--sample", "tip 3", "--subject", "Ada"]).status.code(), Some(0));
    assert_eq!(std::fs::read(out.join("run.toml")).unwrap(), before);
    // What was not stated of its passes is not stated afterwards.
    let unnamed = folder.path().join("unnamed");
    assert_eq!(sweep(&plan, &unnamed).arg("--fast").status().unwrap().code(), Some(0));
    let refused = sweep(&plan, &unnamed).args(["--fast", "--operator", "Bob"]).output().unwrap();
    assert!(
        refused.status.code() == Some(2) && texts(&refused).1.contains("--operator away"),
        "{}",
        texts(&refused).1
    );
}

/// Another tip, target or set of defects took up a run, and it was stated as one.
#[test]
fn a_run_is_not_taken_up_with_another_tip_target_or_set_of_defects() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let ideal = tests::setup("virtual-ideal").text;
    std::fs::write(at("setup.toml"), ideal.replacen("\"artificial-silicone\"", "\"tip.toml\"", 1)).unwrap();
    std::fs::write(at("tip.toml"), runs::fingertip::BUNDLED[0].1).unwrap();
    let target = "[render]\ntarget = \"table\"\nfile = \"target.csv\"\n[[series]]\nname = \"r\"\n";
    let text =
        tests::SHORT.split("[[series]]").next().unwrap().replace("measure_s = 0.1", "measure_m = 0.01");
    std::fs::write(at("plan.toml"), text + target).unwrap();
    std::fs::write(at("target.csv"), "x_m,mu_relative\n-0.02,0.8\n0.02,0.9\n").unwrap();
    std::fs::write(at("defects.toml"), "[[defect]]\nname = \"plate_tilt\"\nseed = 1\n").unwrap();
    let run = || {
        let mut command = muprime();
        command.current_dir(folder.path()).args(["run", "plan.toml", "--fast", "--setup", "setup.toml"]);
        let output = command.args(["--defects", "defects.toml", "--out", "run"]).output().unwrap();
        (output.status.code(), texts(&output).1)
    };
    let (status, told) = run();
    assert_eq!(status, Some(0), "{told}");
    let before = std::fs::read(at("run/rig.toml")).unwrap();
    for (file, from, to, what) in [
        ("tip.toml", "3.9e6", "2.9e6", "another setup"),
        ("target.csv", "0.8", "0.7", "another plan"),
        ("defects.toml", "seed = 1", "seed = 2", "another set of defects"),
    ] {
        let was = std::fs::read_to_string(at(file)).unwrap();
        std::fs::write(at(file), was.replacen(from, to, 1)).unwrap();
        let (status, told) = run();
        assert!(status == Some(2) && told.contains(what), "{file}: {status:?} {told}");
        std::fs::write(at(file), was).unwrap();
    }
    assert_eq!(std::fs::read(at("run/rig.toml")).unwrap(), before);
    let (status, told) = run();
    assert!(status == Some(0) && told.contains("already complete"), "{told}");
}

/// Two runs that began in one second shared a folder: the second measured nothing, and ended well. The name
/// of a plan led out of the folder of runs.
#[test]
fn runs_without_a_folder_of_their_own_get_one_each() {
    let folder = tempfile::tempdir().unwrap();
    let plan = folder.path().join("plan.toml");
    std::fs::write(&plan, served::plan("w/f ../x", 0, &[2e-6])).unwrap();
    let run = |arguments: &[&str]| {
        let mut command = muprime();
        command.args(["--json", "run", "--fast", "--setup", "virtual-ideal"]).arg(&plan).args(arguments);
        command.env("MUPRIME_RUNS", folder.path().join("runs")).current_dir(folder.path()).output().unwrap()
    };
    // A refusal leaves nothing behind.
    assert_eq!(run(&["--model", "none"]).status.code(), Some(2));
    assert!(!folder.path().join("runs").exists());
    let mut taken = BTreeSet::new();
    for _ in 0..3 {
        let output = run(&[]);
        let last = documents(&output).pop().unwrap();
        assert_eq!(last["summary"]["finished_before"], false, "{last}");
        let made = PathBuf::from(last["summary"]["folder"].as_str().unwrap());
        assert_eq!(made.parent(), Some(&*folder.path().join("runs")), "{made:?}");
        assert!(taken.insert(made));
    }
}

/// `recover` replaced the record of a living run under its writer: the sweep stopped.
#[test]
fn the_record_of_a_living_run_is_left_alone_and_is_not_called_cut() {
    let folder = tempfile::tempdir().unwrap();
    let (plan, out) = (plan(folder.path(), 1), folder.path().join("run"));
    assert_eq!(sweep(&plan, &out).arg("--fast").status().unwrap().code(), Some(0));
    // As the folder of a run that is still going.
    let (record, lock) = (out.join("run-1.mcap"), runs::run_dir::claim(&out.join(".lock")).unwrap());
    let whole = std::fs::read(&record).unwrap();
    std::fs::write(&record, &whole[..whole.len() - 100]).unwrap();
    std::fs::remove_file(out.join("summary.json")).unwrap();
    let call = |verb: &str, on: &Path| {
        let output = muprime().arg(verb).arg(on).output().unwrap();
        (output.status.code(), texts(&output).0 + &texts(&output).1)
    };
    let (status, told) = call("recover", &record);
    assert!(status == Some(2) && told.contains("live"), "{told}");
    assert_eq!(std::fs::read(&record).unwrap().len(), whole.len() - 100);
    let (_, told) = call("report", &out);
    let page = std::fs::read_to_string(out.join("report.html")).unwrap();
    assert!(!told.contains("cut") && !page.contains("the record is cut"), "{told}");
    drop(lock);
    let (_, told) = call("report", &out);
    assert!(told.contains("the record is cut"), "{told}");
    // A run that was killed and mended could never pass its check again.
    assert_eq!(call("check", &out).0, Some(2));
    assert_eq!(call("recover", &record).0, Some(0));
    let (status, told) = call("check", &out);
    assert!(status == Some(0) && told.contains("was made whole by"), "{told}");
}

/// A full disk behind standard output cut it, and the status was 0.
#[test]
fn standard_output_that_cannot_be_written_ends_with_1() {
    let folder = tempfile::tempdir().unwrap();
    let (plan, out) = (plan(folder.path(), 1), folder.path().join("run"));
    let (plan, out) = (plan.to_str().unwrap(), out.to_str().unwrap());
    let full = |arguments: &[&str]| {
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let output = muprime().args(arguments).stdout(full).output().unwrap();
        (output.status.code(), texts(&output).1)
    };
    for arguments in [
        &["--help"][..],
        &["--version"],
        &["schema", "plan"],
        &["--json", "run", plan, "--fast", "--setup", "virtual-ideal", "--out", out],
    ] {
        let (status, told) = full(arguments);
        assert!(
            status == Some(1) && told.contains("standard output could not be written"),
            "{arguments:?}: {told}"
        );
    }
    assert_eq!(full(&["--json", "check", "/dev/null/nothing"]).0, Some(2));
}

/// A name that belongs to another file, or to another output: refused before any work, and nothing is
/// replaced.
#[test]
fn no_output_takes_the_place_of_a_file_of_another_kind() {
    let folder = tempfile::tempdir().unwrap();
    let (plan, out) = (plan(folder.path(), 6), folder.path().join("run"));
    assert_eq!(sweep(&plan, &out).arg("--fast").output().unwrap().status.code(), Some(0));
    let script = folder.path().join("analysis.py");
    std::fs::write(&script, "import muprime\n").unwrap();
    let (mine, run) = (script.to_str().unwrap(), out.to_str().unwrap());
    let record = out.join("run-1.mcap");
    let before = std::fs::read(&record).unwrap();
    let refused = |words: &[&str], because: &str| {
        let output = muprime().args(words).current_dir(folder.path()).output().unwrap();
        let said = texts(&output).1;
        assert!(output.status.code() == Some(2) && said.contains(because), "{words:?}: {said}");
        assert_eq!(std::fs::read_to_string(&script).unwrap(), "import muprime\n", "{words:?}");
        assert!(std::fs::read(&record).unwrap() == before, "{words:?}");
    };
    for format in ["csv", "mcap"] {
        refused(&["export", run, "--to", format, "--out", mine], "no earlier output of this kind");
        refused(&["export", run, "--to", format, "--out", record.to_str().unwrap()], "session's record");
    }
    refused(&["report", run, "--out", record.to_str().unwrap()], "session's record");
    refused(
        &["cases", "noop", "--cases", "3", "--hashes", "0", "-o", mine],
        "no earlier output of this kind",
    );
    refused(&["blind", "--sets", "1", "--write", mine], "not an empty folder");
    refused(&["blind", "--sets", "1", "--write", run], "not an empty folder");
    refused(&["diagnose", run, "--save-plan", mine], "no earlier output of this kind");
    refused(&["diagnose", run, "--save-model", "x", "--report", "./x"], "place of --save-model");
    refused(&["blind", "--sets", "0"], "0 is not in");
    refused(&["faults", "--seeds", "0"], "0 is not in");
    // Its own earlier output is replaced.
    for words in [&["export", run, "--to", "mcap"][..], &["cases", "noop", "--cases", "3", "-o", "c.jsonl"]] {
        for _ in 0..2 {
            let output = muprime().args(words).current_dir(folder.path()).output().unwrap();
            assert_eq!(output.status.code(), Some(0), "{words:?}: {}", texts(&output).1);
        }
    }
    // A pipe stays one, a link too, and what it leads to is the new export.
    let (pipe, link) = (folder.path().join("pipe"), folder.path().join("link"));
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    refused(&["export", run, "--to", "mcap", "--out", pipe.to_str().unwrap()], "a pipe or a device");
    assert!(!pipe.metadata().unwrap().is_file() && !folder.path().join("pipe.new").exists());
    std::fs::write(folder.path().join("earlier"), "").unwrap();
    std::os::unix::fs::symlink("earlier", &link).unwrap();
    let output = muprime().args(["export", run, "--to", "mcap", "--out"]).arg(&link).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", texts(&output).1);
    assert!(link.is_symlink() && folder.path().join("earlier").metadata().unwrap().len() > 0);
    // Of a record that is cut, the export holds fewer passes than the run, and says so.
    std::fs::write(&record, &before[..before.len() / 2]).unwrap();
    let output = muprime().args(["--json", "export", run, "--to", "mcap"]).output().unwrap();
    let held = documents(&output)[0]["passes"].as_u64().unwrap() as usize;
    assert!(held > 0 && held < points(&out).len(), "{held} of {}", points(&out).len());
}

#[test]
fn a_reader_that_goes_away_ends_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let (plan, out) = (plan(folder.path(), 2), folder.path().join("run"));
    assert_eq!(sweep(&plan, &out).arg("--fast").output().unwrap().status.code(), Some(0));
    // Standard output and standard error are pipes that nobody reads any more.
    let deaf = |arguments: &[&str]| {
        let mut shell = Command::new("bash");
        shell.args(["-c", "exec 3> >(true); wait $!; exec \"$@\" >&3 2>&3", "bash"]);
        shell.arg(muprime().get_program()).args(arguments).status().unwrap().code()
    };
    let (run, record) = (out.to_str().unwrap(), out.join("run-1.mcap"));
    let (plan, record) = (plan.to_str().unwrap(), record.to_str().unwrap());
    for verb in [
        ["--help"].as_slice(),
        &["completions", "bash"],
        &["model", "effects"],
        &["model", "point"],
        &["replay", run],
        &["report", run],
        &["export", run, "--to", "csv"],
        &["recover", record],
        &["watch", run],
        &["check", plan],
        &["runs", "--folder", folder.path().to_str().unwrap()],
    ] {
        assert_eq!(deaf(verb), Some(0), "{verb:?}");
    }
    assert_eq!(deaf(&["check", "/dev/null/nothing"]), Some(2));
    // A sweep: all of it is made and kept. In wall-clock time: tests/wall/keeping.rs.
    let silent = folder.path().join("silent");
    assert_eq!(
        deaf(&["run", "--fast", "--setup", "virtual-ideal", plan, "--out", silent.to_str().unwrap()]),
        Some(0)
    );
    assert_eq!(points(&silent), points(&out));
}

#[test]
fn what_files_say_cannot_rewrite_a_terminal() {
    let folder = tempfile::tempdir().unwrap();
    let plan = plan(folder.path(), 1);
    let setup = folder.path().join("setup.toml");
    let text = std::fs::read_to_string(file("runs/setups/virtual-ideal.toml")).unwrap();
    let named = text.replacen("name = \"virtual-ideal\"", "name = \"a\\u001b[2Jb\\u009b1A\"", 1);
    assert_ne!(text, named);
    std::fs::write(&setup, named).unwrap();
    let out = folder.path().join("run");
    let output = muprime()
        .args(["run", "--fast", "--setup"])
        .arg(&setup)
        .arg(&plan)
        .arg("--out")
        .arg(&out)
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", texts(&output).1);
    let listed = muprime().args(["runs", "--folder"]).arg(folder.path()).output().unwrap();
    for said in [&output.stderr, &listed.stdout] {
        let text = String::from_utf8_lossy(said);
        assert!(
            !text.contains('\u{1b}') && !text.contains('\u{9b}') && text.contains("a\\u001b[2Jb\\u009b1A"),
            "{text}"
        );
    }
}
