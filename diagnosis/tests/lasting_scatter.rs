//! Friction series cut into passes: noise that lasts is no gap, a law of the load between runs is one, and
//! structures are described as what they are.
use models::RigFile;
use models::pass::read_passes;
use muprime_diagnosis::verdict::Verdict;
use muprime_diagnosis::{Hypothesis, Options, Report, Table, diagnose};
use std::f64::consts::TAU;

/// What a series is made of: noise that lasts some ten passes, independent noise, and friction over speed
/// (mm/s), load (N) and time (s).
struct Series {
    lasting: f64,
    independent: f64,
    friction: fn(f64, f64, f64) -> f64,
    /// Whether the table says which run a pass is of.
    runs: bool,
}

/// Normal deviates of a linear congruential generator.
fn normal(state: &mut u64) -> f64 {
    let mut uniform = || {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*state >> 11) as f64 / (1u64 << 53) as f64
    };
    (0..12).map(|_| uniform()).sum::<f64>() - 6.0
}

/// Four runs at two loads, each with four speeds in rising order, a pass every ten seconds; the repeatability
/// is stated from neighbouring passes, as an import does where nobody says better.
fn report(series: &Series, seed: u64) -> Report {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    let mut csv =
        String::from("point,time_s,amplitude_pp_m,speed_m_s,direction,normal_force_n,lateral_force_n,run\n");
    let (mut time, mut point, mut last) = (0.0, 0, 0.0);
    let (mut squares, mut pairs, mut before) = (0.0, 0.0, None);
    for (run, load) in [3.0, 3.0, 9.0, 9.0].into_iter().enumerate() {
        for speed in [75.0, 150.0, 225.0, 300.0] {
            for _ in 0..16 {
                last = 0.905 * last + (1.0 - 0.905_f64.powi(2)).sqrt() * normal(&mut state);
                let noise = series.lasting * last + series.independent * normal(&mut state);
                let friction = (series.friction)(speed, load, time) * (1.0 + noise);
                let named = if series.runs { format!("r{run}") } else { String::new() };
                csv +=
                    &format!("{point},{time},0,{},1,{load},{:.6},{named}\n", speed / 1000.0, load * friction);
                if let Some(b) = before.replace(friction) {
                    let step: f64 = (friction / b).ln();
                    if step.abs() < 0.05 {
                        (squares, pairs) = (squares + step * step, pairs + 1.0);
                    }
                }
                (time, point) = (time + 10.0, point + 1);
            }
            time += 30.0;
        }
        time += 300.0;
    }
    let stated: f64 = (squares / pairs / 2.0_f64).sqrt();
    let rig = format!(
        "[finger]\nnormal_stiffness_n_per_m = 3.9e6\nlateral_stiffness_n_per_m = 1.5e6\nstiffness_relative_sd = 0.05\n\
         [noise]\npass_relative_sd = {stated}\nforce_sd_n = 0.009\n"
    );
    let table = Table::measured(&read_passes(csv.as_bytes()).unwrap()).unwrap();
    diagnose(&table, &RigFile::parse(&rig).unwrap(), &Options::default(), String::new()).report
}

/// Two per cent of noise that lasts, and nothing else: no gap in nearly all of some seeds, no name in any; and the recalibrated
/// baseline, which may take the nominal values, is not worse than the nominal one by more than its parameters cost.
#[test]
fn noise_that_lasts_is_no_gap() {
    let series = Series { lasting: 0.02, independent: 0.002, friction: |_, _, _| 0.17, runs: true };
    let reports: Vec<Report> = (1..=6).map(|seed| report(&series, seed)).collect();
    let none = reports.iter().filter(|r| r.verdict == Verdict::NoGap).count();
    assert!(none >= 5, "{:?}", reports.iter().map(|r| &r.text).collect::<Vec<_>>());
    for r in &reports {
        assert_ne!(r.verdict, Verdict::Named, "{}", r.text);
        let [before, recalibrated] = [r.gap.before_rmse, r.gap.recalibrated_rmse].map(Option::unwrap);
        assert!(recalibrated < 1.3 * before, "{recalibrated} {before}");
        assert!(r.scatter.serial_correlation > 0.6, "{}", r.scatter.serial_correlation);
    }
}

