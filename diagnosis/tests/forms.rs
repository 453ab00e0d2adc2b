//! Causes in a formula that the library does not have, by tests/peers/third_generator.py (`--seed 36113007`
//! unless said), which marches a spring-slider over the cycle and shares no code with this project.

use models::RigFile;
use models::pass::{Pass, read_passes};
use muprime_diagnosis::report::document::predictions;
use muprime_diagnosis::report::unstated_covariates::Unstated;
use muprime_diagnosis::verdict::Verdict;
use muprime_diagnosis::{Hypothesis, Options, Report, Table, diagnose};
use rayon::prelude::*;
use std::path::Path;

/// A standing wave of a disc's rings and a drive that folds back close 0.65 and 0.52 of the gap on left-out
/// regions, as mimics of strangers do. They lead all descriptions without a cause by 95 nats; mimics do not.
#[test]
fn evidence_far_ahead_of_any_other_description_makes_up_for_a_foreign_form() {
    named(&["mode_shape", "amplitude_saturation"]);
}

/// A dashpot of the square, a recovery faster the further, a Stribeck curve over speed by load: `unknown`, unsure and
/// two causes before the library's laws had a power or a share for it.
#[test]
fn a_cause_in_another_formula_is_named() {
    named(&["normal_damping", "lateral_recovery", "rate_dependent_friction"]);
}

/// Ridges whose mass lies within soft skin and menisci above a humidity (tests/peers/fourth_generator.py,
/// `--seed 41112903`, sets 87 and 29): `unknown` and a pair before the laws knew these.
#[test]
fn a_cause_of_data_sheets_is_named() {
    named(&["ridge_inertia", "adhesion"]);
}

/// A cable that pulls the stage one way (fifth_generator.py, `--seed 51112801`, set 67). Friction depends on
/// the stiffness times the speed: a finger that is stiffer one way does the same. It was named as a speed.
#[test]
fn a_speed_by_direction_is_not_named_before_a_stiffness_by_direction() {
    let answer = report("speed_error", &Options::default());
    assert_eq!(answer.verdict, Verdict::Ambiguous);
    let mut lead: Vec<&str> = answer.hypotheses[..2].iter().map(|h| h.effects[0].as_str()).collect();
    lead.sort_unstable();
    assert_eq!(lead, ["speed_error", "stiffness_error"]);
}

/// Skin with a grain whose springs are both wrong (fifth_generator.py, `--seed 51112902`, set 192): a
/// stiffness and a speed by direction at 0.99, while no law of the stiffness was of the direction beside
/// the rest.
#[test]
fn a_grain_beside_wrong_springs_is_one_cause() {
    named(&["stiffness_error.grain"]);
}

/// A stiffness that follows the pad's angle along the plate (sixth_generator.py, `--seed 61112801`, set 114)
/// was a pair with a standing wave; a zero tared before each run (fifth_generator.py, `--seed 51112902`, set
/// 58) was ambiguous. Sizes were no functions of the place then, and functions of time no others in each run.
#[test]
fn a_cause_whose_size_goes_with_the_place_or_the_run_is_named() {
    named(&["stiffness_error", "lateral_offset_drift"]);
}

/// Sweat that comes as the skin warms, in skin that relaxes (sixth_generator.py, `--seed 61112902`, set 12):
/// ambiguous, while the size of a pair's member was no function of the weather.
#[test]
fn a_pair_of_which_a_size_goes_with_the_weather_is_named() {
    named(&["moisture_drift+subsurface_relaxation"]);
}

/// A plate of rings with a pick-up that has a floor (`--seed 36113231`, set 122): one law of rings with a
/// function beside it leaves no more than scatter does, and was named alone. By its law it leaves 17
/// deviations, and two causes are 44 nats ahead.
#[test]
fn what_a_bent_law_takes_up_is_sought_as_a_second_cause() {
    named(&["amplitude_miscalibration+mode_shape"]);
}

