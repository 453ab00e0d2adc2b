//! Users' own laws: by name, as a table, from a program, from `model adapt`; in the loop, in the diagnosis,
//! in a corrected model.

use effects::{Baseline, Design};
use models::law_table::LawTable;
use models::pass::{Pass, write_passes};
use models::{Condition, Direction, Finger, FrictionModel, PassNoise, PeakToPeak, RigFile};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serde_json::{Value, json};
use std::path::Path;
use studies::cases::adaptive::{SparseGrid, place_of};
use tests::{documents, file, muprime, rounds, short_plan, texts};

/// What the program below computes: a law that is nobody's here.
fn foreign(c: &Condition) -> f64 {
    let (w, u) = (c.amplitude.metres() / 1e-6, c.speed_m_s / 0.02);
    1.0 / (1.0 + 0.9 * w.powf(0.8) / u.sqrt() * (c.normal_force_n / 0.25).powf(-0.2))
}

const AWK: &str = "awk -F, 'NR == 1 { for (i = 1; i <= NF; i++) at[$i] = i; print \"mu_relative\"; next } \
    { w = $at[\"amplitude_pp_m\"] / 1e-6; u = $at[\"speed_m_s\"] / 0.02; f = $at[\"normal_force_n\"] / 0.25; \
    printf \"%.12g\\n\", 1 / (1 + 0.9 * w ^ 0.8 / sqrt(u) * f ^ -0.2) }'";
const GRID: [&str; 6] = [
    "--grid",
    "amplitude_pp_m=0.25e-6..5e-6:25:log",
    "--grid",
    "speed_m_s=0.004..0.1:13:log",
    "--grid",
    "normal_force_n=0.1..1:7:log",
];

/// Runs the program in a folder; its exit status, documents or words, and what it says to a person, in one
/// line.
fn ran(at: &Path, words: &[&str]) -> (Option<i32>, String, String) {
    let output = muprime().current_dir(at).args(words).output().unwrap();
    let (out, err) = texts(&output);
    (output.status.code(), out, err.replace("│ ", "").split_whitespace().collect::<Vec<_>>().join(" "))
}

fn done(at: &Path, words: &[&str]) -> String {
    let (status, out, err) = ran(at, words);
    assert_eq!(status, Some(0), "{words:?}: {out}{err}");
    out
}

fn refused(at: &Path, words: &[&str], parts: &[&str]) {
    let (status, out, err) = ran(at, words);
    assert_eq!(status, Some(2), "{words:?}: {out}{err}");
    for part in parts {
        assert!(err.contains(part), "{words:?} lacks '{part}': {err}");
    }
}

/// Tabulates the foreign law into `law.csv`; the document.
fn tabulated(at: &Path) -> Value {
    let words = ["--json", "model", "tabulate", "--command", AWK, "--out", "law.csv"];
    serde_json::from_str(&done(at, &[&words[..], &GRID].concat())).unwrap()
}

fn facts(run: &Path) -> std::collections::BTreeMap<String, String> {
    runs::run_dir::record_facts(run).unwrap().into_iter().collect()
}

/// Comparisons of the passes of a run with vibration: what was predicted, none where the law could not tell.
fn predicted(run: &Path) -> Vec<Option<f64>> {
    let passes = runs::run_dir::passes_in(run).unwrap();
    let vibrating = passes.iter().filter(|p| p.pass.amplitude > PeakToPeak::ZERO);
    vibrating.map(|p| p.comparison.map(|c| c.predicted)).collect()
}

