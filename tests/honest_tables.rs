//! What a verdict must not depend on: the unit of force, where a run was split, a table handed over twice;
//! and what two levels of a factor can say.
use diagnosis::data::{RigFile, Table};
use diagnosis::{Options, Report, Verdict, diagnose};
use models::Pass;
use rayon::prelude::*;
use sim::defects::DefectKind;
use sim::sealed::rough::{RoughSet, Roughness, rough};

const CAUSES: [&str; 4] = ["squeeze_film", "load_dependent_friction", "lateral_offset_drift", "adhesion"];

fn set(seed: u64, cause: &str) -> RoughSet {
    rough(seed, Some(DefectKind::named(cause).unwrap()), Roughness::Gaussian)
}

fn report(passes: &[Pass], rig: &RigFile) -> Report {
    let quick = Options { pairs: false, ..Options::default() };
    diagnose(&Table::measured(passes).unwrap(), rig, &quick, String::new()).report
}

fn times(passes: &[Pass], rig: &RigFile, factor: f64) -> (Vec<Pass>, RigFile) {
    let (mut passes, mut rig) = (passes.to_vec(), rig.clone());
    for p in &mut passes {
        p.normal_force_n *= factor;
        for force in [&mut p.lateral_force_n, &mut p.normal_force_sd_n, &mut p.lateral_force_sd_n] {
            *force = force.map(|f| f * factor);
        }
    }
    rig.finger.normal_stiffness_n_per_m *= factor;
    rig.finger.lateral_stiffness_n_per_m *= factor;
    rig.noise.force_sd_n *= factor;
    for sd in [&mut rig.calibration.lateral_offset_sd_n, &mut rig.calibration.normal_offset_sd_n] {
        *sd = sd.map(|sd| sd * factor);
    }
    (passes, rig)
}

/// All forces and stiffnesses times one factor, as of a pin in the place of a finger, or of grams in the place of newtons: the same
/// verdict, and parameters that have the unit of a force are so many times as large.
#[test]
fn a_verdict_does_not_depend_on_the_scale_of_the_forces() {
    CAUSES.par_iter().for_each(|cause| {
        let set = set(52, cause);
        let rig = RigFile::parse(&set.rig_toml).unwrap();
        let own = report(&set.passes, &rig);
        for &factor in &[0.02, 100.0, 7.3][..tests::rounds(2, 3)] {
            let (passes, rig) = times(&set.passes, &rig, factor);
            let scaled = report(&passes, &rig);
            assert_eq!(scaled.verdict, own.verdict, "{cause} times {factor}: {} / {}", own.text, scaled.text);
            let (a, b) = (&own.hypotheses[0], &scaled.hypotheses[0]);
            assert_eq!((&a.effects, &a.laws), (&b.effects, &b.laws), "{cause} times {factor}");
            // Searches stop where a round gains little, not at the same digit: up to 3e-3 apart on these tables.
            let apart = (a.probability - b.probability).abs();
            assert!(apart < 5e-3, "{cause} times {factor}: {} {}", a.probability, b.probability);
            for (p, q) in a.parameters.iter().zip(&b.parameters) {
                let grown = match p.unit {
                    "N" => factor,
                    "1/N" => 1.0 / factor,
                    _ => 1.0,
                };
                let reach = 0.02 * (p.ci95[1] - p.ci95[0]).abs() * grown;
                assert!((p.value * grown - q.value).abs() <= reach, "{cause} times {factor}: {p:?} {q:?}");
            }
        }
    });
}

/// A run that was interrupted and resumed stands as two sessions: the verdict is the same.
#[test]
fn a_run_that_was_split_keeps_its_verdict() {
    CAUSES.par_iter().for_each(|cause| {
        let set = set(53, cause);
        let rig = RigFile::parse(&set.rig_toml).unwrap();
        let own = report(&set.passes, &rig);
        let mut split = set.passes.clone();
        let half = split.len() / 2;
        split.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        for (i, p) in split.iter_mut().enumerate() {
            p.session = Some(1 + u64::from(i >= half));
        }
        let after = report(&split, &rig);
        assert_eq!(after.verdict, own.verdict, "{cause}: {} / {}", own.text, after.text);
        assert_eq!(after.hypotheses[0].effects, own.hypotheses[0].effects, "{cause}");
    });
}

/// A table that was appended to itself holds no more than once: it is refused with the rows that stand twice.
#[test]
fn a_table_that_holds_passes_twice_is_refused() {
    let set = set(54, "squeeze_film");
    let mut twice = set.passes.clone();
    let most = twice.iter().map(|p| p.point).max().unwrap();
    twice.extend(set.passes.iter().map(|p| Pass { point: p.point + most + 1, ..p.clone() }));
    let why = Table::measured(&twice).unwrap_err().to_string();
    assert!(why.contains("one reading") && why.contains(&format!("{}", set.passes[0].point)), "{why}");
}

/// With two levels of the load a law of load is told still, no other takes its place, and it is said that a third level is missing.
#[test]
fn two_levels_of_a_factor_are_said() {
    CAUSES.par_iter().for_each(|cause| {
        let set = set(55, cause);
        let rig = RigFile::parse(&set.rig_toml).unwrap();
        let near = |load: f64, p: &Pass| (p.normal_force_n / load).ln().abs() < 0.2;
        let two: Vec<Pass> = set.passes.iter().filter(|p| near(0.25, p) || near(0.8, p)).cloned().collect();
        let said = report(&two, &rig);
        println!("{cause}: {} {:?}", said.text, said.remarks);
        let named = said.verdict == Verdict::Named;
        assert!(!named || said.hypotheses[0].effects == [*cause], "{cause}: {}", said.text);
        if *cause == "load_dependent_friction" {
            assert!(
                said.remarks.iter().any(|r| r.contains("Two levels only")),
                "{cause}: {:?}",
                said.remarks
            );
        }
    });
}
