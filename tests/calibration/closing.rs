//! The whole way with the real program: dead weights on the virtual sensor, certificate, sweep, diagnosis.

use calibration::force::series::Weighing;
use sim::defects::{Defects, Forces, Surroundings};
use sim::noise::Noise;
use sim::sensor::{Sensor, SensorConfig};
use std::fmt::Write as _;
use std::path::Path;
use std::process::Output;

const CROSSTALK: &str = "[[defect]]
name = \"force_crosstalk\"
parameters = { lateral_per_normal = 0.08, normal_per_lateral = 0.01 }
";

/// Force of a count of `muprime-force2` (N), as its profile states it: a certificate speaks of these counts.
pub const COUNT_N: f64 = 1e-5;

/// As below, in the virtual sensor's own counts of 0.1 mN.
pub fn series(defects: &Defects) -> String {
    series_in_counts(1e-4, defects)
}

/// A dead-weight series on the virtual rig's own sensor, with the world's defect before it, as CSV.
pub fn series_in_counts(count_n: f64, defects: &Defects) -> String {
    let mut sensor = Sensor::new(SensorConfig { sample_period_s: 0.01, ..SensorConfig::default() }, 0.01, 11);
    let mut direction = Noise::new(11, "pulls");
    let weighing = Weighing::default();
    let mut text = String::from("time_s,axis,mass_kg,lateral_counts,normal_counts,branch\n");
    let mut tick = 0u64;
    let mut row = |axis: &str, mass_kg: f64, branch: &str| {
        let load = weighing.load_n(mass_kg);
        let tilt = 1e-3 * direction.normal();
        let (lateral_n, normal_n) = match axis {
            "lateral" => (load, load * tilt),
            "normal" => (load * tilt, load),
            _ => (0.0, 0.0),
        };
        let mut sum = [0.0; 2];
        for i in 0..1_000 {
            tick += 1;
            let mut forces = Forces { lateral_n, normal_n };
            let at = Surroundings {
                time_s: tick as f64 * 0.01,
                contact_time_s: 0.0,
                position_m: 0.0,
                direction: 1.0,
                frequency_hz: 27_500.0,
                normal_force_n: normal_n,
                ambient_pressure_pa: 101_325.0,
                temperature_c: 22.0,
            };
            defects.forces(&at, &mut forces);
            let shown = sensor.feel(forces.lateral_n, forces.normal_n);
            let sample = sensor.sample(shown, realtime::ports::Nanos(tick * 10_000_000));
            if i >= 800 {
                (0..2).for_each(|a| sum[a] += (sample.force_n[a] / count_n).round() / 200.0);
            }
        }
        let mass = if axis == "zero" { String::new() } else { mass_kg.to_string() };
        let _ = writeln!(text, "{},{axis},{mass},{},{},{branch}", tick as f64 * 0.01, sum[0], sum[1]);
    };
    for _ in 0..2 {
        for (axis, sign) in [("lateral", 1.0), ("lateral", -1.0), ("normal", 1.0)] {
            row("zero", 0.0, "");
            for mass in [0.02, 0.05, 0.1, 0.15] {
                row(axis, sign * mass, "up");
            }
            for mass in [0.1, 0.05, 0.02] {
                row(axis, sign * mass, "down");
            }
        }
    }
    row("zero", 0.0, "");
    text
}

pub fn muprime(folder: &Path, args: &str) -> Output {
    tests::muprime().current_dir(folder).args(args.split(' ')).output().unwrap()
}

/// The verdict of a fast sweep of a setup on the world with the cross-talk.
pub fn verdict(folder: &Path, setup: &str, out: &str) -> serde_json::Value {
    let run =
        muprime(folder, &format!("run --setup {setup} --fast --defects defects.toml --out {out} --seed 3"));
    assert!(run.status.success(), "{}", tests::texts(&run).1);
    let said = muprime(folder, &format!("diagnose {out} --json"));
    assert!(said.status.success(), "{}", tests::texts(&said).1);
    tests::documents(&said).remove(0)
}

