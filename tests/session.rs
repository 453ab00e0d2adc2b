//! Whole runs of the real program in virtual time: sweeps, refusals, trips.

use std::collections::BTreeSet;
use std::io::{BufRead, BufReader};
use std::process::Stdio;
use tests::{SHORT, documents, file, muprime, served, short_plan, texts};

#[test]
fn in_virtual_time_equal_seeds_give_equal_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let plan = short_plan(folder.path());
    let run = |name: &str, seed: &str| {
        let out = folder.path().join(name);
        let status =
            muprime().args(["run", &plan, "--fast", "--seed", seed, "--out"]).arg(&out).output().unwrap();
        assert_eq!(status.status.code(), Some(0), "{}", texts(&status).1);
        (std::fs::read(out.join("run-1.mcap")).unwrap(), std::fs::read(out.join("points.csv")).unwrap())
    };
    let (first, again, other) = (run("a", "11"), run("b", "11"), run("c", "12"));
    assert!(first == again, "the same seed gives the same record");
    assert!(first.1 != other.1, "another seed gives another run");
}

/// The README's story in virtual time: the model leaves the measurement, the diagnosis says why, and the
/// corrected model agrees with sweeps of other seeds than it was made from.
#[test]
fn the_story_of_the_readme_ends_with_a_model_that_agrees() {
    let folder = tempfile::tempdir().unwrap();
    let said = |arguments: &[&str]| {
        let output = muprime().args(arguments).current_dir(folder.path()).output().unwrap();
        let (printed, told) = texts(&output);
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {told}");
        printed + &told
    };
    let first = said(&["run", "--fast", "--out", "first"]);
    assert!(first.contains("the measurement disagrees with the model"), "{first}");
    let verdict = said(&["diagnose", "first", "--save-model", "model.toml"]);
    assert!(verdict.starts_with("Most likely cause: squeeze film (probability 0.98"), "{verdict}");
    for seed in ["2", "3"] {
        let corrected = said(&["run", "--fast", "--model", "model.toml", "--seed", seed, "--out", seed]);
        assert!(corrected.contains("agrees with the model"), "{corrected}");
        let compared = said(&["compare", "first", seed]);
        assert!(compared.starts_with("no difference seen") && compared.contains("  model: "), "{compared}");
    }
    // What was measured does not depend on the model that it is compared with.
    let measured = |run: &str| -> Vec<String> {
        said(&["export", run, "--to", "csv", "--out", "table.csv"]);
        let text = std::fs::read_to_string(folder.path().join("table.csv")).unwrap();
        let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
        let at = rows[0].iter().position(|name| *name == "mu_relative").unwrap();
        std::fs::remove_file(folder.path().join("table.csv")).unwrap();
        rows[1..].iter().map(|row| row[at].to_string()).collect()
    };
    said(&["run", "--fast", "--model", "psi", "--out", "psi"]);
    let (first, psi) = (measured("first"), measured("psi"));
    assert!(first.iter().filter(|mu| !mu.is_empty()).count() > 80 && first == psi, "{first:?} {psi:?}");
    // The same sweep again is no second measurement, and another world is told from this one.
    said(&["run", "--fast", "--out", "again"]);
    let compared = said(&["compare", "first", "again"]);
    assert!(compared.contains("byte-identical") && compared.contains("cannot tell"), "{compared}");
    said(&["run", "--fast", "--setup", "virtual-ideal", "--seed", "5", "--out", "ideal"]);
    let compared = said(&["compare", "first", "ideal"]);
    assert!(compared.starts_with("the runs differ"), "{compared}");
}

