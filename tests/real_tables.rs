//! Measured tables of plain tribometers that others published, with what is known of them by other means.
//! Their sources and licences stand beside them in `tests/recordings`.

use diagnosis::data::{RigFile, Table};
use diagnosis::verdict::Verdict;
use diagnosis::{Diagnosis, Options, Report, diagnose};
use models::Pass;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use tests::file;

fn passes_of(table: &str) -> Vec<Pass> {
    let path = file("tests/recordings").join(table);
    models::pass::read_passes(std::fs::File::open(&path).unwrap()).unwrap()
}

fn diagnosis_of(table: &str, passes: &[Pass]) -> Diagnosis {
    let path = file("tests/recordings").join(table).with_file_name("rig.toml");
    let rig = RigFile::parse(&std::fs::read_to_string(path).unwrap()).unwrap();
    diagnose(&Table::measured(passes).unwrap(), &rig, &Options::default(), String::new())
}

fn verdict_of(table: &str) -> Report {
    let report = diagnosis_of(table, &passes_of(table)).report;
    println!("{table}: {}", report.text);
    report
}

/// Soft silicone on a hard plate: a fit outside this project gives the coefficient an exponent of -0.34 in
/// the load over this range, a soft sphere has -1/3 (mu ~ F^-1/3, contact area by Hertz).
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

/// Friction of rocks at two speeds, a step between them. `a - b`, the change of the steady coefficient with the logarithm of speed,
/// is had from the windows by plain regression; over its mean it is the exponent of a power law of speed.
fn steady_slope(table: &str) -> (f64, f64) {
    let rows: Vec<(f64, f64)> = passes_of(table)
        .iter()
        .map(|p| (p.speed_m_s.ln(), p.lateral_force_n.unwrap() / p.normal_force_n))
        .collect();
    let n = rows.len() as f64;
    let (x, y) = rows.iter().fold((0.0, 0.0), |(x, y), r| (x + r.0 / n, y + r.1 / n));
    let slope = rows.iter().map(|r| (r.0 - x) * (r.1 - y)).sum::<f64>()
        / rows.iter().map(|r| (r.0 - x).powi(2)).sum::<f64>();
    (slope, y)
}

/// Sepiolite from 0.2 to 2 um/s: a - b is +0.020 on a coefficient of 0.478. Time and speed go together in a
/// record with one step; what speaks for speed is that the change is sudden, and the diagnosis remarks on it.
#[test]
fn a_rock_that_strengthens_with_speed_is_named_with_its_slope() {
    let table = "rock-velocity-steps/sepiolite.csv";
    let (slope, mean) = steady_slope(table);
    assert!((slope - 0.0201).abs() < 2e-4, "{slope}");
    let report = verdict_of(table);
    assert_eq!(report.verdict, Verdict::Named);
    let leader = &report.hypotheses[0];
    assert_eq!(leader.effects, ["rate_dependent_friction"]);
    let exponent = &leader.parameters[0];
    println!("a - b {slope:.5}; {} {} {:?}", exponent.name, exponent.value, exponent.ci95);
    assert_eq!(exponent.name, "exponent");
    let [low, high] = exponent.ci95;
    assert!(low < slope / mean && slope / mean < high, "{} in {low} to {high}", slope / mean);
    assert!(low > 0.0, "{low}");
    assert!(
        report.remarks.iter().any(|r| r.contains("speed and time change together")),
        "{:?}",
        report.remarks
    );
}

/// Basalt from 3 to 10 um/s: a - b is +0.0005, 0.1 % over the step, and friction creeps by as much on either
/// side of it. That is below the repeatability that is stated: no gap.
#[test]
fn a_rock_that_does_not_care_for_speed_has_no_gap() {
    let table = "rock-velocity-steps/basalt.csv";
    let (slope, mean) = steady_slope(table);
    assert!(slope.abs() < 1e-3, "{slope}");
    let report = verdict_of(table);
    assert_eq!(report.verdict, Verdict::NoGap);
    let rate = report.hypotheses.iter().find(|h| h.effects == ["rate_dependent_friction"]);
    if let Some(exponent) = rate.and_then(|h| h.parameters.iter().find(|p| p.name == "exponent")) {
        println!("a - b {slope:.5}; {} {} {:?}", exponent.name, exponent.value, exponent.ci95);
        let [low, high] = exponent.ci95;
        assert!(low < slope / mean && slope / mean < high, "{} in {low} to {high}", slope / mean);
    }
}

/// How held-out passes are predicted: errors as shares of the measured force, root mean squares.
struct HeldOut {
    before: f64,
    after: f64,
    /// Share of the passes inside their 95 % predictive interval.
    coverage: f64,
}