#[test]
fn a_calibrated_rig_is_no_longer_blamed_and_bad_certificates_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let write = |name: &str, text: &str| std::fs::write(at.join(name), text).unwrap();
    write("defects.toml", CROSSTALK);
    write("series.csv", &series_in_counts(COUNT_N, &Defects::parse(CROSSTALK).unwrap()));

    let certified =
        muprime(at, "calibrate force series.csv --operator Operator --serial V-1 --out force.toml --json");
    assert!(certified.status.success(), "{}", tests::texts(&certified).1);
    let setup = std::fs::read_to_string(tests::file("runs/setups/virtual-ideal.toml")).unwrap();
    let with = |serial: &str| {
        setup
            .replace("name = \"virtual-ideal\"", "name = \"virtual-ideal\"\ncertificates = [\"force.toml\"]")
            .replace(
                "profile = \"muprime-force2\"",
                &format!("profile = \"muprime-force2\"\nserial = \"{serial}\""),
            )
    };
    write("calibrated.toml", &with("V-1"));

    // Without the certificate the force sensor is blamed: cross-talk, or the tilt that imitates it.
    let before = verdict(at, "virtual-ideal", "before");
    let blamed = before["hypotheses"][0]["alias_class"].to_string();
    assert!(blamed.contains("force_crosstalk"), "{before}");
    // With it there is nothing left to blame.
    let after = verdict(at, "calibrated.toml", "after");
    assert_eq!(after["verdict"], "no_gap", "{after}");

    // Foreign, tampered, stale: refused before anything runs.
    let refused = |args: &str, says: &str| {
        let said = muprime(at, args);
        assert_eq!(said.status.code(), Some(2), "{args}");
        let text = tests::texts(&said).1.split_whitespace().collect::<Vec<_>>().join(" ").replace("│ ", "");
        assert!(text.contains(says), "{args}: {text}");
    };
    write("foreign.toml", &with("V-2"));
    refused("check foreign.toml", "is for serial V-1");
    refused("run --setup foreign.toml --fast --out c", "is for serial V-1");
    write(
        "scaled.toml",
        &format!(
            "{}\n",
            with("V-1").replace(
                "address = \"127.0.0.1:0\"  ",
                "normal = { signal = \"normal\", gain = 1.1 }\naddress = \"127.0.0.1:0\"  "
            )
        ),
    );
    refused("check scaled.toml", "leave that to the certificate");
    let good = std::fs::read_to_string(at.join("force.toml")).unwrap();
    write("force.toml", &good.replace("operator = \"Operator\"", "operator = \"Nobody\""));
    refused("run --setup calibrated.toml --fast --out c", "changed after it was written");
    refused("check force.toml", "changed after it was written");
    let old = muprime(
        at,
        "calibrate force series.csv --operator O --serial V-1 --out force.toml --overwrite --date 2020-01-01 --valid-days 30",
    );
    assert!(old.status.success());
    refused("run --setup calibrated.toml --fast --out c", "ran out at 2020-01-31");
    assert!(!at.join("c").exists(), "nothing was touched");
}

/// The program that asks for one weight after the other.
fn guided(folder: &Path, certificate: &str) -> std::process::Child {
    tests::muprime()
        .current_dir(folder)
        .args(["calibrate", "force", "--operator", "O", "--serial", "S", "--json", "--out", certificate])
        .stdin(std::process::Stdio::piped())
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap()
}

#[test]
fn guided_at_the_terminal_a_series_gives_a_certificate() {
    use std::io::Write as _;
    let folder = tempfile::tempdir().unwrap();
    let text = series(&Defects::none());
    let mut input = String::new();
    for line in text.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let _ = writeln!(input, "{} {} {}\n{} {}", cells[1], cells[2], cells[5], cells[3], cells[4]);
    }
    input.push_str("done\n");
    let mut child = guided(folder.path(), "guided.toml");
    child.stdin.take().unwrap().write_all(input.as_bytes()).unwrap();
    let guided = child.wait_with_output().unwrap();
    assert!(guided.status.success(), "{}", tests::texts(&guided).1);
    let saved = std::fs::read_to_string(folder.path().join("guided.csv")).unwrap();
    assert_eq!(saved.lines().count(), text.lines().count(), "the series is beside the certificate");
    let document = &tests::documents(&guided)[0];
    assert_eq!(document["serial"], "S");
    for channel in ["lateral", "normal"] {
        let name = format!("{channel}.gain_{channel}");
        let parameter =
            document["parameters"].as_array().unwrap().iter().find(|p| p["name"] == name.as_str()).unwrap();
        let [low, high] = [0, 1].map(|k| parameter["ci95"][k].as_f64().unwrap());
        // The virtual sensor without defects: 0.1 mN a count.
        assert!(low < 1e4 && 1e4 < high && high - low < 100.0, "{parameter}");
    }
}

/// A series taken in two sessions gives the certificate that it gives in one: the same rows, the same numbers.
#[test]
fn a_series_in_two_sessions_is_one_series() {
    use std::io::Write as _;
    let folder = tempfile::tempdir().unwrap();
    let text = series(&Defects::none());
    let rows: Vec<Vec<String>> =
        text.lines().skip(1).map(|l| l.split(',').map(String::from).collect()).collect();
    let (first, second) = rows.split_at(rows.len() / 2);
    for (part, last) in [(first, false), (second, true)] {
        let mut guided = guided(folder.path(), "weighed.toml");
        let mut typed = guided.stdin.take().unwrap();
        for cells in part {
            writeln!(typed, "{} {} {}", cells[1], cells[2], cells[5]).unwrap();
            writeln!(typed, "{} {}", cells[3], cells[4]).unwrap();
        }
        if last {
            writeln!(typed, "done").unwrap();
        }
        drop(typed);
        let done = guided.wait_with_output().unwrap();
        assert_eq!(done.status.success(), last, "{}", tests::texts(&done).1);
    }
    let saved = std::fs::read_to_string(folder.path().join("weighed.csv")).unwrap();
    let counts = |line: &str| line.split(',').skip(1).take(4).map(String::from).collect::<Vec<_>>();
    let saved: Vec<Vec<String>> = saved.lines().skip(1).map(counts).collect();
    assert_eq!(saved.len(), rows.len());
    for (saved, typed) in saved.iter().zip(&rows) {
        assert_eq!(saved[0], typed[1]);
        assert_eq!(saved[2].parse::<f64>().unwrap(), typed[3].parse::<f64>().unwrap());
    }
    assert!(!folder.path().join("weighed.csv.part").exists() && folder.path().join("weighed.toml").exists());
}
