//! What the record holds of a pass's cycles, few enough for a page: of each stretch of time the least and the greatest, so that no peak is lost.

use crate::run_dir::records_in;
use miette::{IntoDiagnostic, WrapErr};
use realtime::cycle::Phase;
use realtime::recorder::{self, Entry, Reader};
use realtime::turn::Row;
use serde::Serialize;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// Stretches of a pass at most: twice as many values of each quantity.
const STRETCHES: usize = 100;

/// Cycles of a pass, in whole numbers: the page stays small.
#[derive(Debug, PartialEq, Serialize)]
pub struct Trace {
    /// Number of the point.
    pub point: u32,
    /// Loop time at the middle of each stretch, in ms.
    pub t_ms: Vec<i64>,
    /// Least and greatest lateral force of each stretch in 0.1 mN; none where there was none.
    pub lateral: [Vec<Option<i64>>; 2],
    /// The same of the normal force.
    pub normal: [Vec<Option<i64>>; 2],
    /// The same of the running `mu'`, in thousandths.
    pub mu: [Vec<Option<i64>>; 2],
    /// Position of the plate in the middle of each stretch in um; none where it was not read.
    pub position_um: Vec<Option<i64>>,
    /// Lateness of the latest cycle of each stretch in us; zero in virtual time.
    pub late_us: Vec<i64>,
    /// Time from which the pass is averaged, in ms.
    pub measured_from_ms: Option<i64>,
}

/// The passes of a run's records, in the order in which they were made.
///
/// # Errors
/// A record that cannot be opened; what is damaged is left out.
pub fn of(folder: &Path) -> miette::Result<Vec<Trace>> {
    let mut traces = Vec::new();
    for path in records_in(folder)? {
        let file = File::open(&path).into_diagnostic().wrap_err_with(|| path.display().to_string())?;
        let mut rows: Vec<Row> = Vec::new();
        for entry in &mut Reader::new(BufReader::new(file)).only(recorder::CYCLES) {
            let Entry::Message { text, .. } = entry else { continue };
            let Ok(row) = serde_json::from_slice::<Row>(&text) else { continue };
            let slides = !matches!(row.marker.phase, Phase::Idle | Phase::Zero);
            if rows.last().is_some_and(|last| !slides || last.marker.point != row.marker.point) {
                traces.extend(trace(&rows));
                rows.clear();
            }
            if slides {
                rows.push(row);
            }
        }
        traces.extend(trace(&rows));
    }
    Ok(traces)
}

fn trace(rows: &[Row]) -> Option<Trace> {
    let point = rows.first()?.marker.point;
    let stretches: Vec<&[Row]> = rows.chunks(rows.len().div_ceil(STRETCHES)).collect();
    let ms = |row: &Row| (row.now.0 / 1_000_000) as i64;
    let ends = |scale: f64, of: fn(&Row) -> Option<f64>| {
        let all = |rows: &&[Row], pick: fn(f64, f64) -> f64| {
            rows.iter().filter_map(of).reduce(pick).map(|v| (v * scale).round() as i64)
        };
        [f64::min, f64::max].map(|pick| stretches.iter().map(|rows| all(rows, pick)).collect::<Vec<_>>())
    };
    let middle = |rows: &&[Row]| rows[rows.len() / 2];
    let position = |row: Row| Some((row.inputs.seen.stage.ok()?.position_m * 1e6).round() as i64);
    let late =
        |rows: &&[Row]| rows.iter().map(|row| row.inputs.seen.lateness.0 / 1_000).max().unwrap_or(0) as i64;
    Some(Trace {
        point,
        t_ms: stretches.iter().map(|rows| ms(&middle(rows))).collect(),
        position_um: stretches.iter().map(|rows| position(middle(rows))).collect(),
        late_us: stretches.iter().map(late).collect(),
        lateral: ends(1e4, |r| r.inputs.seen.forces.lateral.ok().map(|f| f.value)),
        normal: ends(1e4, |r| r.inputs.seen.forces.normal.ok().map(|f| f.value)),
        mu: ends(1e3, |r| r.mu_relative.ok().map(|m| m.value)),
        measured_from_ms: rows.iter().find(|r| r.marker.phase == Phase::Measure).map(ms),
    })
}