#[test]
fn the_built_in_laws_each_lead_a_run_and_its_replay() {
    let folder = tempfile::tempdir().unwrap();
    let (at, plan) = (folder.path(), short_plan(folder.path()));
    let ridge = file("models/data/ridge_table.txt").display().to_string();
    let mut all = Vec::new();
    for (out, law, name) in [
        ("a", "spring-slider", "spring-slider"),
        ("b", "psi", "psi"),
        ("c", "surrogate", "surrogate"),
        ("d", &ridge, "ridge_table"),
    ] {
        done(
            at,
            &[
                "run",
                &plan,
                "--setup",
                "virtual-ideal",
                "--fast",
                "--seed",
                "4",
                "--model",
                law,
                "--out",
                out,
            ],
        );
        let (facts, mu) = (facts(&at.join(out)), predicted(&at.join(out)));
        assert_eq!(facts["model"], name);
        assert_eq!(facts.contains_key("model_sha256"), ["c", "d"].contains(&out), "{facts:?}");
        assert!(mu.len() == 16 && mu.iter().all(Option::is_some), "{law}: {mu:?}");
        let replayed = done(at, &["replay", out]);
        assert!(replayed.contains("cycles decide as recorded"), "{replayed}");
        all.push(mu);
    }
    // The shipped ridge table as a file is the law of that name; the others differ.
    assert_eq!(all[2], all[3]);
    assert_eq!(facts(&at.join("c"))["model_sha256"], facts(&at.join("d"))["model_sha256"]);
    assert!(all[0] != all[1] && all[1] != all[2] && all[0] != all[2]);
    refused(
        at,
        &["run", &plan, "--fast", "--model", "stribeck", "--out", "e"],
        &["stribeck", "spring-slider, psi"],
    );
    assert!(!at.join("e").exists());
}

#[test]
fn a_foreign_program_is_tabulated_checked_and_leads_a_run() {
    let folder = tempfile::tempdir().unwrap();
    let (at, plan) = (folder.path(), short_plan(folder.path()));
    let made = tabulated(at);
    let greatest = made["error_greatest"].as_f64().unwrap();
    assert!(
        made["rows"] == 25 * 13 * 7 && made["checks"] == 528 && greatest < 0.01 && greatest > 1e-4,
        "{made}"
    );
    let text = std::fs::read_to_string(at.join("law.csv")).unwrap();
    assert!(text.starts_with("# muprime.law/1") && text.contains("# origin: command awk -F,"), "{text:.200}");
    let law = LawTable::from_csv(&text).unwrap();
    assert!(
        (law.predict(&Condition::paper()).unwrap().mu_relative - foreign(&Condition::paper())).abs()
            <= greatest
    );
    assert!(done(at, &["check", "law.csv"]).is_empty());

    done(at, &["run", &plan, "--setup", "virtual-ideal", "--fast", "--model", "law.csv", "--out", "run"]);
    let run = at.join("run");
    assert_eq!(
        (&*facts(&run)["model"], facts(&run)["model_sha256"].as_str()),
        ("law", made["sha256"].as_str().unwrap())
    );
    for pass in runs::run_dir::passes_in(&run).unwrap().iter().filter(|p| p.pass.amplitude > PeakToPeak::ZERO)
    {
        let expected = foreign(&pass.pass.condition(0.5));
        assert!((pass.comparison.unwrap().predicted - expected).abs() <= greatest, "{pass:?}");
    }
    assert!(done(at, &["replay", "run"]).contains("cycles decide as recorded"));

    // The same law on a narrow grid: what lies outside is measured and not compared.
    let narrow = [
        "--grid",
        "amplitude_pp_m=0.7e-6..2.5e-6:9",
        "--grid",
        "speed_m_s=0.008..0.05:7:log",
        "--out",
        "narrow.csv",
    ];
    let words =
        ["model", "tabulate", "--command", AWK, "--grid", "normal_force_n=0.2..0.3:2", "--accept-error"];
    done(at, &[&words[..], &narrow].concat());
    let words =
        ["run", &plan, "--setup", "virtual-ideal", "--fast", "--model", "narrow.csv", "--out", "apart"];
    let (status, _, said) = ran(at, &words);
    assert!(
        status == Some(0) && said.contains("the law 'narrow' cannot tell at 8 of 22 planned passes"),
        "{said}"
    );
    let told: Vec<bool> = predicted(&at.join("apart")).iter().map(Option::is_some).collect();
    assert_eq!(told.iter().filter(|t| **t).count(), 8, "{told:?}");
    for pass in runs::run_dir::passes_in(&at.join("apart")).unwrap() {
        let w = pass.pass.amplitude.metres();
        assert_eq!(pass.comparison.is_some(), w == 0.0 || (0.7e-6..2.5e-6).contains(&w), "{pass:?}");
    }
}

