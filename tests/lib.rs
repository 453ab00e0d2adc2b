//! Helpers that several system tests share.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A file of the repository.
pub fn file(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path)
}

/// The `muprime` that was built beside this test. A missing one fails: build the workspace first.
pub fn muprime() -> Command {
    let test = std::env::current_exe().expect("a test knows where it is");
    let folder = test.parent().and_then(Path::parent).expect("a test stands in target/<profile>/deps");
    let binary = folder.join("muprime");
    assert!(binary.exists(), "{} is missing: cargo build --release --workspace", binary.display());
    Command::new(binary)
}

/// The Python of the independent peers. Missing peers fail: nothing is skipped.
pub fn python() -> Command {
    let python = file("target/venv/bin/python");
    assert!(python.exists(), "{} is missing: run tests/venv", python.display());
    Command::new(python)
}

/// Standard output and standard error as text.
pub fn texts(output: &Output) -> (String, String) {
    (
        String::from_utf8_lossy(&output.stdout).into_owned(),
        String::from_utf8_lossy(&output.stderr).into_owned(),
    )
}

/// The JSON documents on standard output, one a line; anything else there fails.
pub fn documents(output: &Output) -> Vec<serde_json::Value> {
    let (out, _) = texts(output);
    out.lines()
        .map(|line| serde_json::from_str(line).unwrap_or_else(|e| panic!("not JSON: {line}: {e}")))
        .collect()
}
