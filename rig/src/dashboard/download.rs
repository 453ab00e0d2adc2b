//! Files of a run's folder, as they are: read piece by piece, so that a record of hours needs no memory.

use axum::body::Body;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use runs::verdict_text::files;
use std::fs::OpenOptions;
use std::path::Path;
use tokio_util::io::ReaderStream;

/// Bytes of a piece.
const PIECE: usize = 64 * 1024;
/// What may be downloaded besides the records.
const NAMES: [&str; 11] = [
    "points.csv",
    "passes.jsonl",
    "rig.toml",
    "run.toml",
    "summary.json",
    runs::catalogue::ANNOTATIONS,
    "report.html",
    files::PAGE,
    files::DOCUMENT,
    files::CORRECTED_MODEL,
    files::NEXT_PLAN,
];

/// The names of a folder's files that may be downloaded, records last.
pub fn files_in(run: &Path) -> Vec<String> {
    let records = runs::run_dir::records_in(run).unwrap_or_default();
    let records = records.iter().filter_map(|path| Some(path.file_name()?.to_str()?.to_string()));
    NAMES.iter().filter(|name| run.join(name).is_file()).map(ToString::to_string).chain(records).collect()
}

/// One of these files; none of another name, and nothing that is not a plain file.
pub fn file(run: &Path, name: &str) -> Option<Response> {
    if !files_in(run).iter().any(|one| one == name) {
        return None;
    }
    // A file that cannot be read further ends the answer early, so that nobody takes it for whole.
    let file = runs::files::open_plain(&run.join(name), OpenOptions::new().read(true)).ok()?;
    let pieces = ReaderStream::with_capacity(tokio::fs::File::from_std(file), PIECE);
    Some(([(header::CONTENT_TYPE, "application/octet-stream")], Body::from_stream(pieces)).into_response())
}