#[test]
fn a_table_that_is_wrong_or_too_coarse_and_a_program_that_fails_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let tabulate = |command: &str, grid: &str, parts: &[&str]| {
        refused(at, &["model", "tabulate", "--command", command, "--grid", grid, "--out", "x.csv"], parts);
        assert!(!at.join("x.csv").exists());
    };
    let half = "awk 'NR == 1 { print \"mu_relative\"; next } { print 0.5 }'";
    let coarse = "speed_m_s=0.001..0.1:2";
    tabulate(half, "speed_mm_s=1..2:3", &["no variable 'speed_mm_s'", "speed_m_s"]);
    tabulate("exit 3", coarse, &["failed", "exit status: 3"]);
    tabulate("echo mu", coarse, &["the header 'mu'", "mu_relative,mu_relative_sd"]);
    tabulate("echo mu_relative; echo 0.5", coarse, &["1 answers to 516 conditions"]);
    tabulate(&half.replace("0.5", "\"no\""), coarse, &["mu_relative is NaN at speed_m_s = 1.0000e-3"]);
    tabulate(&half.replace("0.5", "29.6"), coarse, &["mu_relative is 29.6", "0 to 2 is needed"]);
    tabulate(
        &half.replace("0.5", "sqrt($1)"),
        coarse,
        &["differs from a fresh call by 0.0", "the tolerance is 0.02", "more nodes"],
    );
    // One that counts its calls is not a function of its variables.
    tabulate(&half.replace("0.5", "NR / 1000"), coarse, &["differs from a fresh call by"]);

    tabulated(at);
    let good = std::fs::read_to_string(at.join("law.csv")).unwrap();
    let head = good.lines().position(|l| l.starts_with("amplitude")).unwrap();
    let line = |n: usize, text: &str| {
        let mut lines: Vec<&str> = good.lines().collect();
        lines[n] = text;
        std::fs::write(at.join("bad.csv"), lines.join("\n")).unwrap();
    };
    let row = good.lines().nth(head + 2).unwrap();
    for (n, text, parts) in [
        (
            head,
            "amplitude_um,speed_m_s,normal_force_n,mu_relative,mu_relative_sd",
            ["line 5", "no column 'amplitude_um'"],
        ),
        (head + 1, row, ["line 7", "those of line 6"]),
        (head + 3, "2.5e-7,4e-3,1,inf,0", ["line 8", "'mu_relative' is 'inf'"]),
        (head + 1, "", ["line 5", "needs 2275 rows, and there are 2274"]),
        (head + 1, "2.5e-7,4e-3,1e-1,5e-1,0", ["changed after it was tabulated", "tabulate it again"]),
    ] {
        line(n, text);
        refused(at, &["run", "--fast", "--model", "bad.csv", "--out", "run"], &parts);
        assert!(!at.join("run").exists());
    }
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| f64::from(rng.next_u32()) / f64::from(u32::MAX)).sum::<f64>() - 6.0
}

