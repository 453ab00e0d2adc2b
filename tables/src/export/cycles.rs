//! The cycles of a run's passes as columns: the curves of the flat record ([`SIGNALS`]) with their session
//! and time.

use super::columns::{Cells, Column, Table};
use super::topics::SIGNALS;
use miette::{Context, IntoDiagnostic};
use realtime::Row;
use realtime::recorder::{self, Entry, Reader};
use runs::run_dir::records_in;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// The curve that numbers the point of a cycle; it has no value between passes.
const POINT: &str = "/sweep/point";

/// The cycles of these points, of every point where none is given. What lies between passes belongs to no
/// point.
///
/// # Errors
/// A record that cannot be opened or read; a point that the run lacks.
pub fn of(folder: &Path, points: &[u32]) -> miette::Result<Table> {
    let point = |row: &Row| SIGNALS.iter().find(|s| s.topic == POINT).and_then(|s| (s.of)(row));
    let (mut sessions, mut times) = (Vec::new(), Vec::new());
    let mut values = SIGNALS.map(|_| Vec::new());
    let mut missing = points.to_vec();
    for (path, session) in records_in(folder)?.iter().zip(1..) {
        let file = File::open(path).into_diagnostic().wrap_err_with(|| path.display().to_string())?;
        for entry in Reader::new(BufReader::new(file)).only(recorder::CYCLES) {
            let Entry::Message { text, .. } = entry else { continue };
            let row: Row = serde_json::from_slice(&text).into_diagnostic()?;
            if !points.is_empty() && !point(&row).is_some_and(|p| points.contains(&(p as u32))) {
                continue;
            }
            missing.retain(|p| point(&row) != Some(f64::from(*p)));
            sessions.push(Some(session));
            times.push(Some(row.now.0 as f64 * 1e-9));
            values.iter_mut().zip(&SIGNALS).for_each(|(column, signal)| column.push((signal.of)(&row)));
        }
    }
    if let Some(point) = missing.first() {
        miette::bail!("{}: the run has no cycles of point {point}", folder.display());
    }
    let mut table = vec![
        Column { name: "session", words: "session of the run, from 1", cells: Cells::Counts(sessions) },
        Column { name: "time_s", words: "loop time since the session began", cells: Cells::Numbers(times) },
    ];
    table.extend(SIGNALS.iter().zip(values).map(|(signal, cells)| Column {
        name: signal.topic.rsplit('/').next().unwrap_or(signal.topic),
        words: signal.words,
        cells: Cells::Numbers(cells),
    }));
    Ok(table)
}
