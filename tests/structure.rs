//! Departures that no smooth map follows: sudden, periodic or local ones. That scatter alone is none: tests/rough.rs.
use diagnosis::data::{RigFile, Table};
use diagnosis::{Options, Report, Verdict, diagnose};
use models::Pass;
use rayon::prelude::*;
use sim::sealed::rough::{Roughness, rough};
use std::f64::consts::PI;
use std::sync::Arc;

/// A table without a cause in the order of measurement, to which so many deviations of a pass are added where
/// a shape says so, against the motion.
fn with(seed: u64, deviations: f64, shape: &(dyn Fn(f64, &Pass) -> f64 + Sync), options: &Options) -> Report {
    let set = rough(seed, None, Roughness::Gaussian);
    let rig = RigFile::parse(&set.rig_toml).unwrap();
    let mut passes = set.passes;
    passes.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    let n = passes.len() as f64;
    for (i, p) in passes.iter_mut().enumerate() {
        let Some(force) = p.lateral_force_n else { continue };
        let sd = (rig.noise.pass_relative_sd * force).hypot(rig.noise.force_sd_n);
        p.lateral_force_n = Some(force + p.direction.sign() * sd * deviations * shape(i as f64 / n, p));
    }
    diagnose(&Table::measured(&passes).unwrap(), &rig, options, String::new()).report
}

fn quick() -> Options {
    Options { pairs: false, ..Options::default() }
}

/// How many of the tables with a departure are a gap that nothing names.
fn unknown(
    what: &str,
    tables: u64,
    deviations: f64,
    shape: &(dyn Fn(f64, &Pass) -> f64 + Sync),
    options: &Options,
) -> usize {
    (0..tables)
        .into_par_iter()
        .filter(|k| {
            let report = with(880_000 + k, deviations, shape, options);
            println!("{what} {k}: {:?} {} {:?}", report.verdict, report.text, report.remarks);
            assert_ne!(report.verdict, Verdict::Named, "{what}: {}", report.text);
            report.verdict == Verdict::Unknown
        })
        .count()
}

/// A spell of an eighth of the run, a period of a dozen passes, jumps to and fro, a spot of the plate: each a
/// gap of about one deviation of a pass.
#[test]
fn what_is_sudden_periodic_or_local_is_a_gap() {
    let spell = |t: f64, _: &Pass| f64::from(u8::from((0.55..0.675).contains(&t)));
    let period = |t: f64, _: &Pass| (2.0 * PI * t * 15.0).sin();
    let jumps = |t: f64, _: &Pass| if (t * 9.0).fract() < 0.5 { 0.5 } else { -0.5 };
    let spot = |_: f64, p: &Pass| f64::from(u8::from((0.008..0.0105).contains(&p.position_m)));
    // By default three tables where none or one of six may be missed.
    let few = tests::rounds(3, 6);
    for (what, deviations, tables, missed, shape) in [
        ("a spell", 2.5, few, tests::rounds(0, 1), &spell as &(dyn Fn(f64, &Pass) -> f64 + Sync)),
        ("a period", 1.4, few, 0, &period),
        ("jumps to and fro", 2.4, few, 0, &jumps),
        ("a spot", 3.0, 6, 2, &spot),
    ] {
        let found = unknown(what, tables, deviations, shape, &quick());
        println!("{what}: {found} of {tables}");
        assert!(found + missed >= tables as usize, "{what}: {found} of {tables}");
    }
    // Without that part of the open set the smooth map alone sees none of the periods.
    let mut blind = quick();
    Arc::make_mut(&mut blind.constants).set("structure_share", "1e-12").unwrap();
    let found = unknown("a period, smooth map alone", few, 1.4, &period, &blind);
    assert_eq!(found, 0);
}
