//! The pages that people read, in a real Chromium: at three widths, light and dark, by the keyboard, with names that hold markup, judged by
//! axe-core. `MUPRIME_PAGES=FOLDER cargo test --release -p muprime-tests-peers --test pages` keeps the pictures and the printed pages there.

#[path = "pages/words.rs"]
mod words;

use serde_json::Value;
use std::path::{Path, PathBuf};
use tests::{file, muprime, python, texts};

/// Letters of a figure are at least so large, in CSS pixels.
const LEAST_LETTER: f64 = 9.0;
/// Names as an attacker, or a careless hand, writes them.
const NAMES: [&str; 2] = [
    "\"><img src=x onerror=alert(1)>",
    "</dd><script>alert(document.domain)</script><svg onload=alert(2)>&amp;\u{1b}[31m",
];

/// A run on the virtual rig with those names, its page and its verdict's.
fn pages(folder: &Path) -> Vec<PathBuf> {
    let run = folder.join("run");
    let swept = muprime()
        .args(["run", "--fast", "--operator", NAMES[0], "--sample", NAMES[1], "--out"])
        .arg(&run)
        .output()
        .unwrap();
    assert!(swept.status.code().is_some_and(|code| code < 2), "{}", texts(&swept).1);
    let verdict = folder.join("verdict.html");
    let diagnosed = muprime().arg("diagnose").arg(&run).arg("--report").arg(&verdict).output().unwrap();
    assert!(diagnosed.status.success(), "{}", texts(&diagnosed).1);
    // A table of other people's, which has no run around it: plain sliding without vibration.
    let table = folder.join("table");
    std::fs::create_dir(&table).unwrap();
    let (points, rig) = (run.join("points.csv"), run.join("rig.toml"));
    let rows = std::fs::read_to_string(points).unwrap();
    let mut lines = rows.lines();
    let head = lines.next().unwrap();
    // Thirty rows are few: most of what a page has is missing there.
    let few: Vec<&str> = lines.take(30).collect();
    std::fs::write(table.join("points.csv"), format!("{head}\n{}\n", few.join("\n"))).unwrap();
    std::fs::copy(rig, table.join("rig.toml")).unwrap();
    let short = folder.join("short.html");
    let diagnosed =
        muprime().arg("diagnose").arg(table.join("points.csv")).arg("--report").arg(&short).output().unwrap();
    assert!(diagnosed.status.success(), "{}", texts(&diagnosed).1);
    vec![run.join("report.html"), verdict, short]
}

#[test]
fn pages_are_read_at_any_width_in_the_dark_by_keyboard_and_by_ear() {
    let folder = tempfile::tempdir().unwrap();
    let kept = std::env::var_os("MUPRIME_PAGES").map(PathBuf::from);
    let out = kept.unwrap_or_else(|| folder.path().join("pictures"));
    std::fs::create_dir_all(&out).unwrap();
    let pages = pages(folder.path());
    let mut look = python();
    look.arg(file("tests/peers/pages.py")).arg(&out).args(&pages);
    let output = look.output().unwrap();
    let (said, err) = texts(&output);
    assert!(output.status.success(), "{err}");
    let seen: Vec<Value> = serde_json::from_str(&said).unwrap();
    assert_eq!(seen.len(), 6 * pages.len(), "three widths, light and dark");
    let mut wrong = Vec::new();
    for page in &seen {
        let at = format!("{} at {} px, {}", page["page"], page["width"], page["scheme"]);
        let empty = |key: &str| page[key].as_array().is_some_and(Vec::is_empty);
        let checks = [
            ("asks for something from elsewhere", empty("asked")),
            ("runs a script", empty("ran")),
            ("is wider than its window", page["overflow"].as_i64().is_some_and(|px| px <= 0)),
            ("has a figure without words", page["nameless"] == 0),
            ("has no figure", page["figures"].as_u64().is_some_and(|n| n > 0)),
            ("has letters too small", page["smallest"].as_f64().is_some_and(|px| px >= LEAST_LETTER)),
            ("folds what no key opens", page["details"].as_u64() > Some(0) && page["folded"] == 0),
            ("leaves what is folded out of its print", page["unprinted"] == 0),
            ("has serious faults by axe-core", empty("axe")),
            ("cannot be worked with", empty("tried")),
        ];
        wrong.extend(
            checks.iter().filter(|(_, right)| !right).map(|(what, _)| format!("{at} {what}: {page}")),
        );
    }
    assert!(wrong.is_empty(), "{} wrong:\n{}", wrong.len(), wrong.join("\n"));
    println!("{} views, 0 faults", seen.len());
}
