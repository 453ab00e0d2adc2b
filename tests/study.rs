//! Studies of many cases, as several tests write, submit and gather them.

use crate::{documents, muprime, texts};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Runs a command to its end.
pub fn run(command: &mut Command) -> Output {
    command.output().expect("a command that can be run")
}

/// Runs `muprime` with these words; the JSON document that it prints.
pub fn said(words: &[&str]) -> Value {
    let output = run(muprime().arg("--json").args(words));
    assert!(output.status.success(), "{words:?}: {:?}", texts(&output));
    documents(&output).pop().expect("a document")
}

/// A path as text.
pub fn text(path: &Path) -> &str {
    path.to_str().expect("a path in UTF-8")
}

/// SHA-256 of what is gathered.
pub fn gathered(out: &Path) -> String {
    let whole = said(&["gather", text(out)]);
    whole["sha256"].as_str().expect("a hash").to_string()
}

/// Submits a study; what `submit` says.
pub fn submitted(cases: &Path, out: &Path, more: &[&str]) -> Value {
    said(&[&["submit", text(cases), "--out", text(out)], more].concat())
}

/// A study on this machine; its hash.
pub fn here(cases: &Path, out: &Path) -> String {
    assert_eq!(submitted(cases, out, &[])["missing"], 0);
    gathered(out)
}

/// What a refused command says, as one line.
pub fn refusal(words: &[&str]) -> String {
    let output = run(muprime().args(words));
    assert_eq!(output.status.code(), Some(2), "{:?}", texts(&output));
    // As a terminal folds it.
    texts(&output).1.split_whitespace().filter(|w| *w != "│").collect::<Vec<_>>().join(" ")
}

/// Ridge cases on the coarsest mesh.
pub fn ridge_cases(path: &Path, cases: usize) {
    let count = cases.to_string();
    let words =
        ["cases", "ridge", "--draw", &count, "--elements", "128", "--at-most", "14", "--tolerance", "0.05"];
    let spans = ["amplitude_pp_m=0.3e-6..5e-6:log", "frequency_hz=2e4..1e5:log", "mu0=0.2..1"];
    let spans: Vec<&str> = spans.into_iter().flat_map(|s| ["--span", s]).collect();
    said(&[&words[..], &spans, &["-o", text(path)]].concat());
}

/// A file of cases that hash.
pub fn noop(folder: &Path, cases: u64, hashes: u64) -> PathBuf {
    let path = folder.join("noop.jsonl");
    let (cases, hashes) = (cases.to_string(), hashes.to_string());
    said(&["cases", "noop", "--cases", &cases, "--hashes", &hashes, "-o", text(&path)]);
    path
}

/// A worker for some cases of a file.
pub fn worker(cases: &Path, out: &Path, range: &str) -> Command {
    let mut command = muprime();
    command.args(["case", "--threads", "1", "--cases", text(cases), "--out", text(out), "--range", range]);
    command
}
