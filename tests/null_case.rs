//! The null case: where the virtual rig keeps every assumption of the model, the comparison must say so, no
//! more and no less; and how soon it notices one defect. The world shares no friction law with the model.

use models::{FrictionModel, SpringSlider};
use rayon::prelude::*;
use realtime::compare::{Agreement, Lack};
use runs::{Outcome, Plan, Setup};
use sim::defects::Defects;
use sim::world::WorldConfig;
use std::sync::Arc;
use tests::memory::{MemorySweep, sweep_in_memory};
use tests::rounds;

/// Seeds are fixed here, before any run.
const FIRST_SEED: u64 = 5_000;

/// Runs of the null case.
fn count() -> u64 {
    rounds(100, 300)
}

/// Twenty-four conditions and references over the ranges of amplitude, speed, load and frequency: ten seconds.
const PLAN: &str = r#"
name = "null"
reference_every = 6
[pass]
settle_s = 0.1
measure_s = 0.2
approach_speed_m_s = 0.2
[base]
amplitude_pp_m = 2e-6
frequency_hz = 27500
speed_m_s = 0.02
normal_force_n = 0.25
[[series]]
amplitude_pp_m = [0.4e-6, 1e-6, 3e-6]
speed_m_s = [0.01, 0.06]
[[series]]
amplitude_pp_m = [0.6e-6, 2e-6]
normal_force_n = [0.6]
frequency_hz = [27500, 40000]
"#;

fn rig() -> (Setup, Plan, Arc<dyn FrictionModel>) {
    let setup = Setup::load("virtual-ideal").unwrap();
    let plan = Plan::parse("null", PLAN).unwrap();
    let model = Arc::new(SpringSlider::new(setup.tip.finger).unwrap());
    (setup, plan, model)
}

fn departed(run: &MemorySweep) -> bool {
    run.agreement == Agreement::Departed
}

fn agrees(run: &MemorySweep) -> bool {
    matches!(run.agreement, Agreement::Agrees { .. })
}

fn run_all(world: &WorldConfig, runs: u64) -> Vec<MemorySweep> {
    let (setup, plan, model) = rig();
    (0..runs)
        .into_par_iter()
        .map(|i| {
            let done = sweep_in_memory(&setup, &plan, FIRST_SEED + i, world, Arc::clone(&model), &mut |_| {})
                .unwrap();
            assert_eq!(done.outcome, Outcome::Complete);
            done
        })
        .collect()
}

#[test]
fn residuals_are_standard_normal_and_the_test_rarely_alarms() {
    let runs = run_all(&WorldConfig::ideal(), count());
    // The first pass of a run fixes mu0 and says nothing about the model.
    let z: Vec<f64> = runs
        .iter()
        .flat_map(|r| r.passes.iter().filter(|p| p.pass.point > 0).map(|p| p.comparison.unwrap().z))
        .collect();
    assert!(z.len() >= 1_000);
    let inside = z.iter().filter(|z| z.abs() <= 1.96).count() as f64 / z.len() as f64;
    let mean = z.iter().sum::<f64>() / z.len() as f64;
    let sd = (z.iter().map(|z| z * z).sum::<f64>() / z.len() as f64).sqrt();
    let alarms = runs.iter().filter(|r| departed(r)).count();
    let agreeing = runs.iter().filter(|r| agrees(r)).count();
    println!("{} passes: {:.2} % within 1.96, mean {mean:.3}, rms {sd:.3}", z.len(), 100.0 * inside);
    // The plan is short: how small a departure it shows lies about the 0.1 that agreement asks, above it for some.
    let lacking = |lack: Lack| {
        runs.iter().filter(|r| matches!(r.agreement, Agreement::TooLittle { why, .. } if why == lack)).count()
    };
    let (power, scatter) = (lacking(Lack::Power), lacking(Lack::Scatter));
    println!(
        "{alarms} of {} runs alarmed, {agreeing} agree, {power} lack power, {scatter} scatter",
        runs.len()
    );
    assert!((0.93..=0.97).contains(&inside), "{inside}");
    assert!(100 * alarms <= runs.len(), "{alarms}");
    assert!(100 * scatter <= runs.len(), "{scatter} ideal runs scatter");
    assert!(
        2 * agreeing >= runs.len() && agreeing + power + scatter + alarms == runs.len(),
        "{agreeing}, {power}"
    );
}

#[test]
fn the_power_of_the_test_grows_with_the_size_of_one_withheld_defect() {
    // The sizes run from nothing to what the eye sees; the curve is printed.
    let world = |factor: f64| {
        let text = format!(
            "[[defect]]\nname = \"amplitude_miscalibration\"\nparameters = {{ {} }}\n",
            format_args!("factor = {factor}")
        );
        WorldConfig { defects: Defects::parse(&text).unwrap(), ..WorldConfig::ideal() }
    };
    let mut shares = Vec::new();
    for factor in [1.0, 0.97, 0.9, 0.8, 0.7, 0.5] {
        let runs = run_all(&world(factor), rounds(20, 30));
        let alarmed = runs.iter().filter(|r| departed(r)).count();
        let agreeing = runs.iter().filter(|r| agrees(r)).count();
        println!("amplitude factor {factor}: {alarmed} of {} runs alarmed, {agreeing} agree", runs.len());
        // A plate that moves by half of what is said never ends in agreement.
        assert!(factor > 0.5 || agreeing == 0, "{agreeing}");
        shares.push(alarmed as f64 / runs.len() as f64);
    }
    assert!(shares[0] <= 0.05 && shares[5] >= 0.95, "{shares:?}");
}