/// Sebum that thins as the rig warms while it runs (sixth_generator.py, `--seed 61120103`, set 40): a damping
/// and a detuning at 0.989, while weather that goes with time was none that a size goes with.
/// It predicts no condition that does not state the temperature.
#[test]
fn a_size_goes_with_weather_that_goes_with_time() {
    named(&["normal_damping.warm"]);
    let why = refused("normal_damping.warm", |p| Pass { temperature_c: None, ..p });
    assert_eq!((why.column, why.by.as_str()), ("temperature_c", "the size of normal_damping"));
}

/// A cause that is named may be one of two, the other too small to be weighed: each such pair has a
/// probability, and none does where pairs are not tried.
#[test]
fn a_pair_that_was_not_weighed_is_not_impossible() {
    let alone = |h: &&Hypothesis| h.effects.len() == 1 && h.effects[0] != "unknown";
    let with = report("speed_error", &Options::default());
    let leader = &with.hypotheses[0].effects[0];
    for other in with.hypotheses.iter().filter(alone).map(|h| &h.effects[0]).filter(|o| *o != leader) {
        let pair =
            |h: &&Hypothesis| h.effects.len() == 2 && [leader, other].iter().all(|n| h.effects.contains(n));
        let stated = with.hypotheses.iter().find(pair).map_or(0.0, |h| h.probability);
        assert!(effects::one_cause(leader, other) || stated > 1e-5, "{leader} and {other}: {stated:e}");
    }
    let singles = report("speed_error", &Options { pairs: false, ..Options::default() });
    assert!(singles.hypotheses.iter().all(|h| h.effects.len() < 2));
    for report in [with, singles] {
        assert!((report.hypotheses.iter().map(|h| h.probability).sum::<f64>() - 1.0).abs() < 1e-12);
    }
}

/// Two pulleys that beat were named as a ripple and a standing wave, which leave 16 deviations of chi2; the
/// same sebum (sets 180 and 135) as a damping and a detuning, beside a damping by temperature that leaves none.
#[test]
fn two_causes_that_leave_a_misfit_or_that_one_replaces_are_not_named() {
    for set in ["speed_ripple.two_pulleys", "normal_damping.warm_runs"] {
        let (verdict, text, effects) = diagnosed(set);
        assert_ne!(verdict, Verdict::Named, "{text}");
        assert_eq!(effects.len(), 2, "{text}");
    }
    let report = report("speed_ripple.two_pulleys", &Options::default());
    assert!(
        report.remarks.iter().any(|r| r.starts_with("The leading pair leaves a misfit")),
        "{}",
        report.text
    );
    assert!(report.text.contains("leaves a misfit and is not named") && !report.text.contains("too low"));
    assert!(report.at_least.is_empty(), "{:?}", report.at_least);
}

/// Friction that jumps at a speed (tests/peers/fourth_generator.py, `--seed 41112802`, set 196): a function of
/// the speed bends to it, and rate dependence was named. The law alone takes up a third of the gap.
#[test]
fn a_jump_is_no_cause_whose_function_bends_to_it() {
    let (verdict, text, _) = diagnosed("jump_over_speed");
    assert_ne!(verdict, Verdict::Named, "{text}");
}

/// A lateral gain that falls by a tenth in the session, at two loads (a massless slider in Python, no code of the
/// library): nearly a load offset that falls as well, which was the likeliest answer.
#[test]
fn a_drifting_gain_is_no_offset_of_the_load() {
    let (verdict, text, effects) = diagnosed("gain_drift");
    assert_eq!((verdict, effects), (Verdict::Unknown, vec!["unknown".to_string()]), "{text}");
    assert!(text.contains("gain drift"), "{text}");
}

