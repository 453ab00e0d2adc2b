//! Data that is unfit for a certificate, at the terminal: refused with status 2 and the reason, and nothing is written.

use crate::closing::series;
use sim::defects::Defects;
use sim::noise::Noise;
use std::fmt::Write as _;
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
    case("odd.csv", odd, "lateral_counts: a number is expected");
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

/// A table of so many rows.
fn table(head: &str, rows: usize, mut row: impl FnMut(usize) -> String) -> String {
    (0..rows).fold(format!("{head}\n"), |text, i| text + &row(i) + "\n")
}

/// The example of the documentation, its rows put through a function of their cells.
fn example(name: &str, edit: impl Fn(&mut Vec<String>) -> bool) -> String {
    let text = std::fs::read_to_string(tests::file(&format!("docs/calibration/{name}.csv"))).unwrap();
    let (_, bare) = text.split_once('\n').unwrap();
    edited(bare, |_, cells| edit(cells))
}

/// Writes each table and expects its refusal; in the words of the verb FILE is its name.
fn all_refused(cases: &[(&str, &str, String, &str)]) {
    let folder = tempfile::tempdir().unwrap();
    for (name, verb, text, says) in cases {
        std::fs::write(folder.path().join(name), text).unwrap();
        refused(folder.path(), &format!("calibrate {}", verb.replace("FILE", name)), says);
    }
}

const SET: &str = "set_point_pp_m,amplitude_pp_m";

/// Set-points in um, speeds in mm/s and sweeps in kHz were certified without a remark.
#[test]
fn a_column_in_another_unit_is_refused_with_the_unit_that_was_meant() {
    let friction = table("normal_force_n,speed_m_s,lateral_force_n", 20, |i| {
        let [force, speed] = [[0.1, 0.2, 0.4, 0.6, 0.8][i % 5], [5.0, 10.0, 20.0, 40.0][i / 5]];
        format!("{force},{speed},{}", 0.8 * force)
    });
    let grams = edited(&series(&Defects::none()), |_, cells| {
        if let Ok(kg) = cells[2].parse::<f64>() {
            cells[2] = (1e3 * kg).to_string();
        }
        true
    });
    let tilts = example("gravity", |cells| {
        cells[0] = number(&cells[0]).to_degrees().to_string();
        true
    });
    let delays = |off: f64| {
        table("delay_s", 12, |i| (0.012 + 1e-4 * i as f64 + if i == 7 { off } else { 0.0 }).to_string())
    };
    let sweep = table("frequency_hz,amplitude_pp_m", 20, |i| format!("{},1e-6", 27.0 + 0.05 * i as f64));
    all_refused(&[
        ("mm.csv", "finger --friction FILE", friction, "line 2: speed_m_s = 5 cannot be: it is in m/s"),
        ("um.csv", "amplitude --table FILE", table(SET, 6, |i| format!("{},1e-6", i + 1)), "\u{b5}m meant?"),
        ("g.csv", "force FILE", grams, "it is in kilograms"),
        ("degrees.csv", "gravity FILE", tilts, "it is in radians"),
        ("ms.csv", "latency --edges force=FILE", delays(0.0).replace("0.0", "1"), "ms meant?"),
        ("slip.csv", "latency --edges force=FILE", delays(5.0), "line 9: delay_s = 5.01"),
    ]);
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("free.csv"), table(SET, 6, |i| format!("{0}e-6,{0}e-6", i + 1)))
        .unwrap();
    std::fs::write(folder.path().join("khz.csv"), sweep).unwrap();
    refused(folder.path(), "calibrate amplitude --table free.csv --sweep khz.csv", "kHz meant?");
}

/// Noise, a step in the place of a tap, swapped forces: each gave a certificate that `check` passed.
#[test]
fn noise_and_what_contradicts_the_model_give_no_certificate() {
    let noise = std::cell::RefCell::new(Noise::new(7, "no signal"));
    let normal = || noise.borrow_mut().normal();
    let noisy = |name: &str, column: usize| {
        example(name, |cells| {
            cells[column] = (100.0 * normal()).to_string();
            true
        })
    };
    let swapped = example("gravity", |cells| {
        cells.swap(1, 2);
        true
    });
    let turned = example("gravity", |cells| {
        cells[0] = (-number(&cells[0])).to_string();
        true
    });
    let weightless = example("gravity", |cells| {
        (cells[1], cells[2]) = (normal().to_string(), normal().to_string());
        true
    });
    let counts = |of: &dyn Fn(usize) -> f64| {
        table("lateral_counts,normal_counts", 4000, |i| {
            format!("{},{}", of(i).round(), (5.0 * normal()).round())
        })
    };
    let clock = |of: &dyn Fn(f64) -> f64| {
        table("host_s,device_s", 200, |i| format!("{},{}", 0.1 * i as f64, of(0.1 * i as f64)))
    };
    let rest = "noise FILE --rate-hz 1000";
    all_refused(&[
        ("step.csv", "step FILE", noisy("step", 2), "no better than a constant"),
        ("tap.csv", "tap FILE", noisy("tap", 2), "no better than a constant"),
        ("steps.csv", "tap FILE", example("step", |_| true), "event 1: it begins before its tap"),
        ("swapped.csv", "gravity FILE", swapped, "no certificate: an angle of"),
        ("turned.csv", "gravity FILE", turned, "no certificate: an angle of"),
        ("noise.csv", "gravity FILE", weightless, "no certificate: an angle of"),
        ("dead.csv", rest, counts(&|_| 100.0), "lateral_counts are all equal"),
        ("rail.csv", rest, counts(&|_| (32_767.0 + 5.0 * normal()).min(32_767.0)), "pile up at 32767"),
        ("drift.csv", rest, counts(&|i| 5.0 * normal() + 0.4 * i as f64), "`lateral.noise_sd` is above zero"),
        ("wraps.csv", "latency --clock force=FILE", clock(&|t| t % 6.5536), "must be unwrapped"),
        ("ms.csv", "latency --clock force=FILE", clock(&|t| 1e3 * t), "both are in seconds"),
        (
            "equal.csv",
            "latency --edges force=FILE",
            table("delay_s", 10, |_| "0.012".into()),
            "--resolution-s",
        ),
        (
            "rate.csv",
            "noise FILE --rate-hz -1000",
            counts(&|_| 5.0 * normal()),
            "--rate-hz -1000: above zero",
        ),
    ]);
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("free.csv"), table(SET, 6, |i| format!("{0}e-6,{0}e-6", i + 1)))
        .unwrap();
    let sweep = table("frequency_hz,amplitude_pp_m", 40, |i| {
        format!("{},{:e}", 26_000 + 80 * i, (1e-6 + 5e-7 * normal()).abs())
    });
    std::fs::write(folder.path().join("sweep.csv"), sweep).unwrap();
    refused(folder.path(), "calibrate amplitude --table free.csv --sweep sweep.csv", "no certificate");
}