/// Passes of a world of the foreign law with mu_0 0.6, plus what `active` changes on the spring-slider; noise
/// of 1 %.
fn world(active: Option<effects::Active<'_>>, seed: u64) -> (Vec<Pass>, RigFile) {
    let noise = PassNoise { pass_relative_sd: 0.01, force_sd_n: 0.0005 };
    let finger = Finger { stiffness_relative_sd: 0.05, ..Finger::paper() };
    let baseline = Baseline {
        mu0: 0.6,
        normal_stiffness_n_per_m: finger.normal_stiffness_n_per_m,
        lateral_stiffness_n_per_m: finger.lateral_stiffness_n_per_m,
    };
    let design = Design {
        duration_s: 1000.0,
        reference_load_n: 0.3,
        reference_speed_m_s: 0.02,
        reference_frequency_hz: 27_500.0,
        reference_temperature_c: 20.0,
        stroke_m: 0.0,
        largest_amplitude_m: 4e-6,
    };
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut passes = Vec::new();
    for w in [0.0, 0.4e-6, 0.8e-6, 1.2e-6, 2e-6, 3e-6, 4e-6] {
        for speed_m_s in [0.006, 0.012, 0.03, 0.08] {
            for normal_force_n in [0.18, 0.32, 0.6] {
                let point = passes.len() as u64 + 1;
                let direction =
                    if point.is_multiple_of(2) { Direction::Forward } else { Direction::Backward };
                let c = Condition {
                    amplitude: PeakToPeak::from_metres(w),
                    speed_m_s,
                    normal_force_n,
                    direction,
                    mu0: baseline.mu0,
                    time_s: 7.0 * ((point * 31) % 84) as f64,
                    ..Condition::paper()
                };
                let mu = if w > 0.0 { foreign(&c) } else { 1.0 };
                let mut force = direction.sign() * mu * c.mu0 * c.normal_force_n;
                if let Some(active) = active {
                    let slider = |list: &[_]| effects::lateral_force(&baseline, list, &c, &design);
                    force += slider(&[active]) - slider(&[]);
                }
                force += normal(&mut rng) * (0.01 * force).hypot(noise.force_sd_n);
                passes.push(Pass::at(point, &c, Some(force)));
            }
        }
    }
    (passes, RigFile { finger, noise, calibration: Default::default() })
}

fn write(at: &Path, (passes, rig): (Vec<Pass>, RigFile)) {
    std::fs::create_dir_all(at).unwrap();
    write_passes(&passes, std::fs::File::create(at.join("points.csv")).unwrap()).unwrap();
    std::fs::write(at.join("rig.toml"), rig.to_toml().unwrap()).unwrap();
}

fn diagnosed(at: &Path, words: &[&str]) -> Value {
    let words = [&["--json", "diagnose", "points.csv", "--no-pairs"], words].concat();
    serde_json::from_str(&done(at, &words)).unwrap()
}

