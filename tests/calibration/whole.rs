//! A whole calibration with the real program (force by dead weights, amplitude by a vibrometer), then a sweep, then
//! `diagnose`: what the instruments did before is gone from the verdict, or named with the certificate at fault.

use crate::amplitude::Bench;
use crate::bench::seed;
use crate::closing::{COUNT_N, muprime, series_in_counts, verdict};
use sim::defects::Defects;
use sim::world::WorldConfig;
use std::fmt::Write as _;
use std::path::Path;

const CROSSTALK: &str = "[[defect]]
name = \"force_crosstalk\"
parameters = { lateral_per_normal = 0.08, normal_per_lateral = 0.01 }
";
const AMPLITUDE: &str = "[[defect]]
name = \"amplitude_miscalibration\"
parameters = { factor = 1.3 }
";

/// A vibrometer table of the withheld plate; `range_error` is a range that was read off wrongly.
fn table(defects: &str, range_error: f64) -> String {
    let mut config = WorldConfig { defects: Defects::parse(defects).unwrap(), ..WorldConfig::ideal() };
    config.plate.warming_k = 0.0;
    let frequency_hz = 27_500.0;
    config.plate.resonance_hz = frequency_hz;
    let mut bench = Bench::new(&config, seed(0));
    let mut text = String::from("set_point_pp_m,amplitude_pp_m\n");
    for k in 1..=8 {
        let set = f64::from(k) * 0.4e-6;
        for _ in 0..3 {
            let seen = range_error * bench.measure(set, frequency_hz, 0.0, 0.0);
            let _ = writeln!(text, "{set:e},{seen:e}");
        }
    }
    text
}

fn write(at: &Path, name: &str, text: &str) {
    std::fs::write(at.join(name), text).unwrap();
}

fn certify(at: &Path, args: &str) {
    let said = muprime(at, &format!("calibrate {args} --operator Operator --overwrite"));
    assert!(said.status.success(), "{args}: {}", tests::texts(&said).1);
}

/// The ideal rig's setup with serials, these certificates, and more lines at its head.
fn setup(certificates: &str, more: &str) -> String {
    let text = std::fs::read_to_string(tests::file("runs/setups/virtual-ideal.toml")).unwrap();
    text.replace(
        "name = \"virtual-ideal\"",
        &format!("name = \"calibrated\"\ncertificates = [{certificates}]\n{more}"),
    )
    .replace("profile = \"muprime-force2\"", "profile = \"muprime-force2\"\nserial = \"V-1\"")
    .replace("profile = \"muprime-amplifier\"", "profile = \"muprime-amplifier\"\nserial = \"A-1\"")
}

fn refused(at: &Path, args: &str, says: &str) {
    let said = muprime(at, args);
    assert_eq!(said.status.code(), Some(2), "{args}");
    let text = tests::texts(&said).1.split_whitespace().collect::<Vec<_>>().join(" ").replace("│ ", "");
    assert!(text.contains(says), "{args}: {text}");
}

fn blamed(verdict: &serde_json::Value) -> String {
    format!("{} {}", verdict["hypotheses"][0]["effects"], verdict["hypotheses"][0]["alias_class"])
}

#[test]
fn after_a_whole_calibration_the_instruments_are_gone_from_the_verdict() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let defects = format!("{CROSSTALK}{AMPLITUDE}");
    write(at, "defects.toml", &defects);
    write(at, "series.csv", &series_in_counts(COUNT_N, &Defects::parse(&defects).unwrap()));
    write(at, "table.csv", &table(&defects, 1.0));
    certify(at, "force series.csv --serial V-1 --out force.toml");
    certify(at, "amplitude --table table.csv --form bent --serial A-1 --out amplitude.toml");
    write(at, "both.toml", &setup("\"force.toml\", \"amplitude.toml\"", ""));
    let before = verdict(at, "virtual-ideal", "before");
    println!("before: {} {}", before["verdict"], blamed(&before));
    assert_ne!(before["verdict"], "no_gap", "{before}");
    let after = verdict(at, "both.toml", "after");
    println!("after: {} {}", after["verdict"], blamed(&after));
    assert_eq!(after["verdict"], "no_gap", "{after}");
    let rig = std::fs::read_to_string(at.join("after/rig.toml")).unwrap();
    assert!(
        rig.contains("amplitude = \"amplitude.toml\"") && rig.contains("force = \"force.toml\""),
        "{rig}"
    );

    // What the loop asked of the drive: the certificate applied once, to the plan's amplitudes.
    let amplitudes = std::fs::read_to_string(at.join("after/points.csv")).unwrap();
    assert!(amplitudes.lines().count() > 12);
}

#[test]
fn an_amplitude_certificate_is_applied_once_and_bad_ones_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    write(at, "defects.toml", AMPLITUDE);
    write(at, "table.csv", &table(AMPLITUDE, 1.0));
    certify(at, "amplitude --table table.csv --form bent --serial A-1 --out amplitude.toml");
    write(at, "amplitude-only.toml", &setup("\"amplitude.toml\"", ""));
    let before = verdict(at, "virtual-ideal", "before");
    println!("before: {} {}", before["verdict"], blamed(&before));
    assert!(blamed(&before).contains("amplitude_miscalibration"), "{before}");
    let after = verdict(at, "amplitude-only.toml", "after");
    println!("after: {} {}", after["verdict"], blamed(&after));
    assert_eq!(after["verdict"], "no_gap", "{after}");

    // Foreign, half a swing for a whole one, scaled twice, stale: refused.
    let good = setup("\"amplitude.toml\"", "");
    write(at, "foreign.toml", &good.replace("A-1", "A-2"));
    refused(at, "run --setup foreign.toml --fast --out c", "is for serial A-1");
    let twice = good.replace("serial = \"A-1\"", "serial = \"A-1\"\namplitude_m_per_unit = 1.1");
    write(at, "twice.toml", &twice);
    refused(at, "run --setup twice.toml --fast --out c", "leave that to the certificate");
    write(at, "half.csv", &table(AMPLITUDE, 0.4));
    certify(at, "amplitude --table half.csv --form bent --serial A-1 --out amplitude.toml");
    refused(at, "run --setup amplitude-only.toml --fast --out c", "half a swing for a whole one");
    certify(
        at,
        "amplitude --table table.csv --form bent --serial A-1 --out amplitude.toml --date 2020-01-01 --valid-days 30",
    );
    refused(at, "run --setup amplitude-only.toml --fast --out c", "ran out at 2020-01-");
    assert!(!at.join("c").exists(), "nothing was touched");
}

