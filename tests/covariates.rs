//! What is known of a condition and of the instruments reaches whoever needs it, from files to the loop, or is refused.

use effects::corrected::{SavedEffect, SavedModel, SavedParameter};
use effects::{Active, Baseline, Design, lateral_force};
use models::pass::{Pass, write_passes};
use models::{Condition, Direction, PeakToPeak};
use runs::{Plan, Setup};
use sim::world::WorldConfig;
use std::path::Path;

const DESIGN: Design = Design {
    duration_s: 600.0,
    reference_load_n: 0.3,
    reference_speed_m_s: 0.03,
    reference_frequency_hz: 27_500.0,
    reference_temperature_c: 18.0,
    stroke_m: 0.0,
    largest_amplitude_m: 3e-6,
};
const BASELINE: Baseline =
    Baseline { mu0: 0.5, normal_stiffness_n_per_m: 3.9e6, lateral_stiffness_n_per_m: 1.5e6 };

/// A model whose drive leaves its resonance by so much for each kelvin above 18 degrees.
fn warming(detuning_per_kelvin: f64) -> String {
    let parameter =
        |name: &str, unit: &str, value| SavedParameter { name: name.into(), value, unit: unit.into() };
    let effect = SavedEffect {
        name: "resonance_detuning".into(),
        law: "warming (temperature)".into(),
        acts_on: "prediction".into(),
        parameters: vec![parameter("detuning_per_kelvin", "1/K", detuning_per_kelvin)],
        covariance: Vec::new(),
        table: None,
    };
    let saved = SavedModel {
        schema: "muprime.model/1".into(),
        verdict: "a test".into(),
        relative_sd: 0.01,
        interpolation_error: 0.0,
        baseline: BASELINE,
        design: DESIGN,
        law: None,
        effects: vec![effect],
    };
    toml::to_string(&saved).unwrap()
}

fn setup_text(stated: &str) -> String {
    let text = std::fs::read_to_string(tests::file("runs/setups/virtual-ideal.toml")).unwrap();
    let name = "name = \"virtual-ideal\"\n";
    assert!(text.contains(name));
    text.replace(name, &format!("{name}{stated}\n"))
}

/// What a sweep of a setup expected of its vibrating passes under a model.
fn expected(setup: &Setup, model: &str) -> Vec<f64> {
    let model = runs::model_file::load_for(setup, "model.toml", model).unwrap();
    let plan = Plan::load("first-sweep").unwrap();
    let made =
        tests::memory::sweep_in_memory(setup, &plan, 3, &WorldConfig::ideal(), model, &mut |_| {}).unwrap();
    let vibrating = made.passes.iter().filter(|p| p.pass.amplitude > PeakToPeak::ZERO);
    vibrating.filter_map(|p| p.comparison.map(|c| c.predicted)).collect()
}

#[test]
fn a_warming_law_acts_in_the_loop_where_the_setup_states_a_temperature() {
    let setup = Setup::parse("stated.toml", &setup_text("temperature_c = 22.0"), Path::new(".")).unwrap();
    let (cold, warm) = (expected(&setup, &warming(0.0)), expected(&setup, &warming(0.8)));
    assert_eq!(cold.len(), warm.len());
    let raised = cold.iter().zip(&warm).filter(|(c, w)| **w > **c + 0.02).count();
    assert!(2 * raised > cold.len(), "{raised} of {}: {cold:?} {warm:?}", cold.len());
}

#[test]
fn a_law_whose_covariate_the_loop_lacks_is_refused_before_anything_is_touched() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("model.toml"), warming(0.8)).unwrap();
    std::fs::write(at.join("silent.toml"), setup_text("")).unwrap();
    let run = tests::muprime()
        .current_dir(at)
        .args(["run", "--fast", "--setup", "silent.toml", "--model", "model.toml", "--out", "out"])
        .output()
        .unwrap();
    let said = tests::texts(&run).1.split_whitespace().collect::<Vec<_>>().join(" ").replace("│ ", "");
    assert_eq!(run.status.code(), Some(2), "{said}");
    for part in ["warming (temperature)", "resonance_detuning", "temperature_c"] {
        assert!(said.contains(part), "{part}: {said}");
    }
    assert!(!at.join("out").exists());
}