#[test]
fn a_law_of_ones_own_is_the_base_of_verdict_and_corrected_model() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let sha256 = tabulated(at)["sha256"].clone();
    // A world that is the law: no gap on it, a gap on the spring-slider.
    let clean = at.join("clean");
    write(&clean, world(None, 1));
    let verdict = diagnosed(&clean, &["--model", "../law.csv"]);
    assert_eq!(verdict["verdict"], "no_gap", "{verdict}");
    assert_eq!(verdict["law"], json!({ "name": "law", "sha256": sha256, "cannot_tell": [] }));
    assert!(verdict["remarks"][0].as_str().unwrap().starts_with("The base prediction is the law 'law'"));
    let slider = diagnosed(&clean, &[]);
    assert!(slider["verdict"] != "no_gap" && slider.get("law").is_none(), "{slider}");

    // The same with an effect: it is named on the law, and the corrected model keeps the law.
    let effect = effects::by_name("squeeze_film").unwrap();
    let theta = [0.9e6];
    let film = at.join("film");
    write(&film, world(Some(effects::Active { effect, law: 0, theta: &theta }), 2));
    let verdict =
        diagnosed(&film, &["--model", "../law.csv", "--save-model", "model.toml", "--report", "gap.html"]);
    assert_eq!(
        (&verdict["verdict"], &verdict["hypotheses"][0]["effects"]),
        (&json!("named"), &json!(["squeeze_film"])),
        "{verdict}"
    );
    assert!(verdict["gap"]["shrinkage"].as_f64().unwrap() > 0.8, "{}", verdict["gap"]);
    let page = std::fs::read_to_string(film.join("gap.html")).unwrap();
    assert!(page.contains("The base prediction is the law") && !page.contains("NaN"));

    let saved = std::fs::read_to_string(film.join("model.toml")).unwrap();
    let model = runs::model_file::load("model.toml", &saved).unwrap();
    let table = world(Some(effects::Active { effect, law: 0, theta: &theta }), 3).0;
    let errors = table.iter().map(|p| {
        let c = p.condition(0.6);
        let along = p.direction.sign() * p.lateral_force_n.unwrap();
        (model.predict(&c).unwrap().lateral_force_n - along) / (0.6 * c.normal_force_n)
    });
    let rms = (errors.map(|e| e * e).sum::<f64>() / table.len() as f64).sqrt();
    assert!(rms < 0.015, "fresh noise of 1 % and the fit: {rms}");
    let plan = short_plan(&film);
    done(
        &film,
        &["run", &plan, "--setup", "virtual-ideal", "--fast", "--model", "model.toml", "--out", "run"],
    );
    let facts = facts(&film.join("run"));
    assert_eq!(
        [&facts["model"], &facts["base_law"], &facts["base_law_sha256"]],
        ["corrected", "law", sha256.as_str().unwrap()]
    );
    assert!(done(&film, &["replay", "run"]).contains("cycles decide as recorded"));
    assert!(predicted(&film.join("run")).iter().all(Option::is_some));

    // On another table it does not run.
    let row = saved.lines().find(|l| l.starts_with("2.5e-7,")).unwrap();
    let mut cells: Vec<&str> = row.split(',').collect();
    cells[3] = "0.123";
    let other = saved.replace(row, &cells.join(",")).replace("# sha256 ", "# was ");
    assert!(other != saved);
    std::fs::write(film.join("other.toml"), other).unwrap();
    refused(
        &film,
        &["run", &plan, "--fast", "--model", "other.toml", "--out", "no"],
        &["corrects the law 'law'", "diagnose again"],
    );
}

#[test]
fn passes_that_a_law_cannot_tell_are_left_out_and_named() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    write(at, world(None, 4));
    let rows = |speeds: [f64; 3]| {
        let mut text = "amplitude_pp_m,speed_m_s,normal_force_n,mu_relative\n".to_string();
        for w in (0..=40).map(|i| 1e-7 * f64::from(i)) {
            for u in speeds {
                for f in [0.17, 0.3, 0.65] {
                    let amplitude = PeakToPeak::from_metres(w);
                    let c = Condition { amplitude, speed_m_s: u, normal_force_n: f, ..Condition::paper() };
                    text += &format!("{w},{u},{f},{}\n", foreign(&c));
                }
            }
        }
        text
    };
    std::fs::write(at.join("law.csv"), rows([0.01, 0.03, 0.09])).unwrap();
    std::fs::write(
        at.join("ask.csv"),
        "point,time_s,amplitude_pp_m,frequency_hz,speed_m_s,direction,position_m,normal_force_n\n\
        1,9,2e-6,27500,0.02,1,0,0.3\n2,9,2e-6,27500,0.2,1,0,0.3\n",
    )
    .unwrap();
    let verdict = diagnosed(at, &["--model", "law.csv", "--predict", "ask.csv", "--predictions", "told.csv"]);
    // Vibrating passes at 6 mm/s: 6 amplitudes by 3 forces.
    let left_out: Vec<u64> =
        verdict["law"]["cannot_tell"].as_array().unwrap().iter().map(|p| p.as_u64().unwrap()).collect();
    let slow = |p: &Pass| p.speed_m_s < 0.01 && p.amplitude > PeakToPeak::ZERO;
    let mut expected: Vec<u64> = world(None, 4).0.iter().filter(|p| slow(p)).map(|p| p.point).collect();
    let mut sorted = left_out.clone();
    sorted.sort_unstable();
    expected.sort_unstable();
    assert_eq!((sorted.len(), &sorted), (18, &expected));
    assert_eq!(verdict["data"]["points"], 84 - 18);
    assert!(verdict["remarks"][0].as_str().unwrap().contains("cannot tell at 18 passes"), "{verdict}");
    let told = std::fs::read_to_string(at.join("told.csv")).unwrap();
    assert!(
        told.lines().nth(1).unwrap().split(',').all(|c| c.parse::<f64>().is_ok_and(f64::is_finite)),
        "{told}"
    );
    assert_eq!(told.lines().nth(2), Some("2,,,,,"));
    // A law that can tell of next to nothing.
    std::fs::write(at.join("far.csv"), rows([1.0, 2.0, 3.0])).unwrap();
    let passes: Vec<Pass> = world(None, 4).0.into_iter().filter(|p| p.amplitude > PeakToPeak::ZERO).collect();
    write_passes(&passes, std::fs::File::create(at.join("points.csv")).unwrap()).unwrap();
    refused(
        at,
        &["diagnose", "points.csv", "--model", "far.csv"],
        &["'far' cannot tell at 72 of 72", "speed_m_s", "widen"],
    );
}

