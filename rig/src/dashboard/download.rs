//! Files of a run's folder, as they are: read piece by piece, so that a record of hours needs no memory.

use axum::body::{Body, Bytes};
use axum::http::header;
use axum::response::{IntoResponse, Response};
use hyper::body::Frame;
use runs::verdict_text::files;
use std::fs::{File, OpenOptions};
use std::io::Read;
use std::path::Path;
use std::pin::Pin;
use std::task::{Context, Poll};
use tokio::sync::mpsc::{Receiver, channel};

/// Bytes of a piece.
const PIECE: usize = 64 * 1024;
/// Pieces that wait for a slow browser.
const WAITING: usize = 4;
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
    let mut file = runs::files::open_plain(&run.join(name), OpenOptions::new().read(true)).ok()?;
    let (to, pieces) = channel(WAITING);
    let send = move || {
        while let Some(piece) = next(&mut file).transpose() {
            if to.blocking_send(piece).is_err() {
                return;
            }
        }
    };
    std::thread::Builder::new().name("download".into()).spawn(send).ok()?;
    Some(([(header::CONTENT_TYPE, "application/octet-stream")], Body::new(Pieces(pieces))).into_response())
}

fn next(file: &mut File) -> std::io::Result<Option<Bytes>> {
    let mut piece = vec![0; PIECE];
    let n = file.read(&mut piece)?;
    piece.truncate(n);
    Ok((n > 0).then(|| piece.into()))
}

/// The body of an answer. A file that cannot be read further ends it early, so that nobody takes it for
/// whole.
struct Pieces(Receiver<std::io::Result<Bytes>>);

impl hyper::body::Body for Pieces {
    type Data = Bytes;
    type Error = std::io::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<std::io::Result<Frame<Bytes>>>> {
        self.0.poll_recv(context).map(|piece| piece.map(|piece| piece.map(Frame::data)))
    }
}
