//! What the record holds of a pass's cycles, few enough for a page: of each stretch of time the least and the greatest, so that no peak is lost.
//! An error is a record that cannot be opened; what is damaged is left out.

use crate::run_dir::{open_record, records_in};
use realtime::recorder::{self, Entry};
use realtime::{Phase, Row};
use serde::Serialize;
use std::path::Path;

/// Stretches of a pass at most: twice as many values of each quantity.
const STRETCHES: usize = 100;
/// Stretches of a window at most: about as many as a wide screen has columns.
const STRETCHES_OF_WINDOW: usize = 2000;

/// Cycles of a pass, in whole numbers as text (`packed`): the page stays small.
#[derive(Debug, PartialEq, Serialize)]
pub struct Trace {
    /// Number of the point.
    pub point: u32,
    /// Loop time at the middle of each stretch, in 0.1 ms.
    pub t: String,
    /// Least and greatest lateral force of each stretch in 0.1 mN; none where there was none.
    pub lateral: [String; 2],
    /// The same of the normal force.
    pub normal: [String; 2],
    /// The same of the running `mu'`, in thousandths.
    pub mu: [String; 2],
    /// Position of the plate in the middle of each stretch in um; none where it was not read.
    pub position: String,
    /// Lateness of the latest cycle of each stretch in us; zero in virtual time.
    pub late: String,
    /// Time from which the pass is averaged, in ms.
    pub measured_from_ms: Option<i64>,
}

/// The cycles of the passes within a window of loop time.
#[derive(Debug, PartialEq, Serialize)]
pub struct TraceWindow {
    /// Cycles of a stretch: 1 where every cycle is given as it was recorded.
    pub stretch: usize,
    /// The passes, cut at the window's ends.
    pub traces: Vec<Trace>,
}

/// What a page shows of a cycle, in the units of [`Trace`].
#[derive(Clone, Copy)]
struct Cycle {
    point: u32,
    t: i64,
    lateral: Option<i64>,
    normal: Option<i64>,
    mu: Option<i64>,
    position: Option<i64>,
    late: i64,
    measured: bool,
}

impl Cycle {
    /// `None` between the passes.
    fn of(row: &Row) -> Option<Self> {
        let whole = |value: f64, scale: f64| (value * scale).round() as i64;
        let seen = &row.inputs.seen;
        (!matches!(row.marker.phase, Phase::Idle | Phase::Zero)).then(|| Cycle {
            point: row.marker.point,
            t: (row.now.0 / 100_000) as i64,
            lateral: seen.forces.lateral.ok().map(|f| whole(f.value, 1e4)),
            normal: seen.forces.normal.ok().map(|f| whole(f.value, 1e4)),
            mu: row.mu_relative.ok().map(|m| whole(m.value, 1e3)),
            position: seen.stage.ok().map(|stage| whole(stage.position_m, 1e6)),
            late: (seen.lateness.0 / 1_000) as i64,
            measured: row.marker.phase == Phase::Measure,
        })
    }
}

/// The passes of a run's records, in the order in which they were made.
pub fn of(folder: &Path) -> miette::Result<Vec<Trace>> {
    let mut traces = Vec::new();
    passes(folder, None, |cycles| traces.extend(trace(cycles, cycles.len().div_ceil(STRETCHES))))?;
    Ok(traces)
}

/// The same between two loop times in s, as finely as a screen shows it.
pub fn within(folder: &Path, window_s: [f64; 2]) -> miette::Result<TraceWindow> {
    let mut all = Vec::new();
    passes(folder, Some(window_s), |cycles| all.push(cycles.to_vec()))?;
    let stretch = all.iter().map(Vec::len).sum::<usize>().div_ceil(STRETCHES_OF_WINDOW).max(1);
    Ok(TraceWindow { stretch, traces: all.iter().filter_map(|cycles| trace(cycles, stretch)).collect() })
}