#[test]
fn the_surrogate_of_model_adapt_is_read_as_it_was_grown() {
    let spans = json!({
        "amplitude_pp_m": { "low": 0.3e-6, "high": 5e-6, "log": true }, "mu0": { "low": 0.2, "high": 1.0, "log": false },
        "normal_force_n": { "low": 0.1, "high": 1.0, "log": true }, "speed_m_s": { "low": 0.004, "high": 0.1, "log": true },
        "young_modulus_pa": { "low": 20e6, "high": 40e6, "log": false },
    });
    // Axes in the order of the names, as the document has them.
    let f = |p: &[f64]| {
        0.2 + 0.7 * (1.0 - p[0]) * (0.3 + 0.7 * p[3]) + 0.05 * p[1] * p[2] + 0.02 * (6.0 * p[4]).sin()
    };
    let mut grid = SparseGrid::new(5);
    while grid.nodes.len() < 600 {
        let new = grid.next(100);
        let values: Vec<Option<f64>> = new.iter().map(|s| Some(f(&place_of(s)))).collect();
        grid.take(new, &values);
    }
    let document = json!({
        "schema": "muprime.adaptive/1", "version": 1, "quantity": "mu_relative", "variables": spans, "set": { "frequency_hz": 27500.0 },
        "elements": 256, "rounds": [{ "nodes": 600, "failed": 0, "held_out": 9, "rms": 0.004, "worst": 0.01 }], "grid": grid,
    });
    let text = document.to_string();
    let finger = Finger { young_modulus_pa: Some(28.3e6), ..Finger::paper() };
    let law = runs::model_file::law(&finger, "surrogate.json", &text).unwrap();
    assert_eq!((law.name(), law.sha256().map(str::len)), ("surrogate", Some(64)));
    let part = |k: u32, step: f64| (f64::from(k) * step).fract();
    for k in 1..200 {
        let place = [part(k, 0.618), part(k, 0.755), part(k, 0.570), part(k, 0.325), 8.3 / 20.0];
        let log = |low: f64, high: f64, p: f64| low * (high / low).powf(p);
        let c = Condition {
            amplitude: PeakToPeak::from_metres(log(0.3e-6, 5e-6, place[0])),
            mu0: 0.2 + 0.8 * place[1],
            normal_force_n: log(0.1, 1.0, place[2]),
            speed_m_s: log(0.004, 0.1, place[3]),
            ..Condition::paper()
        };
        let p = law.predict(&c).unwrap();
        assert!((p.mu_relative - grid.at(&place).clamp(0.0, 1.0)).abs() < 1e-9, "{k}");
        assert!((p.mu_relative_sd - 0.004_f64.hypot(0.01)).abs() < 1e-12);
        assert!(law.predict(&Condition { frequency_hz: 28_000.0, ..c }).is_ok());
        assert_eq!(law.predict(&Condition { frequency_hz: 30_000.0, ..c }).unwrap_err().name, "frequency_hz");
        assert_eq!(law.predict(&Condition { speed_m_s: 0.2, ..c }).unwrap_err().name, "speed_m_s");
        assert_eq!(
            law.predict(&Condition { amplitude: PeakToPeak::ZERO, speed_m_s: 0.2, ..c }).unwrap().mu_relative,
            1.0
        );
    }
    let wrong = |from: &str, to: &str, finger: &Finger, part: &str| {
        let why = runs::model_file::law(finger, "s.json", &text.replace(from, to))
            .err()
            .expect("refused")
            .to_string();
        assert!(why.contains(part), "{why}");
    };
    wrong("young_modulus_pa", "penalty_ratio", &finger, "no pass states 'penalty_ratio'");
    wrong("{", "{", &Finger { young_modulus_pa: Some(1e6), ..finger }, "the finger states none in it");
    wrong("adaptive/1", "adaptive/2", &finger, "muprime.adaptive/2");
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("surrogate.json"), &text).unwrap();
    let plan = short_plan(folder.path());
    let words = [
        "--json",
        "run",
        &plan,
        "--setup",
        "virtual-ideal",
        "--fast",
        "--model",
        "surrogate.json",
        "--out",
        "run",
    ];
    let output = muprime().current_dir(folder.path()).args(words).output().unwrap();
    assert_eq!(documents(&output).last().unwrap()["summary"]["outcome"], "complete", "{:?}", texts(&output));
}