/// A sweep of more passes than a pipe holds, killed after the first, the eleventh and the fortieth that it tells of, then left alone: nothing
/// that was acknowledged is lost, and no pass is made twice. It waits for its reader, so that each kill strikes it on its way.
#[test]
fn a_sweep_that_is_killed_resumes_without_a_lost_or_doubled_pass() {
    let folder = tempfile::tempdir().unwrap();
    let (plan, out) = (folder.path().join("plan.toml"), folder.path().join("run"));
    let amplitudes: Vec<f64> = (1..=400).map(|n| 1e-8 * f64::from(n)).collect();
    std::fs::write(&plan, served::plan("killed", 0, &amplitudes)).unwrap();
    let start = || {
        let mut sweep = muprime();
        sweep.args(["--json", "run", "--fast", "--setup", "virtual-ideal"]).arg(&plan).arg("--out").arg(&out);
        sweep.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap()
    };
    let mut acknowledged = BTreeSet::new();
    let mut sessions = 0;
    for kill_after in [1, 11, 40, usize::MAX] {
        let mut child = start();
        let (mut heard, mut complete) = (0, false);
        for line in BufReader::new(child.stdout.take().unwrap()).lines() {
            // The kill may cut the last line: then it acknowledged nothing.
            let Ok(said) = serde_json::from_str::<serde_json::Value>(&line.unwrap()) else { continue };
            complete |= said["summary"]["outcome"] == "complete";
            if let Some(pass) = said.get("pass") {
                acknowledged.insert(pass["pass"]["point"].as_u64().unwrap());
                heard += 1;
                if heard == kill_after {
                    child.kill().unwrap();
                }
            }
        }
        child.wait().unwrap();
        sessions += 1;
        assert_eq!(complete, kill_after == usize::MAX, "session {sessions}");
        let kept: Vec<u64> = runs::run_dir::passes_in(&out).unwrap().iter().map(|p| p.pass.point).collect();
        let unique: BTreeSet<u64> = kept.iter().copied().collect();
        assert_eq!(unique.len(), kept.len(), "session {sessions}: a pass is there twice");
        assert!(acknowledged.is_subset(&unique), "session {sessions}: {acknowledged:?} {unique:?}");
        assert!(!complete || unique == (0..800).collect(), "{unique:?}");
    }
    assert_eq!(runs::run_dir::records_in(&out).unwrap().len(), sessions);
}

/// What a trip means and what to do about it: on the terminal, in the summary and in the report.
#[test]
fn a_trip_is_told_with_its_unit_and_its_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let plan = short_plan(folder.path());
    let ideal = runs::setup::Setup::load("virtual-ideal").unwrap().text;
    // The load of the plan, and no more: its noise breaks the limit.
    let tight = ideal.replace("[limits]\n", "[limits]\nnormal_force_max_n = 0.25\n");
    let setup = folder.path().join("tight.toml");
    std::fs::write(&setup, tight).unwrap();
    let out = folder.path().join("run");
    let output = muprime()
        .args(["run", "--fast", &plan, "--setup"])
        .arg(&setup)
        .arg("--out")
        .arg(&out)
        .output()
        .unwrap();
    let (_, stderr) = texts(&output);
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    let remedy = realtime::safety::TripCause::NormalOverforce.remedy();
    let trip = stderr.lines().find(|line| line.starts_with("STOPPED for safety: ")).unwrap_or_default();
    assert!(
        trip.contains("the normal force is beyond its limit: 0.25") && trip.contains("[SR-04]"),
        "{stderr}"
    );
    assert!(trip.contains(" N (limit 0.25 N), at ") && stderr.contains(remedy), "{stderr}");
    let summary = std::fs::read_to_string(out.join("summary.json")).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&summary).unwrap();
    assert_eq!(
        (&summary["unit"], &summary["requirement"], &summary["remedy"]),
        (&"N".into(), &"SR-04".into(), &remedy.into())
    );
    let report = std::fs::read_to_string(out.join("report.html")).unwrap();
    assert!(report.contains(remedy) && report.contains(" N (limit 0.25 N)"), "{report}");
}

/// A reversed lateral sensor: a run that compared nothing, a verdict of a tilted plate, a panic.
#[test]
fn a_lateral_sensor_that_is_reversed_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let plan = short_plan(folder.path());
    let call = |arguments: &[&str]| {
        let output = muprime().args(arguments).current_dir(folder.path()).output().unwrap();
        (output.status.code(), texts(&output).0 + &texts(&output).1)
    };
    for factor in ["-1.0", "-2.0"] {
        let defects = format!("[[defect]]\nname = \"lateral_gain\"\nparameters = {{ factor = {factor} }}\n");
        std::fs::write(folder.path().join("d.toml"), defects).unwrap();
        let setup =
            ["--setup", "virtual-ideal", "--defects", "d.toml", "--out", factor.trim_start_matches('-')];
        let told = call(&[&["run", &plan, "--fast"][..], &setup].concat());
        assert!(told.1.contains("the lateral axis is reversed"), "{told:?}");
    }
    for arguments in [
        &["diagnose", "2.0"][..],
        &["diagnose", "1.0"],
        &["compare", "1.0", "2.0"],
        &["check", "1.0/points.csv"],
    ] {
        let (status, told) = call(arguments);
        let told = told.replace("\n  \u{2502} ", " ");
        assert!(status == Some(2) && told.contains("axis is reversed"), "{arguments:?}: {told}");
    }
    let (_, told) = call(&["check", "1.0"]);
    assert!(told.contains("axis is reversed"), "{told}");
}

