//! Data that is unfit for a certificate, at the terminal: refused with status 2 and the reason, and nothing is written.

use crate::closing::series;
use sim::defects::Defects;
use std::path::Path;

/// Runs `calibrate`, expects a refusal that says this and no certificate.
fn refused(folder: &Path, args: &str, says: &str) {
    let said = tests::muprime()
        .current_dir(folder)
        .args(args.split(' '))
        .args(["--operator", "O", "--serial", "S", "--out", "none.toml"])
        .output()
        .unwrap();
    let text = flat(&tests::texts(&said).1);
    assert_eq!(said.status.code(), Some(2), "{args}: {text}");
    assert!(text.contains(says), "{args}: `{says}` is not in: {text}");
    assert!(!folder.join("none.toml").exists(), "{args}");
}

/// A report without its line breaks and frames.
fn flat(text: &str) -> String {
    text.split_whitespace().filter(|word| !["│", "×", "╰─▶"].contains(word)).collect::<Vec<_>>().join(" ")
}

/// The series with its rows put through a function of (row, cells).
fn edited(text: &str, mut edit: impl FnMut(usize, &mut Vec<String>) -> bool) -> String {
    let mut out = String::new();
    for (i, line) in text.lines().enumerate() {
        let mut cells: Vec<String> = line.split(',').map(String::from).collect();
        if i == 0 || edit(i, &mut cells) {
            out += &(cells.join(",") + "\n");
        }
    }
    out
}

fn number(cell: &str) -> f64 {
    cell.parse().unwrap()
}

#[test]
fn a_bad_force_series_is_refused_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let good = series(&Defects::none());
    let case = |name: &str, text: String, says: &str| {
        std::fs::write(at.join(name), text).unwrap();
        refused(at, &format!("calibrate force {name}"), says);
    };
    // Columns: time_s, axis, mass_kg, lateral_counts, normal_counts, branch.
    let few = edited(&good, |_, c| c[1] == "zero" || number(&c[2]) == 0.15);
    case("few.csv", few, "different loads");
    case("no-zeros.csv", edited(&good, |_, c| c[1] != "zero"), "zero");
    let swapped = edited(&good, |_, c| {
        c.swap(3, 4);
        true
    });
    case("swapped.csv", swapped, "swapped");
    let drifting = edited(&good, |_, c| {
        c[4] = (number(&c[4]) + 0.8 * number(&c[0])).to_string();
        true
    });
    case("drifting.csv", drifting, "zero of the normal channel drifted");
    let plateau = edited(&good, |_, c| {
        c[4] = number(&c[4]).min(14_000.0).to_string();
        true
    });
    case("plateau.csv", plateau, "saturated");
    let mut said_so = edited(&good, |i, c| {
        c.push(u8::from(i == 20).to_string());
        true
    });
    said_so = said_so.replacen("branch", "branch,saturated", 1);
    case("saturated.csv", said_so, "saturated");
    let odd = edited(&good, |i, c| {
        if i == 7 {
            c[3] = "12k".into();
        }
        true
    });
    case("odd.csv", odd, "field 3: a number is expected");
    // The same series untouched is a certificate, so it is the damage that was refused.
    std::fs::write(at.join("good.csv"), good).unwrap();
    let said = tests::muprime()
        .current_dir(at)
        .args(["calibrate", "force", "good.csv", "--operator", "O", "--serial", "S", "--out", "good.toml"])
        .output()
        .unwrap();
    assert!(said.status.success(), "{}", tests::texts(&said).1);

    // The data in place of the certificate: what was said was an error of TOML's reader.
    let said = tests::muprime().current_dir(at).args(["calibrate", "priors", "good.csv"]).output().unwrap();
    let text = flat(&tests::texts(&said).1);
    assert!(said.status.code() == Some(2) && text.contains("good.csv is no certificate"), "{text}");
    assert!(text.contains("help: give certificates") && !text.contains("TOML"), "{text}");

    // Edited by hand, by one digit of one number: `check`, `priors` and a setup refuse it.
    let text = std::fs::read_to_string(at.join("good.toml")).unwrap();
    let place = text.find("value = ").unwrap() + "value = ".len();
    let digit = place + text[place..].find(|c: char| c.is_ascii_digit()).unwrap();
    let mut bytes = text.into_bytes();
    bytes[digit] = if bytes[digit] == b'9' { b'8' } else { bytes[digit] + 1 };
    std::fs::write(at.join("good.toml"), bytes).unwrap();
    for args in ["check good.toml", "calibrate priors good.toml"] {
        let said = tests::muprime().current_dir(at).args(args.split(' ')).output().unwrap();
        assert_eq!(said.status.code(), Some(2), "{args}");
        let text = flat(&tests::texts(&said).1);
        assert!(text.contains("changed after it was written"), "{args}: {text}");
    }
}

#[test]
fn other_bad_data_is_refused_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let case = |name: &str, verb: &str, text: &str, says: &str| {
        std::fs::write(at.join(name), text).unwrap();
        refused(at, &format!("calibrate {}", verb.replace("FILE", name)), says);
    };
    let table = "set_point_pp_m,amplitude_pp_m\n";
    case("two.csv", "amplitude --table FILE", &format!("{table}1e-6,1e-6\n2e-6,2e-6\n"), "are too few");
    let full: String =
        (1..=8).map(|k| format!("{k}e-6,{:e}\n", (f64::from(k) * 0.98e-6).min(5e-6))).collect();
    case("full.csv", "amplitude --table FILE", &format!("{table}{full}"), "saturates");
    case("empty.csv", "amplitude --table FILE", table, "no rows");
    case("edges.csv", "latency --edges force=FILE", "delay_s\n1e-3\n1.1e-3\n", "too few");
    case("back.csv", "creep FILE", "time_s,net_counts\n0,1\n2,2\n1,3\n", "must rise");
    case("degrees.csv", "gravity FILE", "tilt_rad,lateral_force_n,normal_force_n\n10,0,1\n", "radians");
    let same = "0.1,0.1,0.7\n".repeat(6);
    case(
        "flat.csv",
        "gravity FILE",
        &format!("tilt_rad,lateral_force_n,normal_force_n\n{same}"),
        "three tilts well apart",
    );
    case("short.csv", "noise FILE --rate-hz 1000", "lateral_counts,normal_counts\n1,2\n2,3\n", "too few");
    let halves = "0.5,1\n".repeat(2000);
    case(
        "halves.csv",
        "noise FILE --rate-hz 1000",
        &format!("lateral_counts,normal_counts\n{halves}"),
        "whole numbers",
    );
    case("step.csv", "step FILE", "event,time_s,value\n1,0,0\n1,1,1\n", "event 1");
    case("tap.csv", "tap FILE", "event,value\n1,0\n", "column `time_s` is missing");
}
