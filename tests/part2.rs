//! The bundled plan `part2-validation` on virtual rigs: what the verdict says of each defect, and of rigs
//! with and without air.

use models::SpringSlider;
use rayon::prelude::*;
use runs::{Job, Outcome, Plan, Setup, Signals};
use sim::defects::{self, Defects};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use tests::{muprime, rounds};

/// The plan; by default with half of its repeats.
fn plan() -> Plan {
    let (name, text) = runs::plan::BUNDLED.iter().find(|(name, _)| *name == "part2-validation").unwrap();
    assert!(text.contains("\nreplicates = 8\n"));
    Plan::parse(name, &text.replace("\nreplicates = 8\n", rounds("\nreplicates = 4\n", "\nreplicates = 8\n")))
        .unwrap()
}

/// The verdict of a sweep of the plan on a bundled rig, with a defect where one is given.
fn verdict(rig: &str, defect: Option<(&str, u64)>, seed: u64) -> serde_json::Value {
    let folder = tempfile::tempdir().unwrap();
    let setup = Setup::load(rig).unwrap();
    let text = |(name, seed)| format!("[[defect]]\nname = \"{name}\"\nseed = {seed}\n");
    let job = Job {
        model: Arc::new(SpringSlider::new(setup.tip.finger).unwrap()),
        setup,
        plan: plan(),
        seed,
        model_file: None,
        defects: defect.map(|defect| Defects::parse(&text(defect)).unwrap()),
        out: folder.path().join("run"),
        fast: true,
        notes: Default::default(),
        answers: None,
    };
    let ended = job.run_in_virtual_time(&Signals::default(), &mut |_| {}).unwrap().outcome;
    if ended != Outcome::Complete {
        return serde_json::json!({ "verdict": format!("the run ends: {ended:?}") });
    }
    diagnosed(&folder.path().join("run"))
}

fn diagnosed(run: &Path) -> serde_json::Value {
    let done = muprime().args(["--json", "diagnose"]).arg(run).output().unwrap();
    serde_json::from_slice(&done.stdout)
        .unwrap_or_else(|e| panic!("{e}: {}", String::from_utf8_lossy(&done.stderr)))
}

/// What a verdict is worth where the truth is one cause.
fn judged(verdict: &serde_json::Value, truth: &str) -> String {
    let effects = |hypothesis: &serde_json::Value| -> Vec<String> {
        let all = hypothesis["effects"].as_array().into_iter().flatten();
        all.map(|e| e.as_str().unwrap().to_string()).collect()
    };
    let first = effects(&verdict["hypotheses"][0]);
    match verdict["verdict"].as_str().unwrap() {
        "named" if first == [truth] => "named".into(),
        "named" if first.iter().any(|n| n == truth) => "named in a pair".into(),
        "named" if first.iter().all(|n| tests::near::near(n, truth)) => "in class".into(),
        "named" => format!("WRONG: {}", first.join(" and ")),
        other => other.replace('_', " "),
    }
}

/// Every defect of the virtual rig under the plan. A defect that the plan or a table of steady passes cannot
/// show is no gap or cannot be decided, and none is blamed on another cause. By default every nineteenth,
/// once; all of them three times take a quarter of an hour.
#[test]
fn every_defect_under_the_plan_of_part_2() {
    let all: Vec<_> = defects::ALL.iter().step_by(rounds(19, 1)).collect();
    let cases: Vec<(&str, u64)> =
        all.iter().flat_map(|kind| (1..=rounds(1, 3)).map(move |seed| (kind.name, seed))).collect();
    let found: Vec<(&str, String)> = cases
        .par_iter()
        .map(|&(name, seed)| {
            let verdict = verdict("virtual-ideal", Some((name, seed)), 40 + seed);
            let judged = judged(&verdict, name);
            println!("{name}, seed {seed}: {judged}");
            (name, judged)
        })
        .collect();
    let mut table = BTreeMap::<&str, BTreeMap<&str, u32>>::new();
    for (name, judged) in &found {
        *table.entry(name).or_default().entry(judged).or_default() += 1;
    }
    println!("| defect | verdicts |\n|---|---|");
    for (name, verdicts) in &table {
        let verdicts: Vec<String> = verdicts.iter().map(|(verdict, n)| format!("{verdict} {n}")).collect();
        println!("| {name} | {} |", verdicts.join(", "));
    }
    let wrong = found.iter().filter(|(_, judged)| judged.starts_with("WRONG")).count();
    println!("{wrong} of {} blamed on another cause", found.len());
    assert!(wrong as f64 <= 0.01 * found.len() as f64, "{found:?}");
}

/// The air of `virtual` is named, with a region that the pressure bounds, and `virtual-ideal` has no gap; ten
/// seeds of each in `tests/run long`.
#[test]
fn the_plan_names_the_air_and_leaves_the_ideal_rig_alone() {
    (1..=rounds(1, 10)).into_par_iter().for_each(|seed: u64| {
        let film = verdict("virtual", None, seed);
        let first = &film["hypotheses"][0];
        println!("seed {seed}: {} {} {}", film["verdict"], first["effects"], first["probability"]);
        assert_eq!((&film["verdict"], &first["effects"][0]), (&"named".into(), &"squeeze_film".into()));
        let strongest = &film["where"]["regions"][0]["bounds"];
        assert!(strongest["ambient_pressure_pa"][0].as_f64().unwrap() > 45_000.0, "seed {seed}: {strongest}");
        assert_eq!(verdict("virtual-ideal", None, seed)["verdict"], "no_gap", "seed {seed}");
    });
}
