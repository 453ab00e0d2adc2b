//! Manners at the terminal: readers that go away, logs in files, errors for scripts.

use std::process::{Command, Stdio};
use tests::{documents, muprime, texts};

/// A reader that takes one line and goes away ends nothing with a panic.
#[test]
fn a_reader_may_go_away() {
    for words in [
        vec!["show"],
        vec!["model", "effects"],
        vec!["--help"],
        vec!["schema", "profile"],
        vec!["completions", "bash"],
    ] {
        let mut program =
            muprime().args(&words).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let read = program.stdout.take().unwrap();
        let head = Command::new("head").arg("-1").stdin(read).output().unwrap();
        assert!(!head.stdout.is_empty(), "{words:?}");
        let ended = program.wait_with_output().unwrap();
        assert_eq!(texts(&ended).1, "", "{words:?}");
        assert_eq!(ended.status.code(), Some(0), "{words:?}");
    }
}

/// What goes to a file has no colours: logs, refusals, progress.
#[test]
fn nothing_but_text_goes_to_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let run = |words: &[&str]| {
        let output = muprime()
            .args(words)
            .env("MUPRIME_LOG", "debug")
            .env("MUPRIME_RUNS", folder.path())
            .current_dir(folder.path())
            .output()
            .unwrap();
        let (out, err) = texts(&output);
        assert!(!out.contains('\u{1b}') && !err.contains('\u{1b}'), "{words:?}: {out}{err}");
        output.status.code()
    };
    assert_eq!(run(&["run", "first-sweep", "--setup", "virtual-ideal", "--fast", "--out", "run"]), Some(0));
    assert_eq!(run(&["check", "no-such.toml"]), Some(2));
    assert_eq!(run(&["run", "--setup", "no-such"]), Some(2));
    assert_eq!(run(&["--help"]), Some(0));
    assert_eq!(run(&["no-such"]), Some(2));
}

/// With `--json` an error is one document on standard output.
#[test]
fn errors_are_documents_for_scripts() {
    for words in [
        vec!["run", "--setup", "no-such"],
        vec!["diagnose", "no-such"],
        vec!["export", "no-such", "--to", "csv"],
        vec!["import", "no-such.csv", "-o", "none"],
        vec!["run", "--no-such-flag"],
    ] {
        let output = muprime().arg("--json").args(&words).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{words:?}");
        let said = documents(&output);
        assert_eq!(said.len(), 1, "{words:?}: {said:?}");
        assert!(said[0]["error"].as_str().is_some_and(|e| !e.is_empty()), "{words:?}: {said:?}");
        assert_eq!(said[0]["status"], 2, "{words:?}");
    }
}

/// What people read fits into 80 columns: findings, verdicts, what `check` says. The lines of a run fit at a
/// terminal only: in a log they are searched.
#[test]
fn answers_fit_80_columns() {
    let folder = tempfile::tempdir().unwrap();
    let run = |words: &[&str]| {
        let output = muprime()
            .args(words)
            .env("MUPRIME_RUNS", folder.path())
            .current_dir(folder.path())
            .output()
            .unwrap();
        let (out, err) = texts(&output);
        let long: Vec<&str> = out.lines().chain(err.lines()).filter(|l| l.chars().count() > 80).collect();
        assert!(long.is_empty(), "{words:?}: {long:#?}");
    };
    let swept = muprime()
        .args(["run", "first-sweep", "--setup", "virtual", "--fast", "--out", "run"])
        .env("MUPRIME_RUNS", folder.path())
        .current_dir(folder.path())
        .output()
        .unwrap();
    assert_eq!(swept.status.code(), Some(0), "{}", texts(&swept).1);
    run(&["check", "run", "run/points.csv", "first-sweep", "--setup", "virtual"]);
    run(&["diagnose", "run", "--no-pairs"]);
    run(&["doctor", "--seconds", "0.2", "--setup", "virtual", "--plan", "first-sweep"]);
    run(&["check", "no-such.toml"]);
}
