//! The ratio k_l/k_n, which decides the law of friction, from a rig's own passes: how often its 95 % interval holds the truth, and how wide it is.

use calibration::finger::springs::{Springs, springs};
use models::{Pass, PeakToPeak, SpringSlider};
use rayon::prelude::*;
use runs::{Outcome, Plan, Setup};
use sim::finger::VirtualFinger;
use sim::world::WorldConfig;
use std::sync::Arc;
use tests::memory::sweep_in_memory;
use tests::{documents, muprime, rounds, texts};

/// Fixed before the first of them was run.
const FIRST_SEED: u64 = 61_000;

/// Sweeps of the bundled plan 'first-sweep' on the virtual rig: the passes of each, and the true ratio of its finger.
fn swept(sweeps: u64, world: &WorldConfig) -> Vec<(Vec<Pass>, f64)> {
    let setup = Setup::load("virtual-ideal").unwrap();
    let plan = Plan::load("first-sweep").unwrap();
    let model = Arc::new(SpringSlider::new(setup.tip.finger).unwrap());
    (0..sweeps)
        .into_par_iter()
        .map(|i| {
            let seed = FIRST_SEED + i;
            let run =
                sweep_in_memory(&setup, &plan, seed, world, Arc::clone(&model) as _, &mut |_| {}).unwrap();
            assert_eq!(run.outcome, Outcome::Complete);
            let finger = VirtualFinger::new(&world.finger, seed);
            let truth = finger.lateral_stiffness_n_per_m / finger.normal_stiffness_n_per_m;
            (run.passes.into_iter().map(|p| p.pass).collect(), truth)
        })
        .collect()
}

/// The springs from the first `count` passes with vibration of each sweep, and what stands before them without.
fn fitted(sweeps: &[(Vec<Pass>, f64)], count: usize) -> Vec<(Springs, f64)> {
    let noise = Setup::load("virtual-ideal").unwrap().file.noise;
    let vibrates = |p: &Pass| p.amplitude != PeakToPeak::ZERO;
    sweeps
        .par_iter()
        .map(|(passes, truth)| {
            let last = passes.iter().enumerate().filter(|(_, p)| vibrates(p)).nth(count - 1);
            let taken = last.map_or(passes.as_slice(), |(at, _)| &passes[..=at]);
            (springs(taken, &noise).unwrap(), *truth)
        })
        .collect()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Every finger of the virtual rig has stiffnesses of its own, 5 % about the nominal ones; nobody tells the fit.
#[test]
fn the_interval_of_the_ratio_holds_the_truth() {
    let sweeps = rounds(30, 400);
    let swept = swept(sweeps, &WorldConfig::ideal());
    for count in [10, 20, 40, 82] {
        let told = fitted(&swept, count);
        let held = told.iter().filter(|(s, t)| s.ratio_ci95[0] <= *t && *t <= s.ratio_ci95[1]).count();
        let closed = told.iter().filter(|(s, _)| s.ratio_closed == [true; 2]).count();
        let error = median(told.iter().map(|(s, t)| (s.lateral_over_normal / t).ln().abs()).collect());
        let half = median(told.iter().map(|(s, _)| 0.5 * (s.ratio_ci95[1] / s.ratio_ci95[0]).ln()).collect());
        println!(
            "{} passes with vibration: the 95 % interval holds the true k_l/k_n in {held} of {sweeps}, closed in {closed}; half of it {:.1} %, error {:.1} % (medians)",
            told[0].0.passes,
            100.0 * half,
            100.0 * error
        );
        // Three standard deviations of the count below 95 %, for four counts.
        let n = sweeps as f64;
        assert!(held as f64 >= 0.95 * n - 3.0 * (0.95 * 0.05 * n).sqrt(), "{held}");
        assert!(count < 82 || (half < 0.05 && closed as u64 == sweeps), "{half} {closed}");
    }
}

/// Where the finger is the finite element ridge, the slider is not the law: the springs that fit it best have
/// a ratio a fifth above that of the ridge's static solve, 0.53 (docs/ridge.md), and the misfit tells.
#[test]
fn the_ridges_ratio_comes_out_of_its_own_passes() {
    let mut world = WorldConfig::ideal();
    world.finger.ridge_table_strokes = 1.0;
    let told = fitted(&swept(6, &world), 82);
    let ratio = median(told.iter().map(|(s, _)| s.lateral_over_normal).collect());
    let normal = median(told.iter().map(|(s, _)| s.normal_stiffness_n_per_m).collect());
    let chi2 = median(told.iter().map(|(s, _)| s.reduced_chi2).collect());
    let low = median(told.iter().map(|(s, _)| s.ratio_ci95[0]).collect());
    let high = median(told.iter().map(|(s, _)| s.ratio_ci95[1]).collect());
    println!(
        "finite element ridge: k_l/k_n {ratio:.3} ({low:.3} to {high:.3}), k_n {:.2} MN/m, chi-square {chi2:.1} a degree of freedom (medians)",
        1e-6 * normal
    );
    assert!((0.5..0.8).contains(&ratio) && chi2 > 3.0, "{ratio} {chi2}");
}

/// The command, on a run's own table; too few passes are refused.
#[test]
fn calibrate_finger_states_the_ratio() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let run = |words: &str| {
        muprime().current_dir(at).args(words.split(' ')).env("MUPRIME_RUNS", at).output().unwrap()
    };
    let made = run("run first-sweep --setup virtual-ideal --fast --out swept");
    assert!(made.status.success(), "{}", texts(&made).1);
    let told =
        run("--json calibrate finger --passes swept/points.csv --serial F-1 --operator O --out f.toml");
    assert!(told.status.success(), "{}", texts(&told).1);
    let said = &documents(&told)[0];
    let parameters = said["parameters"].as_array().unwrap();
    let ratio = parameters.iter().find(|p| p["name"] == "sweep.lateral_over_normal_stiffness").unwrap();
    let (low, high) = (ratio["ci95"][0].as_f64().unwrap(), ratio["ci95"][1].as_f64().unwrap());
    // The virtual fingertip is drawn within 5 % of 1.5 / 3.9.
    assert!(low < high && (0.25..0.6).contains(&low) && (0.25..0.6).contains(&high), "{said}");
    // Air under the finger, which the slider lacks: its stiffnesses were certified with a chi-square of 52.
    assert!(run("run first-sweep --setup virtual --fast --out air").status.success());
    let told = run("calibrate finger --passes air/points.csv --serial F-1 --operator O --out h.toml");
    assert!(told.status.code() == Some(2) && !at.join("h.toml").exists(), "{}", texts(&told).1);
    assert!(texts(&told).1.contains("does not explain"), "{}", texts(&told).1);
    let table = std::fs::read_to_string(at.join("swept/points.csv")).unwrap();
    let few: Vec<&str> = table.lines().take(4).collect();
    std::fs::write(at.join("few.csv"), few.join("\n") + "\n").unwrap();
    let told = run("calibrate finger --passes few.csv --serial F-1 --operator O --out g.toml");
    assert!(!told.status.success() && !at.join("g.toml").exists());
    assert!(texts(&told).1.contains("passes"), "{}", texts(&told).1);
}