#[test]
fn air_that_no_rig_stands_in_is_refused_with_its_place() {
    for (stated, key) in [
        ("temperature_c = -400.0", "temperature_c"),
        ("relative_humidity_pct = 120.0", "relative_humidity_pct"),
        ("ambient_pressure_pa = -1.0", "ambient_pressure_pa"),
        ("ambient_pressure_pa = 0.0", "ambient_pressure_pa"),
        ("ambient_pressure_pa = 101.3", "ambient_pressure_pa"),
        ("ambient_pressure_pa = 1013.25e3", "ambient_pressure_pa"),
        ("temperature_c = 295.15", "temperature_c"),
        ("relative_humidity_pct = 0.45", "relative_humidity_pct"),
        ("speed_gain_sd = inf", "speed_gain_sd"),
    ] {
        let refused = Setup::parse("s.toml", &setup_text(stated), Path::new(".")).unwrap_err().to_string();
        assert!(refused.contains(key) && refused.contains("is needed"), "{stated}: {refused}");
    }
}

/// What the setup states of the air stands in the run's table, and of the speed in its rig.toml.
#[test]
fn what_a_setup_states_reaches_the_files_of_the_run() {
    let text =
        setup_text("ambient_pressure_pa = 95000.0\nrelative_humidity_pct = 41.0\nspeed_gain_sd = 0.003");
    let setup = Setup::parse("s.toml", &text, Path::new(".")).unwrap();
    assert_eq!(setup.rig_file().calibration.speed_gain_sd, Some(0.003));
    let model = runs::model_file::load_for(&setup, "model.toml", &warming(0.0));
    assert!(model.is_err(), "the law needs a temperature, whatever its size");
    let plan = Plan::load("first-sweep").unwrap();
    let law = std::sync::Arc::new(models::prediction::SpringSlider::new(setup.tip.finger).unwrap());
    let made =
        tests::memory::sweep_in_memory(&setup, &plan, 3, &WorldConfig::ideal(), law, &mut |_| {}).unwrap();
    assert!(!made.passes.is_empty());
    for p in &made.passes {
        assert_eq!(p.pass.ambient_pressure_pa, Some(95_000.0));
        assert_eq!(p.pass.relative_humidity_pct, Some(41.0));
        assert!(p.pass.temperature_c.is_some_and(|t| (15.0..40.0).contains(&t)), "the amplifier's channel");
    }
}

const RIG: &str = "[finger]\nnormal_stiffness_n_per_m = 3.9e6\nlateral_stiffness_n_per_m = 1.5e6\n\
                   stiffness_relative_sd = 0.05\n[noise]\npass_relative_sd = 0.01\nforce_sd_n = 0.0005\n";

/// A table of 120 passes under one law of the library.
fn table(effect: &str, law: usize, theta: &[f64]) -> Vec<Pass> {
    let effect = effects::by_name(effect).unwrap();
    let active = [Active { effect, law, theta }];
    let mut state = 7u64;
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    (0..120u64)
        .map(|i| {
            let mut pick = |list: &[f64]| list[(uniform() * list.len() as f64) as usize];
            let condition = Condition {
                amplitude: PeakToPeak::from_metres(if i % 6 == 0 {
                    0.0
                } else {
                    pick(&[0.5e-6, 1e-6, 2e-6, 3e-6])
                }),
                speed_m_s: pick(&[0.01, 0.02, 0.04, 0.08]),
                normal_force_n: pick(&[0.1, 0.2, 0.4, 0.7]),
                direction: if pick(&[1.0, -1.0]) > 0.0 { Direction::Forward } else { Direction::Backward },
                time_s: 5.0 * i as f64,
                ..Condition::paper()
            };
            let noise = 0.01 * ((0..12).map(|_| uniform()).sum::<f64>() - 6.0);
            let force = lateral_force(&BASELINE, &active, &condition, &DESIGN) * (1.0 + noise);
            Pass::at(i, &condition, Some(force))
        })
        .collect()
}