/// A sensor whose zero is 60 mN off at loads of 250 mN: said at once, and kept in summary and report.
#[test]
fn a_zero_that_is_off_is_told_before_the_sweep_and_is_in_the_summary() {
    let folder = tempfile::tempdir().unwrap();
    let (plan, out, defects) =
        (short_plan(folder.path()), folder.path().join("run"), folder.path().join("defects.toml"));
    let off =
        "[[defect]]\nname = \"normal_offset\"\nseed = 1\nparameters = { offset_n = 0.06, sinking = 0.2 }\n";
    std::fs::write(&defects, off).unwrap();
    let told = |out: &std::path::Path, more: &[&str]| {
        let run = muprime()
            .args(["run", &plan, "--fast", "--setup", "virtual-ideal", "--out"])
            .arg(out)
            .args(more)
            .output();
        let summary = std::fs::read(out.join("summary.json")).unwrap();
        (texts(&run.unwrap()).1, serde_json::from_slice::<serde_json::Value>(&summary).unwrap())
    };
    let (terminal, summary) = told(&out, &["--defects", defects.to_str().unwrap()]);
    let before = terminal.find("% of the smallest load: zero the sensor").expect("a warning");
    assert!(before < terminal.find("after the sweep").unwrap(), "{terminal}");
    for when in ["before", "after"] {
        let zero = summary["zeros"][when]["normal_n"].as_f64().unwrap();
        assert!((zero - 0.06).abs() < 0.005, "{when}: {zero}");
    }
    let remarks = summary["remarks"].to_string();
    assert!(remarks.contains("the zero of the normal force was off by +"), "{remarks}");
    assert!(
        std::fs::read_to_string(out.join("report.html")).unwrap().contains("the zero of the normal force")
    );
    let (terminal, summary) = told(&folder.path().join("good"), &[]);
    assert!(!terminal.contains("zero the sensor") && summary.get("remarks").is_none(), "{terminal}");
}

#[test]
fn bad_input_is_refused_with_its_place_and_nothing_is_touched() {
    let folder = tempfile::tempdir().unwrap();
    let cases = [
        ("[base]", "[bass]", "the key bass is not known"),
        ("speed_m_s = 0.02", "speed_m_s = 0.02\nspeed = 1", "speed is not known"),
        ("[0.5e-6, 1e-6, 2e-6, 3e-6]", "[0.5e-6, 1e-3]", "outside what this rig allows"),
        ("frequency_hz = 27500", "frequency_hz = nan", "outside what this rig allows"),
        ("measure_s = 0.1", "measure_s = 10.0", "needs"),
        ("seed = 7", "seed = -7", "0 or more"),
        ("reference_every = 4", "reference_every = 4\ndirections = [2]", "directions are 1, -1 or both"),
        ("reference_every = 4", "reference_every = 4\ndirections = [1, 1]", "directions are 1, -1 or both"),
        ("[0.5e-6, 1e-6, 2e-6, 3e-6]", "[1e-6, 2e-6, \"1000nm\"]", "amplitude_pp_m lists a value twice"),
        ("[0.5e-6, 1e-6, 2e-6, 3e-6]", "[0, 1e-6, 0.0]", "`replicates` repeats every condition"),
        ("[0.5e-6, 1e-6, 2e-6, 3e-6]", "[]", "amplitude_pp_m lists no value"),
    ];
    for (from, to, expected) in cases {
        let path = folder.path().join("bad.toml");
        assert!(SHORT.contains(from));
        std::fs::write(&path, SHORT.replace(from, to)).unwrap();
        let out = folder.path().join("never");
        let output = muprime().args(["run", "--fast", "--out"]).arg(&out).arg(&path).output().unwrap();
        let (stdout, stderr) = texts(&output);
        assert_eq!(output.status.code(), Some(2), "{to}: {stderr}");
        assert!(stderr.contains(expected), "{to}: {stderr}");
        assert!(stderr.contains("bad.toml:"), "the place is shown: {stderr}");
        assert!(stdout.is_empty() && !out.exists(), "nothing was touched");
    }
    let output = muprime().args(["run", "no-such-plan"]).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert_eq!(muprime().args(["fly"]).output().unwrap().status.code(), Some(2));
}