/// Hands on the cycles of each pass.
fn passes(folder: &Path, window_s: Option<[f64; 2]>, mut each: impl FnMut(&[Cycle])) -> miette::Result<()> {
    for path in records_in(folder)? {
        let mut reader = open_record(&path, recorder::CYCLES)?;
        let mut cycles: Vec<Cycle> = Vec::new();
        let mut window = [0, u64::MAX];
        while let Some(entry) = reader.next() {
            let text = match entry {
                Entry::Message { log_time, text, .. } if (window[0]..=window[1]).contains(&log_time) => text,
                Entry::Facts { name, facts } if name == recorder::HEADER => {
                    let start: u64 = facts.get("start_unix_ns").and_then(|s| s.parse().ok()).unwrap_or(0);
                    if let Some(ends) = window_s {
                        window = ends.map(|s| start.saturating_add((s.max(0.0) * 1e9) as u64));
                        reader.between(window);
                    }
                    continue;
                }
                _ => continue,
            };
            let Ok(row) = serde_json::from_slice::<Row>(&text) else { continue };
            let cycle = Cycle::of(&row);
            if cycles.last().is_some_and(|last| cycle.is_none_or(|now| now.point != last.point)) {
                each(&cycles);
                cycles.clear();
            }
            cycles.extend(cycle);
        }
        each(&cycles);
    }
    Ok(())
}

fn trace(cycles: &[Cycle], stretch: usize) -> Option<Trace> {
    let point = cycles.first()?.point;
    let stretches = || cycles.chunks(stretch);
    let ends = |of: fn(&Cycle) -> Option<i64>| {
        [false, true].map(|greatest| {
            packed(stretches().map(|cycles| {
                let all = cycles.iter().filter_map(of);
                if greatest { all.max() } else { all.min() }
            }))
        })
    };
    let middle = |cycles: &[Cycle]| cycles[cycles.len() / 2];
    Some(Trace {
        point,
        t: packed(stretches().map(|cycles| Some(middle(cycles).t))),
        position: packed(stretches().map(|cycles| middle(cycles).position)),
        late: packed(stretches().map(|cycles| cycles.iter().map(|c| c.late).max())),
        lateral: ends(|c| c.lateral),
        normal: ends(|c| c.normal),
        mu: ends(|c| c.mu),
        measured_from_ms: cycles.iter().find(|c| c.measured).map(|c| c.t / 10),
    })
}

/// Digits of [`packed`]: those of base 64.
const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

/// Whole numbers as text: of each the difference from the one before, its sign as the last bit, plus one; 0
/// stands for none. Five bits a digit, the lowest first; a digit from 32 on has another behind it (as in
/// source maps).
fn packed(values: impl Iterator<Item = Option<i64>>) -> String {
    let (mut text, mut before) = (String::new(), 0i64);
    for value in values {
        let mut left = value.map_or(0, |v| {
            let step = v.saturating_sub(before).clamp(-(1 << 50), 1 << 50);
            before += step;
            ((step << 1) ^ (step >> 63)) as u64 + 1
        });
        loop {
            let more = if left >= 32 { 32 } else { 0 };
            text.push(char::from(DIGITS[(left % 32 + more) as usize]));
            left /= 32;
            if left == 0 {
                break;
            }
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::packed;

    /// What explore.js does.
    fn unpacked(text: &str) -> Vec<Option<i64>> {
        let (mut all, mut before, mut left, mut shift) = (Vec::new(), 0i64, 0u64, 0);
        for digit in text.bytes() {
            let digit = super::DIGITS.iter().position(|d| *d == digit).unwrap() as u64;
            left |= (digit % 32) << shift;
            shift += 5;
            if digit < 32 {
                all.push((left > 0).then(|| {
                    let zigzag = left - 1;
                    before +=
                        if zigzag % 2 == 0 { (zigzag / 2) as i64 } else { -(zigzag.div_ceil(2) as i64) };
                    before
                }));
                (left, shift) = (0, 0);
            }
        }
        all
    }

    #[test]
    fn packed_numbers_are_the_same_again_and_short() {
        let all = [Some(0), Some(-1), None, Some(5123), Some(5123), Some(-987_654_321), None, None, Some(15)];
        assert_eq!(unpacked(&packed(all.into_iter())), all);
        assert_eq!(packed([Some(3), Some(4), None, Some(2)].into_iter()), "HDAE");
    }
}