/// A factor that is constant within a run is no shift of runs where replicate runs agree far better: friction
/// that falls with the load is a gap, and the class of the causes that two loads do not part holds it.
#[test]
fn a_law_of_the_load_between_runs_is_a_gap() {
    let friction = |_: f64, load: f64, _: f64| 0.17 * (load / 5.0).powf(-0.2);
    for seed in 1..=3 {
        let r = report(&Series { lasting: 0.0, independent: 0.004, friction, runs: true }, seed);
        assert_eq!(r.verdict, Verdict::Ambiguous, "{}", r.text);
        let class = &r.hypotheses[0].alias_class;
        assert!(class.iter().any(|n| n == "load_dependent_friction"), "{class:?}");
    }
}

/// Rate and load together, under noise that lasts: the rate is sure in most seeds (its probability is near
/// that of a name), and something that goes with the load.
#[test]
fn rate_and_load_are_found_under_noise_that_lasts() {
    let friction =
        |speed: f64, load: f64, _: f64| 0.17 * (speed / 150.0).powf(0.16) * (load / 5.0).powf(-0.2);
    let reports: Vec<Report> = (1..=3)
        .map(|s| report(&Series { lasting: 0.02, independent: 0.002, friction, runs: true }, s))
        .collect();
    let sure = reports.iter().filter(|r| r.at_least == ["rate_dependent_friction"]).count();
    assert!(sure >= 2, "{:?}", reports.iter().map(|r| &r.text).collect::<Vec<_>>());
    for r in &reports {
        let with = |h: &&Hypothesis| h.effects.iter().any(|e| e == "rate_dependent_friction");
        let rate: f64 = r.hypotheses.iter().filter(with).map(|h| h.probability).sum();
        assert!(rate > 0.85, "{}", r.text);
        let class = &r.hypotheses[0].alias_class;
        assert!(class.iter().any(|n| n == "rate_dependent_friction+load_dependent_friction"), "{class:?}");
        let [before, recalibrated] = [r.gap.before_rmse, r.gap.recalibrated_rmse].map(Option::unwrap);
        assert!(recalibrated < 1.3 * before, "{recalibrated} {before}");
    }
}

/// A jump in time and a period are unknown, and described with their place and size.
#[test]
fn a_jump_and_a_period_are_described() {
    let jump = |_: f64, _: f64, time: f64| if time > 1500.0 { 0.17 * 1.1 } else { 0.17 };
    let r = report(&Series { lasting: 0.0, independent: 0.01, friction: jump, runs: false }, 1);
    assert_eq!(r.verdict, Verdict::Unknown, "{}", r.text);
    let d = &r.description[0];
    assert_eq!(
        (serde_json::to_value(d.structure).unwrap(), d.covariate),
        ("jump".into(), "time_s"),
        "{}",
        d.text
    );
    assert!((d.at - 1500.0).abs() < 150.0 && (d.size - 0.1).abs() < 0.02, "{}", d.text);
    let wave = |_: f64, _: f64, time: f64| 0.17 * (1.0 + 0.03 * (TAU * time / 310.0).sin());
    let r = report(&Series { lasting: 0.0, independent: 0.006, friction: wave, runs: false }, 2);
    assert_eq!(r.verdict, Verdict::Unknown, "{}", r.text);
    let d = &r.description[0];
    assert_eq!(
        (serde_json::to_value(d.structure).unwrap(), d.covariate),
        ("period".into(), "time_s"),
        "{}",
        d.text
    );
    assert!((d.at - 310.0).abs() < 10.0 && (d.size.abs() - 0.03).abs() < 0.01, "{}", d.text);
}