#[test]
fn everything_bundled_passes_its_own_check() {
    let mut files = Vec::new();
    for folder in ["runs/plans", "runs/setups", "drivers/profiles"] {
        let entries = std::fs::read_dir(file(folder)).unwrap();
        files.extend(
            entries.map(|e| e.unwrap().path()).filter(|p| p.extension().is_some_and(|e| e == "toml")),
        );
    }
    assert!(files.len() >= 8);
    let output = muprime().args(["--json", "check"]).args(&files).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", texts(&output).0);
    assert_eq!(documents(&output).len(), files.len());
}

/// A missed deadline counts with its own lateness, as in the loop's report: 0.3 ms late, then 2.4 ms late
/// with two deadlines missed.
#[test]
fn deadlines_that_were_missed_are_counted_with_their_lateness() {
    use realtime::Nanos;
    use runs::job::{LATENESS_BOUNDS_S, Snapshots};
    use tests::memory::sweep_in_memory;
    let setup = runs::setup::Setup::load("virtual-ideal").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let plan = runs::plan::Plan::load(&short_plan(folder.path())).unwrap();
    let model = std::sync::Arc::new(models::prediction::SpringSlider::new(setup.tip.finger).unwrap());
    let mut first = None;
    let world = sim::world::WorldConfig::ideal();
    sweep_in_memory(&setup, &plan, 3, &world, model, &mut |row| first = first.or(Some(*row))).unwrap();
    let mut snapshots = Snapshots::of(5, Nanos(1_000_000));
    let mut late = |ns, at| {
        let mut row = first.unwrap();
        (row.inputs.seen.lateness, row.now) = (Nanos(ns), Nanos(at));
        snapshots.take(&row)
    };
    assert_eq!(late(300_000, 10_000_000), None);
    let seen = late(2_400_000, 200_000_000).unwrap();
    assert_eq!((seen.unix_ns, seen.deadlines.cycles, seen.deadlines.missed), (200_000_005, 2, 2));
    assert!((seen.deadlines.lateness_sum_s - 4.5e-3).abs() < 1e-12, "0.3, 2.4, 1.4 and 0.4 ms");
    let upto = |bound_s: f64| -> u64 {
        let below = LATENESS_BOUNDS_S.iter().zip(seen.deadlines.lateness_classes);
        below.filter(|(bound, _)| **bound <= bound_s).map(|(_, count)| count).sum()
    };
    assert_eq!([2e-4, 5e-4, 1e-3, 2e-3, 5e-3].map(upto), [0, 2, 2, 3, 4]);
}

/// A pipeline with a baseline in git: friction that is 30 % higher passed as no difference, a trip was not
/// mentioned, and a baseline without its record was refused.
#[test]
fn a_comparison_gates_a_pipeline() {
    let folder = tempfile::tempdir().unwrap();
    let defect = |name: &str, what: &str, parameters: &str| {
        let text = format!("[[defect]]\nname = \"{what}\"\nparameters = {{ {parameters} }}\n");
        std::fs::write(folder.path().join(name), text).unwrap();
    };
    defect("gain.toml", "lateral_gain", "factor = 1.3");
    defect("stall.toml", "stage_stall", "from_s = 36.0");
    let call = |arguments: &[&str]| {
        let output = muprime().args(arguments).current_dir(folder.path()).output().unwrap();
        (output.status.code(), texts(&output))
    };
    let run = |out: &str, seed: &str, more: &[&str]| {
        let always = ["run", "--fast", "--setup", "virtual-ideal", "--seed", seed, "--out", out];
        call(&[&always[..], more].concat()).0
    };
    assert_eq!(run("base", "1", &[]), Some(0));
    assert_eq!(run("gain", "2", &["--defects", "gain.toml"]), Some(0));
    assert_eq!(run("late", "1", &["--defects", "stall.toml"]), Some(1));
    let compared = |a: &str, b: &str, status: i32| {
        let (ended, (printed, told)) = call(&["compare", a, b, "--json", "--fail-on-difference"]);
        assert_eq!(ended, Some(status), "{printed}{told}");
        serde_json::from_str::<serde_json::Value>(&printed).unwrap()
    };
    let judged = &compared("base", "gain", 1)["comparison"]["judged"];
    assert_eq!((&judged["answer"], &judged["differ_in"]), (&"differ".into(), &serde_json::json!(["mu_0"])));
    let (status, (printed, _)) = call(&["compare", "base", "gain"]);
    assert!(status == Some(0) && printed.starts_with("the runs differ in mu_0 by more"), "{printed}");
    let (status, _) = call(&["compare", "base", "gain", "--by", "run", "--fail-on-difference"]);
    assert_eq!(status, Some(2), "groups have no answer to fail on");
    // A run that tripped, as the page of its report says it.
    let warnings = |document: &serde_json::Value| document["warnings"].to_string();
    let late = warnings(&compared("base", "late", 0));
    assert!(late.contains("late: Ended early after ") && late.contains(" of 98 passes: tripped"), "{late}");
    assert!(call(&["compare", "base", "late"]).1.0.contains("late: Ended early"));
    // What is kept in git is enough, and the seed that both have is still seen.
    let kept = folder.path().join("base");
    std::fs::remove_file(kept.join("run-1.mcap")).unwrap();
    let bare = compared("base", "late", 0);
    assert!(warnings(&bare).contains("no record") && warnings(&bare).contains("have seed 1"), "{bare}");
    assert_eq!(bare["comparison"]["judged"]["answer"], "not_independent");
    assert_eq!(bare["differences"], serde_json::json!([]));
    std::fs::remove_file(kept.join("run.toml")).unwrap();
    let (status, (_, told)) = call(&["compare", "base", "gain"]);
    assert!(status == Some(2) && told.contains("without a record, run.toml"), "{told}");
}