/// A force against the sliding beside the contact, 10 mN or 0.15 N s/m (a massless slider in Python, no
/// code of the library; speed and load are true in every pass): an offset of the load with a wrong speed at
/// 0.94, and 'at least' a friction that depends on the rate.
#[test]
fn a_drag_beside_the_contact_is_no_cause_of_the_library() {
    for set in ["drag.constant", "drag.viscous"] {
        let report = report(set, &Options::default());
        assert_eq!(report.verdict, Verdict::Unknown, "{}", report.text);
        assert!(report.text.contains("not in the library: drag"), "{}", report.text);
        assert!(report.at_least.is_empty(), "{:?}", report.at_least);
    }
}

/// Menisci pull by the humidity: a condition that does not state one is refused, with the law and the column.
#[test]
fn a_law_of_humidity_predicts_no_condition_without_one() {
    let why = refused("adhesion", |p| Pass { relative_humidity_pct: None, ..p });
    assert_eq!((why.point, why.column), (passes("adhesion")[0].point, "relative_humidity_pct"));
    assert!(why.by.starts_with("adhesion by its law"), "{why}");
}

/// Why a set's verdict does not predict its passes with something left out; as they are it does.
fn refused(set: &str, without: fn(Pass) -> Pass) -> Unstated {
    let passes = passes(set);
    let table = Table::measured(&passes).unwrap();
    let rig = RigFile::parse(&text(set, "rig.toml")).unwrap();
    let result = diagnose(&table, &rig, &Options::default(), String::new());
    assert!(predictions(&result, &table).is_ok());
    let without: Vec<Pass> = passes.iter().cloned().map(without).collect();
    predictions(&result, &Table::conditions(&without, &table.origin(&passes)).unwrap()).unwrap_err()
}

/// A cause that is left out of the library does not come back in the place of its exact alias in a pair.
#[test]
fn what_is_left_out_is_no_member_of_a_pair() {
    let without = || Options { without: vec!["stiffness_error".into()], ..Options::default() };
    for (options, tried) in [(Options::default(), true), (without(), false)] {
        let report = report("amplitude_miscalibration+mode_shape", &options);
        let among = report.hypotheses.iter().any(|h| h.effects.iter().any(|e| e == "stiffness_error"));
        assert_eq!(among, tried, "{}", report.text);
    }
}

/// One pass of 98 is off by 17 deviations, and no cause acts (`--seed 29129001`, set 151). A surface bends to a
/// pass that lies apart: it was a gap of an unknown cause at 0.84.
#[test]
fn isolated_bad_passes_are_no_gap() {
    let report = report("no_gap.bad_passes", &Options::default());
    assert_eq!(report.verdict, Verdict::NoGap, "{}", report.text);
    let suspects: Vec<u64> = report.scatter.suspects.iter().map(|s| s.point).collect();
    assert_eq!(suspects, [47], "{:?}", report.remarks);
}

/// Of each set the cause, which comes before a dot in its name.
fn named(sets: &[&str]) {
    sets.par_iter().for_each(|set| {
        let cause = set.split('.').next().unwrap();
        let (verdict, text, mut effects) = diagnosed(set);
        assert_eq!(verdict, Verdict::Named, "{cause}: {text}");
        assert!(!text.replace(" + ", " ").contains('+'), "a pair is not written as one word: {text}");
        effects.sort_unstable();
        assert_eq!(effects.join("+"), cause, "{text}");
    });
}

/// Verdict, text and first hypothesis of a set.
fn diagnosed(set: &str) -> (Verdict, String, Vec<String>) {
    let report = report(set, &Options::default());
    (report.verdict, report.text.clone(), report.hypotheses[0].effects.clone())
}

fn report(set: &str, options: &Options) -> Report {
    let passes = passes(set);
    let table = Table::measured(&passes).unwrap();
    let rig = RigFile::parse(&text(set, "rig.toml")).unwrap();
    diagnose(&table, &rig, options, String::new()).report
}

fn passes(set: &str) -> Vec<Pass> {
    read_passes(text(set, "train.csv").as_bytes()).unwrap()
}

fn text(set: &str, name: &str) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/forms").join(set);
    std::fs::read_to_string(folder.join(name)).unwrap()
}
