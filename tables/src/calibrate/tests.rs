//! Commands refuse data that is unfit for a certificate, with place and remedy.

use super::from_files;
use std::f64::consts::PI;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// An example of the page, row by row through `change`.
fn example(folder: &Path, name: &str, change: impl Fn(usize, &mut Vec<f64>)) -> PathBuf {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../docs/calibration/{name}.csv"));
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let mut changed = format!("{}\n", lines.next().unwrap());
    for (i, line) in lines.enumerate() {
        let mut row: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        change(i, &mut row);
        let cells: Vec<String> = row.iter().map(f64::to_string).collect();
        writeln!(changed, "{}", cells.join(",")).unwrap();
    }
    let path = folder.join(format!("{name}.csv"));
    std::fs::write(&path, changed).unwrap();
    path
}

/// What the command answers: the refusal with its remedy, or nothing where it gives a certificate.
fn refusal(words: &str, files: &[&Path]) -> String {
    let mut line: Vec<String> = words.split(' ').map(String::from).collect();
    line.extend(files.iter().map(|file| file.display().to_string()));
    line.extend(["--operator", "A", "--serial", "S"].map(String::from));
    match from_files(&line) {
        Ok(_) => String::new(),
        Err(e) => format!("{e} {}", e.help().map_or(String::new(), |help| help.to_string())),
    }
}

#[test]
fn clipped_steps_and_taps_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |what: &str, low: f64, high: f64| {
        let file = example(folder.path(), what, |_, row| row[2] = row[2].clamp(low, high));
        refusal(what, &[&file])
    };
    for (what, low, high) in [
        ("step", f64::MIN, 5150.0),
        ("step", 120.0, f64::MAX),
        ("tap", f64::MIN, 400.0),
        ("tap", -400.0, 400.0),
    ] {
        assert_eq!(refused(what, f64::MIN, f64::MAX), "");
        let said = refused(what, low, high);
        assert!(
            said.contains("event 1") && said.contains("clipped") && said.contains("larger range"),
            "{said}"
        );
    }
    // A converter that is coarser than the noise repeats its values everywhere.
    let coarse = example(folder.path(), "step", |_, row| row[2] = (row[2] / 300.0).round());
    assert!(!refusal("step", &[&coarse]).contains("clipped"));
}

#[test]
fn times_in_milliseconds_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for what in ["step", "tap"] {
        let file = example(folder.path(), what, |_, row| row[1] *= 1e3);
        let said = refusal(what, &[&file]);
        assert!(said.contains("is time_s in milliseconds?"), "{said}");
    }
}

#[test]
fn a_creep_whose_time_constant_may_be_negative_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    assert_eq!(refusal("creep", &[&example(folder.path(), "creep", |_, _| ())]), "");
    // A straight rise: the record ends long before the creep does.
    let noise = [0.3, -0.5, 0.4, -0.2, -0.1];
    let file = example(folder.path(), "creep", |i, row| row[1] = 9000.0 + 0.02 * row[0] + 5.0 * noise[i % 5]);
    let said = refusal("creep", &[&file]);
    assert!(said.contains("`creep.time_constant` is above zero"), "{said}");
}

#[test]
fn a_stretch_of_equal_samples_gives_no_rule_for_frozen_values() {
    let folder = tempfile::tempdir().unwrap();
    assert_eq!(refusal("noise --rate-hz 1000", &[&example(folder.path(), "noise", |_, _| ())]), "");
    let file = example(folder.path(), "noise", |i, row| {
        if (500..560).contains(&i) {
            row[0] = 131.0;
        }
    });
    let said = refusal("noise --rate-hz 1000", &[&file]);
    assert!(
        said.contains("rows 501 to 560: lateral_counts repeat") && said.contains("record again"),
        "{said}"
    );
}

#[test]
fn a_waveform_counts_once() {
    let folder = tempfile::tempdir().unwrap();
    let wave = |name: &str, head: &str, phase: f64| {
        let mut text = format!("{head}plate_v,skin_v\n");
        for i in 0..2000 {
            let angle = 2.0 * PI * 27_500.0 * f64::from(i) * 1e-6 + phase;
            let noise = 1e-3 * [1.0, -1.0, -1.0, 1.0, 0.5][i as usize % 5];
            writeln!(text, "{},{}", angle.cos() + noise, 0.7 * (angle - 0.7).cos() - noise).unwrap();
        }
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path
    };
    let (first, second, third) = (wave("a.csv", "", 0.0), wave("b.csv", "", 0.3), wave("c.csv", "", 0.8));
    let copy = wave("copy.csv", "# another name\n", 0.0);
    let words = format!("phase --rate-hz 1e6 --phases {}", folder.path().join("PHASES.csv").display());
    assert_eq!(refusal(&words, &[&first, &second, &third]), "");
    for files in [[first.as_path(), &second, &first], [&first, &second, &copy]] {
        let said = refusal(&words, &files);
        assert!(
            said.contains("those of") && said.contains("a.csv") && said.contains("remove the copy"),
            "{said}"
        );
    }
}
