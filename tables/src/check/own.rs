//! What the program writes beside a run's own files: exports, documents of campaigns and studies, tags.

use super::holds;
use miette::{IntoDiagnostic, WrapErr};
use runs::input::{MAX_TABLE_BYTES, bytes_of, parse_toml, text_of};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

/// What a binary export begins and ends with; HDF5 has no end of its own.
const MCAP: &[u8] = b"\x89MCAP0\r\n";
const ARROW: &[u8] = b"ARROW1";

/// The kind of a file that its name or its first bytes tell.
pub(super) fn kind_by_name(path: &Path) -> Option<&'static str> {
    let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    let flat = runs::files::FLAT_MCAP;
    match path.extension().and_then(|e| e.to_str()).unwrap_or_default() {
        "mcap" if begins_with(path, flat) => Some("signals of an export"),
        "arrow" if begins_with(path, ARROW) => Some("Arrow export"),
        "h5" if begins_with(path, b"\x89HDF") => Some("HDF5 export"),
        "jsonl" if begins_with(path, b"{\"schema\":\"muprime.cases/") => Some("file of cases"),
        _ if name == runs::catalogue::ANNOTATIONS => Some("annotations"),
        _ if path.join(runs::campaign::FILE).is_file() => Some("campaign folder"),
        _ => None,
    }
}

fn begins_with(path: &Path, bytes: &[u8]) -> bool {
    let mut head = Vec::new();
    let read = File::open(path).and_then(|file| file.take(bytes.len() as u64).read_to_end(&mut head));
    read.is_ok() && head == bytes
}

/// The kind of a JSON document that this program writes beside verdicts, summaries and logs.
pub(super) fn kind_of_document(path: &Path, document: &serde_json::Value) -> Option<&'static str> {
    let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    match document["schema"].as_str().and_then(|schema| schema.split('/').next()) {
        Some("muprime.fidelity") => return Some("fidelity"),
        Some("muprime.study") => return Some("study"),
        _ => {}
    }
    let crate_of_run = document.get("@graph").is_some();
    let list =
        |has: fn(&serde_json::Value) -> bool| document.as_array().is_some_and(|all| all.iter().all(has));
    match name {
        "claims.json" if list(|of| of["statement"].is_string()) => Some("claims of a campaign"),
        "tips.json" if list(serde_json::Value::is_string) => Some("tips of a campaign"),
        "ro-crate-metadata.json" if crate_of_run => Some("RO-Crate"),
        _ => None,
    }
}

/// Judges a file of such a kind; `None` of another kind. A folder's answer is how many passes its runs hold.
pub(super) fn judge(kind: &str, path: &Path) -> Option<miette::Result<Option<usize>>> {
    let name = path.display().to_string();
    let judged = match kind {
        "signals of an export" => whole(path, MCAP),
        "Arrow export" => whole(path, ARROW),
        "file of cases" => cases(path),
        "annotations" => text_of(path)
            .and_then(|text| Ok(parse_toml::<runs::catalogue::Annotations>(&name, &text)?))
            .and_then(|annotations| annotations.checked().map(drop)),
        "fidelity" => holds::<runs::fidelity::Fidelity>(&name),
        "tips of a campaign" => holds::<Vec<runs::fingertip::FingertipKind>>(&name),
        "campaign folder" => return Some(campaign(path).map(Some)),
        "claims of a campaign" | "study" | "RO-Crate" | "HDF5 export" => Ok(()),
        _ => return None,
    };
    Some(judged.wrap_err(name).map(|()| None))
}

/// Refuses an export that was cut: its last bytes are those that its format ends with.
fn whole(path: &Path, end: &[u8]) -> miette::Result<()> {
    let last = || -> std::io::Result<Vec<u8>> {
        let (mut file, mut last) = (File::open(path)?, Vec::new());
        file.seek(SeekFrom::End(-(end.len() as i64)))?;
        file.read_to_end(&mut last).map(|_| last)
    };
    miette::ensure!(
        last().into_diagnostic()? == end,
        help = "export the run again: `muprime export RUN --to FORMAT`",
        "the file is cut: its end is missing"
    );
    Ok(())
}

/// A file of cases: as many lines as its header states, each of them JSON.
fn cases(path: &Path) -> miette::Result<()> {
    let text = String::from_utf8(bytes_of(path, MAX_TABLE_BYTES)?).into_diagnostic()?;
    let mut lines = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let parsed = serde_json::from_str::<serde_json::Value>(line);
        lines.push(parsed.map_err(|e| miette::miette!("line {}: no case: {e}", i + 1))?);
    }
    let (stated, listed) = (lines[0]["cases"].as_u64(), lines[0]["listed"] == true);
    let there = lines.len() as u64 - 1;
    miette::ensure!(
        stated.is_some() && (!listed || stated == Some(there)),
        help = "write it again with `muprime cases`",
        "line 1: its header states {} cases, and {there} follow",
        stated.unwrap_or(0)
    );
    Ok(())
}

/// A campaign's folder: its runs are in `sessions/`, and each is judged.
fn campaign(path: &Path) -> miette::Result<usize> {
    let mut passes = 0;
    let mut problems = Vec::new();
    let found = std::fs::read_dir(path.join("sessions")).into_iter().flatten().flatten();
    let mut runs: Vec<_> = found.map(|entry| entry.path()).collect();
    runs.sort();
    for run in runs.iter().filter(|run| run.is_dir()) {
        match super::written::run_folder(run) {
            Ok(found) => passes += found.passes.unwrap_or_default(),
            Err(why) => problems.push(format!("{}: {why}", run.display())),
        }
    }
    miette::ensure!(
        problems.is_empty(),
        help = "`muprime check` with the folder of one session says what to do",
        "a campaign; its runs are in sessions/: {}",
        problems.join("; ")
    );
    Ok(passes)
}