/// The zero of noisy readings was called a drift, of less than its own uncertainty.
#[test]
fn readings_that_scatter_are_not_called_a_drifting_zero() {
    let mut noise = Noise::new(3, "readings");
    let scattered = edited(&series(&Defects::none()), |_, cells| {
        cells[3] = (number(&cells[3]) + 600.0 * noise.normal()).to_string();
        true
    });
    all_refused(&[("noisy.csv", "force FILE", scattered, "the readings scatter too much to tell a drift")]);
}

/// Copies of readings narrowed the interval.
#[test]
fn a_reading_that_is_there_twice_is_refused() {
    let good = series(&Defects::none());
    let (head, rows) = good.split_once('\n').unwrap();
    let part: String = rows.lines().take(20).fold(String::new(), |text, row| text + row + "\n");
    let each = rows.lines().fold(format!("{head}\n"), |mut text, row| {
        let _ = writeln!(text, "{row}\n{row}");
        text
    });
    let tilts = example("gravity", |_| true);
    let (tilt, tilted) = tilts.split_once('\n').unwrap();
    let steps = example("step", |_| true);
    all_refused(&[
        ("part.csv", "force FILE", format!("{good}{part}"), "is line 2 again, time included"),
        ("each.csv", "force FILE", each, "line 3 is line 2 again"),
        ("five.csv", "gravity FILE", format!("{tilt}\n{}", tilted.repeat(5)), "rows 5 times"),
        (
            "steps.csv",
            "step FILE",
            format!("{steps}{}", steps.split_once('\n').unwrap().1),
            "is line 2 again",
        ),
    ]);
}

/// A spreadsheet's table was refused for columns that it has.
#[test]
fn a_table_with_other_separators_is_refused_by_their_name_and_a_byte_order_mark_is_none() {
    let good = series(&Defects::none());
    let wide: Vec<u8> = good.encode_utf16().flat_map(u16::to_le_bytes).collect();
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes, says) in [
        ("semicolons.csv", good.replace(',', ";").into_bytes(), "found semicolons"),
        ("tabs.csv", good.replace(',', "\t").into_bytes(), "found tabs"),
        ("wide.csv", [&[0xff, 0xfe], &wide[..]].concat(), "found UTF-16"),
    ] {
        std::fs::write(folder.path().join(name), bytes).unwrap();
        refused(folder.path(), &format!("calibrate force {name}"), says);
    }
    std::fs::write(folder.path().join("bom.csv"), format!("\u{feff}{good}")).unwrap();
    let said = tests::muprime()
        .current_dir(folder.path())
        .args(["calibrate", "force", "bom.csv", "--operator", "O", "--serial", "S"])
        .output()
        .unwrap();
    assert!(said.status.success(), "{}", tests::texts(&said).1);
}

/// Such a certificate was taken in a setup, whatever its serial, and did nothing.
#[test]
fn a_certificate_that_changes_nothing_in_a_run_is_refused_in_a_setup() {
    let folder = tempfile::tempdir().unwrap();
    let mut noise = Noise::new(5, "at rest");
    let rest = table("lateral_counts,normal_counts", 4000, |_| {
        format!("{},{}", (20.0 * noise.normal()).round(), (20.0 * noise.normal()).round())
    });
    std::fs::write(folder.path().join("rest.csv"), rest).unwrap();
    let made = "calibrate noise rest.csv --rate-hz 1000 --operator Ada --serial N-1 --out noise.toml";
    let made = tests::muprime().current_dir(folder.path()).args(made.split(' ')).output().unwrap();
    assert!(made.status.success(), "{}", tests::texts(&made).1);
    let setup = std::fs::read_to_string(tests::file("runs/setups/virtual-ideal.toml")).unwrap();
    let with = setup.replace("name = \"virtual-ideal\"", "name = \"x\"\ncertificates = [\"noise.toml\"]");
    std::fs::write(folder.path().join("setup.toml"), with).unwrap();
    for args in ["check setup.toml", "run --fast --setup setup.toml --out r"] {
        let answer = tests::muprime().current_dir(folder.path()).args(args.split(' ')).output().unwrap();
        let text = tests::texts(&answer).1.split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(answer.status.code(), Some(2), "{text}");
        assert!(text.contains("changes nothing in a run"), "{text}");
    }
    assert!(!folder.path().join("r").exists());
}
