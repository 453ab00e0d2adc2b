//! Lags and shifts in time that are withheld in the virtual rig are found in a run's edges, with their
//! size; none is claimed where there is none, whatever else acts.

use diagnosis::report::timing::{TimingComparison, judge, mean_delay_s};
use models::SpringSlider;
use rayon::prelude::*;
use runs::edges::Collector;
use runs::{Outcome, Plan, Setup};
use sim::defects::Defects;
use sim::world::WorldConfig;
use std::sync::Arc;
use tests::memory::sweep_in_memory;
use tests::rounds;

/// Fixed before any run with them; the method was made on 41000 to 41700.
const FIRST_SEED: u64 = 47_000;

const PLAN: &str = r#"
name = "edges"
reference_every = 0
[base]
amplitude_pp_m = 2e-6
frequency_hz = 27500
speed_m_s = 0.01
normal_force_n = 0.4
[[series]]
amplitude_pp_m = [1.5e-6, 2e-6, 3e-6]
edges = 3
"#;

/// A defects file with each of these defects and its parameters.
fn world(defects: &str) -> WorldConfig {
    WorldConfig { defects: Defects::parse(defects).unwrap(), ..WorldConfig::ideal() }
}

fn run(seed: u64, world: &WorldConfig) -> [TimingComparison; 2] {
    let setup = Setup::load("virtual-ideal").unwrap();
    let model = Arc::new(SpringSlider::new(setup.tip.finger).unwrap());
    let mut found = Collector::default();
    let plan = Plan::parse("edges", PLAN).unwrap();
    let done = sweep_in_memory(&setup, &plan, seed, world, model.clone(), &mut |row| found.row(row)).unwrap();
    assert_eq!(done.outcome, Outcome::Complete, "{world:?}");
    let part = judge(&found.edges, &*model, setup.lateral_passband_hz());
    part.comparisons.try_into().unwrap()
}

/// The `i`-th of `n` sizes from 1 to 60 ms, evenly in the logarithm, s.
fn size(i: u64, n: u64) -> f64 {
    1e-3 * 60f64.powf(i as f64 / (n - 1) as f64)
}

/// How many of the runs found the cause, and in how many the interval holds the true time.
fn score(what: &str, n: u64, defect: impl Fn(f64) -> String + Sync, cause: &str) -> [usize; 2] {
    let all: Vec<_> = (0..n)
        .into_par_iter()
        .map(|i| (size(i, n), run(FIRST_SEED + i, &world(&defect(size(i, n))))))
        .collect();
    let mut right = [0; 2];
    for (late, found) in &all {
        for c in found {
            println!(
                "{what} {:.2} ms: {} {:?}",
                1e3 * late,
                c.text,
                c.forms.iter().map(|f| (f.probability * 1e3).round() / 1e3).collect::<Vec<_>>()
            );
        }
        let [low, high] = found[0].ci95_s.unwrap();
        right[0] += usize::from(found[0].causes.contains(&cause));
        right[1] += usize::from((low..=high).contains(late));
    }
    right
}

#[test]
fn withheld_lags_and_shifts_are_found_with_their_size() {
    let n = rounds(5, 30);
    let stated = mean_delay_s(200.0);
    let lag = |late: f64| {
        let bandwidth = mean_delay_s(1.0) / (stated + late);
        format!("[[defect]]\nname = \"sensor_lag\"\nparameters = {{ bandwidth_hz = {bandwidth} }}\n")
    };
    let shift = |late: f64| {
        format!("[[defect]]\nname = \"time_misalignment\"\nparameters = {{ delay_s = {late} }}\n")
    };
    let lags = score("lag", n, lag, "sensor_lag");
    let shifts = score("shift", n, shift, "time_misalignment");
    println!(
        "of {n} runs: lags found {}, within {}; shifts found {}, within {}",
        lags[0], lags[1], shifts[0], shifts[1]
    );
    let missed = n as usize / 15;
    for [found, within] in [lags, shifts] {
        assert_eq!(found, n as usize);
        assert!(within + missed >= n as usize, "{within} of {n}");
    }
}

#[test]
fn none_is_claimed_where_there_is_none_whatever_else_acts() {
    let n = rounds(5, 30);
    for (what, defects) in [
        ("nothing", ""),
        ("adhesion", "[[defect]]\nname = \"adhesion\"\nseed = SEED\n"),
        ("squeeze film", "[[defect]]\nname = \"squeeze_film\"\nseed = SEED\n"),
        ("slow creep", "[[defect]]\nname = \"subsurface_relaxation\"\nseed = SEED\n"),
        ("offset that drifts", "[[defect]]\nname = \"lateral_offset_drift\"\nseed = SEED\n"),
    ] {
        let claimed: usize = (0..n)
            .into_par_iter()
            .map(|i| {
                let found =
                    run(FIRST_SEED + 500 + i, &world(&defects.replace("SEED", &(900 + i).to_string())));
                for c in &found {
                    println!("{what}: {} {:?}", c.text, c.log10_odds_vs_none);
                }
                found.iter().filter(|c| !c.causes.is_empty()).count()
            })
            .sum();
        println!("{what}: {claimed} claims in {n} runs");
        assert_eq!(claimed, 0, "{what}");
    }
}

/// Means over passes hardly show a lag: the verdict's first sentences must not hide one that the record
/// shows.
#[test]
fn the_first_sentences_of_a_verdict_name_a_lag_that_the_record_shows() {
    let folder = tempfile::tempdir().unwrap();
    let series =
        "[[series]]\namplitude_pp_m = [0.0, 0.5e-6, 1e-6, 2e-6, 3e-6]\nspeed_m_s = [0.01, 0.02, 0.04]\n";
    std::fs::write(folder.path().join("plan.toml"), format!("{PLAN}{series}")).unwrap();
    let lag = "[[defect]]\nname = \"sensor_lag\"\nparameters = { bandwidth_hz = 12 }\n";
    std::fs::write(folder.path().join("lag.toml"), lag).unwrap();
    let answer = |words: &str| {
        let mut command = tests::muprime();
        command.current_dir(folder.path()).env("MUPRIME_RUNS", folder.path());
        let ended = command.args(words.split(' ')).output().unwrap();
        assert!(ended.status.success(), "{}", tests::texts(&ended).1);
        tests::documents(&ended)
    };
    for (out, defects, shown) in [("late", " --defects lag.toml", true), ("sound", "", false)] {
        answer(&format!(
            "--json run plan.toml --setup virtual-ideal --seed 47600 --fast --out {out}{defects}"
        ));
        let verdict = answer(&format!("--json diagnose {out}")).remove(0);
        let text = verdict["text"].as_str().unwrap();
        println!("{text}");
        assert_eq!(text.contains("The run's record shows sensor lag: the lateral force is"), shown, "{text}");
    }
}