/// A change of friction with speed that is nobody's here, at size 1: as a table of a user.
fn dip(speed_m_s: f64) -> f64 {
    -(-(speed_m_s / 0.02).ln().powi(2)).exp()
}

fn dip_table(low: f64, high: f64) -> String {
    let mut text = String::from(
        "# place: contact\n# summary: A film that is thickest at one speed.\nspeed_m_s,friction_change\n",
    );
    for i in 0..60 {
        let speed = low * (high / low).powf(f64::from(i) / 59.0);
        text += &format!("{speed:e},{:e}\n", dip(speed));
    }
    text
}

/// A sealed set of the outside simulation without a cause; the forces of `size` times the dip come on top,
/// noise included.
fn dipped(at: &Path, seed: u64, size: f64) -> sim::sealed::Set {
    let mut set = sim::sealed::generate(seed, sim::sealed::Stratum::None, sim::sealed::Ask::Gain);
    for pass in &mut set.passes {
        let factor = 1.0 + size * dip(pass.speed_m_s);
        pass.lateral_force_n = pass.lateral_force_n.map(|force| factor * force);
    }
    std::fs::create_dir_all(at).unwrap();
    write_passes(&set.passes, std::fs::File::create(at.join("points.csv")).unwrap()).unwrap();
    write_passes(&set.conditions, std::fs::File::create(at.join("conditions.csv")).unwrap()).unwrap();
    std::fs::write(at.join("rig.toml"), &set.rig_toml).unwrap();
    set
}