fn diagnose(at: &Path, passes: &[Pass], rig: &str) -> (Option<i32>, String, String) {
    let mut bytes = Vec::new();
    write_passes(passes, &mut bytes).unwrap();
    std::fs::write(at.join("points.csv"), bytes).unwrap();
    std::fs::write(at.join("rig.toml"), rig).unwrap();
    let said =
        tests::muprime().current_dir(at).args(["diagnose", "points.csv", "--json", "--no-pairs"]).output();
    let said = said.unwrap();
    let (out, err) = tests::texts(&said);
    let err = err.split_whitespace().collect::<Vec<_>>().join(" ").replace("│ ", "");
    (said.status.code(), out, err)
}

/// The certificate that is blamed is that of the law which leads, by its own file and in its own words.
#[test]
fn the_certificate_at_fault_is_the_one_that_bounds_the_leading_law() {
    let folder = tempfile::tempdir().unwrap();
    let rig = format!(
        "{RIG}[calibration]\ncrosstalk_onto_normal_sd = 0.002\n\
         [calibration.certificates]\nforce = \"cell-7.toml\"\n"
    );
    let (code, out, err) = diagnose(folder.path(), &table("force_crosstalk", 1, &[0.15]), &rig);
    assert_eq!(code, Some(0), "{err}");
    let verdict: serde_json::Value = serde_json::from_str(&out).unwrap();
    assert_eq!(verdict["hypotheses"][0]["effects"][0], "force_crosstalk", "{out}");
    let fault = &verdict["certificates_at_fault"][0];
    assert_eq!(fault["certificate"], "force certificate (cell-7.toml)", "{out}");
    assert_eq!(fault["stated_sd"], 0.002);
    assert_eq!(fault["quantity"], "cross-talk of the lateral onto the normal force");
}

#[test]
fn absurd_values_are_refused_with_their_place_and_never_panic() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let good = table(
        "squeeze_film",
        0,
        &[0.0, 0.0][..effects::by_name("squeeze_film").unwrap().laws[0].parameters.len()],
    );
    for (from, to, says) in [
        ("stiffness_relative_sd = 0.05", "stiffness_relative_sd = 1e6", "stiffness_relative_sd"),
        ("pass_relative_sd = 0.01", "pass_relative_sd = inf", "pass_relative_sd"),
        ("force_sd_n = 0.0005", "force_sd_n = inf", "force_sd_n"),
        ("3.9e6", "1e300", "normal_stiffness_n_per_m"),
        ("[noise]", "[calibration]\nnormal_gain = 0.1\n[noise]", "normal_gain"),
    ] {
        let (code, _, err) = diagnose(at, &good, &RIG.replacen(from, to, 1));
        assert_eq!(code, Some(2), "{to}: {err}");
        assert!(err.contains(says) && err.contains("rig.toml"), "{to}: {err}");
    }
    let spoilt: [(&str, fn(&mut Pass)); 8] = [
        ("normal_force_n", |p| p.normal_force_n = 1e9),
        ("normal_force_n", |p| p.normal_force_n = 1e300),
        ("frequency_hz", |p| p.frequency_hz = 1e19),
        ("lateral_force_n", |p| p.lateral_force_n = Some(1e4)),
        ("lateral_force_n", |p| p.lateral_force_n = Some(1e200)),
        ("speed_m_s", |p| p.speed_m_s = 1e30),
        ("amplitude_pp_m", |p| p.amplitude = PeakToPeak::from_metres(2.0)),
        ("temperature_c", |p| p.temperature_c = Some(1e9)),
    ];
    for (column, spoil) in spoilt {
        let mut passes = good.clone();
        spoil(&mut passes[40]);
        let (code, out, err) = diagnose(at, &passes, RIG);
        assert_eq!(code, Some(2), "{column}: {out} {err}");
        // Line 42 holds the pass: the header is line 1.
        assert!(err.contains("line 42") && err.contains(column), "{column}: {err}");
    }
    // A ratio that no finger has, of two forces that a sensor may read.
    let mut passes = good;
    passes[40].lateral_force_n = Some(200.0);
    let (code, _, err) = diagnose(at, &passes, RIG);
    assert_eq!(code, Some(2), "{err}");
    assert!(err.contains("point 40") && err.contains("lateral_force_n"), "{err}");
}
