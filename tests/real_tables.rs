//! Measured tables of plain tribometers that others published, with what is known of them by other means. Their sources and licences
//! stand beside them in `tests/recordings`.

use diagnosis::data::{RigFile, Table};
use diagnosis::decision::Verdict;
use diagnosis::hypotheses::Options;
use diagnosis::verdict::{Report, diagnose};
use tests::file;

fn verdict_of(table: &str) -> Report {
    let path = file("tests/recordings").join(table);
    let passes = models::record::read_passes(std::fs::File::open(&path).unwrap()).unwrap();
    let rig = std::fs::read_to_string(path.with_file_name("rig.toml")).unwrap();
    let table = Table::measured(&passes).unwrap();
    let report = diagnose(&table, &RigFile::parse(&rig).unwrap(), &Options::default(), String::new()).report;
    println!("{}: {}", path.display(), report.text);
    report
}

/// Soft silicone on a hard plate: a fit outside this project gives the coefficient an exponent of -0.34 in the load over this
/// range, a soft sphere has -1/3 (mu ~ F^-1/3, contact area by Hertz).
#[test]
fn silicone_on_a_plate_is_named_by_its_load() {
    let report = verdict_of("silicone-load/points.csv");
    assert_eq!(report.verdict, Verdict::Named);
    let leader = &report.hypotheses[0];
    assert_eq!(leader.effects, ["load_dependent_friction"]);
    let exponent = &leader.parameters[0];
    println!("{} {} {:?}", exponent.name, exponent.value, exponent.ci95);
    assert!((-0.40..=-0.25).contains(&exponent.value), "{}", exponent.value);
    let [low, high] = exponent.ci95;
    assert!(low < -1.0 / 3.0 && -1.0 / 3.0 < high && low < -0.34 && -0.34 < high, "{low} {high}");
    assert!(report.gap.after_rmse.unwrap() < 0.1 * report.gap.recalibrated_rmse.unwrap());
}

/// Each load has runs of its own, and runs of one kind scatter: no friction law can be told from that.
#[test]
fn run_in_and_scatter_of_set_ups_name_no_law() {
    for table in ["pps", "pps_30ptfe", "pps_45ptfe"] {
        let report = verdict_of(&format!("pin-on-disk/{table}.csv"));
        assert_ne!(report.verdict, Verdict::Named, "{table}: {}", report.text);
        assert_ne!(report.verdict, Verdict::NoGap, "{table}: {}", report.text);
    }
}
