//! What a certificate leaves open bounds the prior of what it certifies, and nothing else.
use models::rig_file::{CertifiedKey, RigFile};
use models::{Condition, Direction, Pass, PeakToPeak};
use muprime_diagnosis::Table;
use muprime_diagnosis::regression::fit::{Member, Problem};
use std::sync::Arc;

/// The forces do not matter for a prior.
fn table() -> Table {
    let passes: Vec<Pass> = (0..24i32)
        .map(|i| {
            let condition = Condition {
                amplitude: PeakToPeak::from_metres(f64::from(i % 4) * 1e-6),
                direction: if i % 2 == 0 { Direction::Forward } else { Direction::Backward },
                time_s: f64::from(i),
                ..Condition::paper()
            };
            Pass::at(u64::from(i.unsigned_abs()), &condition, Some(0.1 * condition.direction.sign()))
        })
        .collect();
    Table::measured(&passes).expect("a table")
}

fn problem(calibration: &str) -> Problem {
    let text = format!(
        "[finger]\nnormal_stiffness_n_per_m = 3.9e6\nlateral_stiffness_n_per_m = 1.5e6\n\
         stiffness_relative_sd = 0.05\n[calibration]\n{calibration}\n"
    );
    Problem::new(&table(), &RigFile::parse(&text).expect("a rig.toml"), &Arc::default())
}

/// Prior deviation of the size of a law, in the law's unit.
fn size_sd(problem: &Problem, effect: &str, law: usize) -> f64 {
    let index = effects::library().iter().position(|e| e.name == effect).expect("an effect");
    let member = Member { effect: index, law };
    let precision = problem.prior_precision(&[member]);
    let effects::Prior::Normal(wide) = member.parameters(&problem.design)[0].prior else {
        panic!("a signed size")
    };
    wide / precision[3].sqrt()
}

#[test]
fn a_calibrated_zero_and_a_speed_bound_what_they_certify() {
    let open = problem("");
    for (key, effect) in [
        ("normal_offset_sd_n", "normal_offset"),
        ("lateral_offset_sd_n", "lateral_offset_drift"),
        ("speed_gain_sd", "speed_error"),
        ("amplitude_gain_sd", "amplitude_miscalibration"),
        ("tilt_sd_rad", "plate_tilt"),
        ("crosstalk_sd", "force_crosstalk"),
    ] {
        let bound = problem(&format!("{key} = 0.0004"));
        let (free, certified) = (size_sd(&open, effect, 0), size_sd(&bound, effect, 0));
        assert!(free >= 0.008, "{key}: {free}");
        assert!((certified / 0.0004 - 1.0).abs() < 1e-9, "{key}: {certified}");
    }
}

/// A normal force read by a factor g is a normal stiffness wrong by g and a mu0 wrong by 1/g, exactly: what
/// the dead weight left open of g is what recalibration may move beside the finger's own uncertainty.
#[test]
fn a_certified_gain_of_either_axis_is_part_of_the_recalibration() {
    assert_eq!(problem("").prior_sd[1..], [0.05, 0.05]);
    let normal = problem("normal_gain_sd = 0.12").prior_sd;
    assert!((normal[1] - 0.13).abs() < 1e-12 && normal[2] == 0.05, "{normal:?}");
    let lateral = problem("lateral_gain_sd = 0.12").prior_sd;
    assert!((lateral[2] - 0.13).abs() < 1e-12 && lateral[1] == 0.05, "{lateral:?}");
}

/// Every key that rig.toml may hold moves a prior.
#[test]
fn every_key_bounds_something() {
    let shape = |p: &Problem| (p.prior_sd, p.certified.clone());
    let open = shape(&problem(""));
    for key in CertifiedKey::ALL {
        let bound = shape(&problem(&format!("{} = 0.001", key.name())));
        assert!(bound != open, "{} bounds nothing", key.name());
    }
}

/// A certificate that states an uncertainty of nothing leaves numbers to compute with.
#[test]
fn an_exact_certificate_leaves_a_finite_prior() {
    let exact = problem("normal_offset_sd_n = 0.0\ncrosstalk_sd = 0.0");
    for effect in ["normal_offset", "force_crosstalk"] {
        let sd = size_sd(&exact, effect, 0);
        assert!(sd > 0.0 && sd < 1e-6, "{effect}: {sd}");
    }
}