/// The passes that a verdict wants are judged with those that it came from, as a second run of the rig.
#[test]
fn a_further_experiment_is_diagnosed_with_the_first_run() {
    let folder = tempfile::tempdir().unwrap();
    let call = |arguments: &[&str]| {
        let output = muprime().args(arguments).current_dir(folder.path()).output().unwrap();
        (output.status.code(), texts(&output))
    };
    assert_eq!(call(&["run", "--fast", "--out", "first"]).0, Some(0));
    let (_, (_, told)) = call(&["diagnose", "first", "--save-plan", "next.toml", "--no-pairs"]);
    let next = "next: muprime run next.toml --out NEXT; then muprime diagnose first NEXT, both together";
    assert!(told.contains(next), "{told}");
    let (status, (_, told)) = call(&["run", "next.toml", "--fast", "--out", "second"]);
    assert!(status == Some(0) && told.contains("next: muprime diagnose first second\n"), "{told}");
    let lines = |run: &str| {
        let table = std::fs::read_to_string(folder.path().join(run).join("points.csv")).unwrap();
        table.lines().count() - 1
    };
    let of = |arguments: &[&str]| {
        let (status, (printed, told)) = call(&[&["diagnose", "--json", "--no-pairs"], arguments].concat());
        assert_eq!(status, Some(0), "{told}");
        serde_json::from_str::<serde_json::Value>(&printed).unwrap()
    };
    let (alone, both) = (of(&["first"]), of(&["second", "first"]));
    assert_eq!(both["hypotheses"][0]["effects"], serde_json::json!(["squeeze_film"]));
    assert_eq!(both["data"]["points"], lines("first") + lines("second"));
    assert!(both["scatter"]["run_relative_sd"].is_number() && alone["scatter"]["run_relative_sd"].is_null());
    let next = both["next_experiment"].as_array().filter(|list| !list.is_empty());
    for experiment in next.expect("a further experiment") {
        let odds = experiment["expected_odds"].as_f64();
        assert!(odds.is_none_or(|odds| (1.0..=100.0).contains(&odds)), "{experiment}");
        assert_eq!(odds.is_none(), experiment["separates"].to_string().contains("unknown"), "{experiment}");
    }
    let width = |verdict: &serde_json::Value| {
        let parameters = verdict["hypotheses"][0]["parameters"].as_array().unwrap();
        let exponent = parameters.iter().find(|p| p["name"] == "amplitude_exponent").expect("an exponent");
        exponent["ci95"][1].as_f64().unwrap() - exponent["ci95"][0].as_f64().unwrap()
    };
    assert!(width(&both) < width(&alone), "{} and {}", width(&both), width(&alone));
    let refused = |arguments: &[&str], why: &str| {
        let (status, (_, told)) = call(&[&["diagnose"], arguments].concat());
        assert!(status == Some(2) && told.contains(why), "{arguments:?}: {told}");
    };
    refused(&["first", "./first"], "holds the same passes");
    refused(&["first", "second", "--in-folder"], "folder of one run");
    let rig = folder.path().join("second/rig.toml");
    let text = std::fs::read_to_string(&rig).unwrap();
    std::fs::write(&rig, text.replace("force_sd_n = 0.0008", "force_sd_n = 0.0009")).unwrap();
    refused(&["first", "second"], "rig.toml differ");
    assert_eq!(call(&["diagnose", "first", "second", "--rig", "first/rig.toml", "--no-pairs"]).0, Some(0));
}