/// Diagnoses the passes that are not held out and predicts the others.
fn predicted(table: &str, held: impl Fn(usize, usize) -> bool, what: &str) -> HeldOut {
    let mut passes = passes_of(table);
    passes.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    let count = passes.len();
    let at = |wanted: bool| -> Vec<Pass> {
        passes.iter().enumerate().filter(|(i, _)| held(*i, count) == wanted).map(|(_, p)| p.clone()).collect()
    };
    let (kept, hidden) = (at(false), at(true));
    let result = diagnosis_of(table, &kept);
    let origin = Table::measured(&kept).unwrap().origin(&kept);
    let conditions = Table::conditions(&hidden, &origin).unwrap();
    let (mut before, mut after, mut inside) = (0.0, 0.0, 0.0);
    for (point, forecast) in conditions.points.iter().zip(result.predict(&conditions).unwrap()) {
        let force = hidden.iter().find(|p| p.point == *point).unwrap().lateral_force_n.unwrap();
        before += ((forecast.baseline - force) / force).powi(2);
        after += ((forecast.in_run - force) / force).powi(2);
        inside += f64::from((forecast.in_run - force).abs() <= 1.96 * forecast.in_run_sd);
    }
    let n = hidden.len() as f64;
    let held_out = HeldOut { before: (before / n).sqrt(), after: (after / n).sqrt(), coverage: inside / n };
    let HeldOut { before, after, coverage } = held_out;
    let leader = result.report.hypotheses[0].effects.join("+");
    let verdict = result.report.verdict;
    println!(
        "{table}, {what}: {verdict:?} {leader}, {n} passes, before {before:.4}, after {after:.4}, coverage {coverage:.3}"
    );
    held_out
}

/// One of every five passes, at random.
fn at_random(table: &str) -> HeldOut {
    let mut rng = ChaCha8Rng::seed_from_u64(20_261_122);
    let picks: Vec<usize> = (0..passes_of(table).len() / 5).map(|_| (rng.next_u32() % 5) as usize).collect();
    predicted(table, |i, _| picks.get(i / 5) == Some(&(i % 5)), "one in five")
}

/// The last quarter by time: larger loads on silicone, a set-up of its own on the disk.
fn late(table: &str) -> HeldOut {
    predicted(table, |i, count| i >= count - count / 4, "last quarter")
}

#[test]
fn held_out_passes_lie_in_their_intervals() {
    for table in ["silicone-load/points.csv", "rock-velocity-steps/sepiolite.csv"] {
        for held_out in [at_random(table), late(table)] {
            assert!(held_out.after < held_out.before, "{table}: {} {}", held_out.before, held_out.after);
            assert!((0.80..=1.0).contains(&held_out.coverage), "{table}: {}", held_out.coverage);
        }
    }
    // No gap: the corrected model is the recalibrated one, and on a plate that stands still that is the baseline.
    for held_out in [at_random("rock-velocity-steps/basalt.csv"), late("rock-velocity-steps/basalt.csv")] {
        assert!(
            held_out.after < 0.005 && held_out.coverage >= 0.80,
            "{} {}",
            held_out.after,
            held_out.coverage
        );
    }
}

/// Passes of runs that were fitted are predicted. The last quarter is a run that the fit has nothing of, or six passes: its intervals
/// are too narrow by far (0.06 to 0.57 of it inside), so its figures are printed and nothing is claimed of them.
#[test]
fn passes_among_scattered_runs_lie_in_their_intervals() {
    for table in ["pps", "pps_30ptfe", "pps_45ptfe"] {
        let table = format!("pin-on-disk/{table}.csv");
        let held_out = at_random(&table);
        assert!(held_out.after < held_out.before, "{table}: {} {}", held_out.before, held_out.after);
        assert!((0.80..=1.0).contains(&held_out.coverage), "{table}: {}", held_out.coverage);
        late(&table);
    }
}

/// Every command of the page is run, and each of its lines stands at the beginning of a line that the command prints.
#[test]
fn the_worked_example_prints_what_its_page_says() {
    let page = std::fs::read_to_string(file("docs/diagnosis/example.md")).unwrap();
    let blocks: Vec<&str> =
        page.split("```console\n").skip(1).map(|b| b.split("```").next().unwrap()).collect();
    assert_eq!(blocks.len(), 4);
    for block in blocks {
        let (command, wanted) = block.split_once('\n').unwrap();
        let arguments = command.strip_prefix("$ muprime ").unwrap().split(' ');
        let output = tests::muprime().args(arguments).current_dir(file("")).output().unwrap();
        let (printed, said) = tests::texts(&output);
        assert!(output.status.success(), "{command}: {said}");
        for line in wanted.lines() {
            assert!(
                printed.lines().any(|l| l.starts_with(line)),
                "{command}: '{line}' is not printed:\n{printed}"
            );
        }
    }
}

/// A Gauss-Newton step that went too far ended the search for the end of an interval: it was 0.375 to 0.794
/// about 0.378. A profile outside this project reaches a chi2 of 3.4 at 0.20.
#[test]
fn an_interval_does_not_end_where_a_step_goes_too_far() {
    let report = verdict_of("slider-crosstalk-drift/points.csv");
    let leader = &report.hypotheses[0];
    assert!(leader.effects.iter().any(|effect| effect == "force_crosstalk"), "{:?}", leader.effects);
    let change = leader.parameters.iter().find(|p| p.name == "relative_change").expect("a relative change");
    assert!(change.ci95[0] < 0.25 && change.ci95[0] > 0.1, "{:?}", change.ci95);
}