#[test]
fn a_certificate_that_no_longer_holds_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // Weighed when the sensor was sound; then it was knocked, and its axes talk.
    write(at, "series.csv", &series_in_counts(COUNT_N, &Defects::none()));
    certify(at, "force series.csv --serial V-1 --out force.toml");
    write(at, "defects.toml", CROSSTALK);
    write(at, "knocked.toml", &setup("\"force.toml\"", ""));
    let found = verdict(at, "knocked.toml", "knocked");
    println!("knocked: {} {}", found["verdict"], blamed(&found));
    let fault = &found["certificates_at_fault"][0];
    assert_eq!(fault["certificate"], "force certificate (force.toml)", "{found}");
    assert_eq!(fault["effect"], "force_crosstalk", "{found}");
}

#[test]
fn a_certificate_holds_within_its_temperatures_only() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let with_temperature: String = series_in_counts(COUNT_N, &Defects::none())
        .lines()
        .enumerate()
        .map(|(i, line)| format!("{line},{}\n", if i == 0 { "temperature_c" } else { "22.0" }))
        .collect();
    write(at, "series.csv", &with_temperature);
    certify(at, "force series.csv --serial V-1 --out force.toml");
    write(at, "table.csv", &table(AMPLITUDE, 1.0));
    certify(
        at,
        "amplitude --table table.csv --form bent --serial A-1 --out amplitude.toml --temperature-c 15 30",
    );
    let both = "\"force.toml\", \"amplitude.toml\"";
    write(at, "silent.toml", &setup(both, ""));
    refused(at, "check silent.toml", "state `temperature_c` in the setup");
    write(at, "hot.toml", &setup(both, "temperature_c = 27.5\n"));
    refused(at, "run --setup hot.toml --fast --out c", "force.toml");
    write(at, "right.toml", &setup(both, "temperature_c = 23.5\n"));
    let said = muprime(at, "check right.toml");
    assert!(said.status.success(), "{}", tests::texts(&said).1);
    assert!(!at.join("c").exists(), "nothing was touched");
}

/// A certificate that holds at the bench's temperature but not at the amplifier's during the run: every pass
/// says so, the report too, and the numbers are the same as without.
#[test]
fn a_temperature_beyond_the_certificate_flags_the_passes_and_corrects_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    write(at, "table.csv", &table("", 1.0));
    let passes = |low: f64, high: f64, out: &str| {
        certify(
            at,
            &format!(
                "amplitude --table table.csv --form bent --serial A-1 --out amplitude.toml --temperature-c {low} {high}"
            ),
        );
        // Read off at the bench: 20 deg C. The plan warms the room to 22, and the amplifier with it.
        write(at, "setup.toml", &setup("\"amplitude.toml\"", "temperature_c = 20.0\n"));
        let warm = std::fs::read_to_string(tests::short_plan(at)).unwrap() + "temperature_c = [22.0]\n";
        write(at, "warm.toml", &warm);
        let run = muprime(at, &format!("run warm.toml --setup setup.toml --fast --out {out} --seed 3"));
        assert!(run.status.success(), "{}", tests::texts(&run).1);
        let journal = std::fs::read_to_string(at.join(out).join("passes.jsonl")).unwrap();
        let passes: Vec<serde_json::Value> =
            journal.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
        assert!(passes.len() > 10);
        let report = std::fs::read_to_string(at.join(out).join("report.html")).unwrap();
        let points = std::fs::read_to_string(at.join(out).join("points.csv")).unwrap();
        (passes, report, points, tests::texts(&run).1)
    };
    let (held, report, points, _) = passes(15.0, 30.0, "held");
    assert!(held.iter().all(|p| p["temperature_flags"].is_null()));
    assert!(!report.contains("does not hold"));
    let (beyond, report, same, said) = passes(10.0, 21.0, "beyond");
    let warm = |p: &&serde_json::Value| p["pass"]["temperature_c"].as_f64().unwrap() > 21.5;
    assert!(beyond.iter().filter(|p| !warm(p)).all(|p| p["temperature_flags"].is_null()));
    assert!(beyond.iter().filter(warm).count() > 10);
    for pass in beyond.iter().filter(warm) {
        let flag = &pass["temperature_flags"][0];
        assert_eq!(flag["certificate"], "amplitude certificate (amplitude.toml)", "{pass}");
        assert_eq!(flag["range_c"], serde_json::json!([10.0, 21.0]));
        assert!((flag["found_c"].as_f64().unwrap() - 22.0).abs() < 0.5, "{flag}");
    }
    let text = said.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(text.contains("holds from 10.0 to 21.0 deg C, the amplifier reports 21.9"), "{text}");
    assert_eq!(text.matches("holds from 10.0").count(), 1, "told once, flagged on every warm pass: {text}");
    assert!(report.contains("at which a certificate does not hold"), "the report says so");
    assert_eq!(points, same, "a flag changes no number");
}