/// An effect of the user's own, as a table, on data of another simulation: named with its size where it is
/// there, not named where it is not, in a corrected model and its predictions.
#[test]
fn an_effect_of_ones_own_is_one_more_hypothesis() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("thick_film.csv"), dip_table(1e-4, 1.0)).unwrap();
    assert!(done(at, &["check", "thick_film.csv"]).is_empty());
    let (mut named, mut inside, mut claimed, trials) = (0, 0, 0, rounds(3, 30));
    for seed in 0..trials {
        let (with, without) = (at.join(format!("with{seed}")), at.join(format!("without{seed}")));
        let size = 0.2 + 0.02 * seed as f64;
        let set = dipped(&with, 90_200 + seed, size);
        let verdict = diagnosed(&with, &["--effect", "../thick_film.csv", "--save-model", "model.toml"]);
        let leader = &verdict["hypotheses"][0];
        if leader["effects"] == json!(["thick_film"]) && verdict["verdict"] == "named" {
            named += 1;
            let ends: Vec<f64> = serde_json::from_value(leader["parameters"][0]["ci95"].clone()).unwrap();
            inside += usize::from(ends[0] <= size && size <= ends[1]);
            let saved = std::fs::read_to_string(with.join("model.toml")).unwrap();
            let model = runs::model_file::load("model.toml", &saved).unwrap();
            let c = Condition { speed_m_s: 0.02, ..set.passes[0].condition(0.5) };
            let base = Condition { speed_m_s: 0.9, ..c };
            assert!(model.predict(&c).is_ok() && model.predict(&base).is_ok());
            assert!(
                model.predict(&Condition { speed_m_s: 1.5, ..c }).is_err(),
                "beyond the table nothing is said"
            );
        }
        assert_eq!(verdict["own_effects"][0]["name"], "thick_film");
        assert!(verdict["remarks"][0].as_str().unwrap().ends_with("own were candidates: thick_film."));
        dipped(&without, 90_200 + seed, 0.0);
        let verdict = diagnosed(&without, &["--effect", "../thick_film.csv"]);
        claimed += usize::from(verdict["verdict"] == "named");
    }
    eprintln!("named {named} of {trials}, truth inside the interval {inside}; without it named {claimed}");
    assert!(10 * named >= 8 * trials && 10 * inside >= 8 * named as usize && claimed == 0);

    // The verdict is checked as any other; one whose table does not reach every pass is not tried.
    let clean = at.join("with0");
    let verdict = diagnosed(&clean, &["--effect", "../thick_film.csv"]);
    std::fs::write(clean.join("verdict.json"), verdict.to_string()).unwrap();
    assert!(done(&clean, &["check", "verdict.json"]).is_empty());
    let flat = |change: &str| format!("speed_m_s,friction_change\n0.0001,{change}\n1,{change}\n");
    for (name, text, part) in [
        ("narrow", dip_table(0.019, 0.021), "does not reach point"),
        ("flat", flat("0.2"), "it changes friction by 0.200 at every pass, which mu_0 says as well"),
        ("nothing", flat("0"), "it changes friction by 0.000 at every pass"),
    ] {
        std::fs::write(clean.join(format!("{name}.csv")), text).unwrap();
        let verdict = diagnosed(&clean, &["--effect", &format!("{name}.csv")]);
        let why = verdict["not_testable"].as_array().unwrap().iter().find(|n| n["effect"] == name).unwrap();
        assert!(why["because"].as_str().unwrap().contains(part), "{why}");
        let weighed = verdict["hypotheses"].as_array().unwrap();
        assert!(weighed.iter().all(|h| !h["effects"].as_array().unwrap().contains(&json!(name))));
    }

    for (name, text, part) in [
        ("squeeze_film", dip_table(1e-4, 1.0), "is an effect of the library"),
        ("unknown", dip_table(1e-4, 1.0), "is an answer of a verdict"),
        ("Film", dip_table(1e-4, 1.0), "is not a name of an effect"),
        ("film", "speed_m_s,mu_relative\n0.1,1\n".into(), "an effect table has no column 'mu_relative'"),
        ("film", "speed_m_s\n0.1\n".into(), "'friction_change' is missing"),
        ("film", format!("# size_sd: -1\n{}", dip_table(1e-4, 1.0)), "a number above zero"),
        (
            "film",
            dip_table(1e-4, 1.0).replace("place: contact", "place: skin"),
            "contact, finger, plate or instrument",
        ),
    ] {
        std::fs::write(clean.join(format!("{name}.csv")), text).unwrap();
        refused(&clean, &["diagnose", "points.csv", "--effect", &format!("{name}.csv")], &[part]);
    }
}
