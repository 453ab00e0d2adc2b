//! What is missing, how long a case takes, and the ranges that an engine's tasks get. Times size the ranges
//! and bound the tasks; no result depends on them.
#![allow(clippy::disallowed_methods, reason = "a pilot measures wall-clock time")]

use super::run::entry;
use super::study::Study;
use serde::Serialize;
use std::ops::Range;
use std::time::{Duration, Instant};

/// Cases that a shard has at most: what is lost where its worker is killed, and held by who reads it.
pub(super) const MOST: u64 = 100_000;
/// Tasks of a study at most, about: the folders of its shards then stay small.
const TASKS: u64 = 1_000_000;
/// Memory that a task gets for each byte that the pilot took at most: cases differ.
const MEMORY_FACTOR: u64 = 2;
/// Memory that a core of a task gets at least, bytes: shells and libraries need it beside the program.
const LEAST_MEMORY: u64 = 64 << 20;
/// Tasks for each worker at least, so that none waits long for the last.
const TASKS_A_WORKER: u64 = 4;

/// How long a case takes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Pilot {
    /// Cases that were run.
    pub cases: usize,
    /// Mean time of one, s.
    pub mean_s: f64,
    /// The longest, s.
    pub longest_s: f64,
    /// Greatest resident memory of this program up to the pilot's end, bytes; none where the system lacks it.
    pub peak_bytes: Option<u64>,
}

impl Pilot {
    /// Memory that a task of so many cores may take, bytes: twice the peak for each core, at least 64 MiB,
    /// doubled in each round after the first, for tasks that a lack of memory ended.
    pub fn memory_bytes(&self, cores: u64, round: u32) -> Option<u64> {
        self.peak_bytes.map(|peak| ((peak * MEMORY_FACTOR).max(LEAST_MEMORY) * cores) << round)
    }
}

/// `VmHWM` of this process.
fn peak_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(1024 * line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?)
}

/// Ranges for an engine.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TaskPlan {
    /// One a task.
    pub ranges: Vec<Range<u64>>,
    /// Cases of a task.
    pub cases_a_task: u64,
    /// Time that a task is expected to take, s.
    pub task_s: f64,
    /// Time that a task may take, s.
    pub limit_s: f64,
}

/// Cases of some ranges.
pub(super) fn length(ranges: &[Range<u64>]) -> u64 {
    ranges.iter().map(|r| r.end - r.start).sum()
}

/// A range in ranges of `most` cases.
pub(super) fn pieces(range: &Range<u64>, most: u64) -> impl Iterator<Item = Range<u64>> + use<> {
    let end = range.end;
    (range.start..end).step_by(most as usize).map(move |start| start..(start + most).min(end))
}

/// Runs cases spread over what is missing, one at a time, for `budget` at most; their results are dropped.
///
/// # Errors
/// A case that cannot be made.
pub fn measure(study: &Study, holes: &[Range<u64>], cases: usize, budget: Duration) -> miette::Result<Pilot> {
    let missing = length(holes);
    let count = (cases.max(1) as u64).min(missing);
    let (begun, mut times) = (Instant::now(), Vec::new());
    for i in 0..count {
        if !times.is_empty() && begun.elapsed() >= budget {
            break;
        }
        // In an order that is spread however early it ends: the golden ratio's multiples.
        let place = (0.5 + i as f64 * 0.618_033_988_749_895).fract();
        let index = nth(holes, (place * missing as f64) as u64);
        for line in study.file.lines(index..index + 1)? {
            let (index, line) = line?;
            let case = study.case(index, line.as_ref())?;
            let start = Instant::now();
            std::hint::black_box(entry(study.kind, index, case));
            times.push(start.elapsed().as_secs_f64());
        }
    }
    let mean_s = times.iter().sum::<f64>() / times.len().max(1) as f64;
    let longest_s = times.iter().fold(0.0, |a, b| f64::max(a, *b));
    Ok(Pilot { cases: times.len(), mean_s, longest_s, peak_bytes: peak_bytes() })
}

/// The `n`th index of what is missing.
fn nth(holes: &[Range<u64>], mut n: u64) -> u64 {
    for hole in holes {
        let length = hole.end - hole.start;
        if n < length {
            return hole.start + n;
        }
        n -= length;
    }
    holes.last().map_or(0, |hole| hole.end - 1)
}

/// Cuts what is missing into tasks of about `task_s` seconds; none is over a third of `limit_s` where that is given.
pub fn cut(holes: &[Range<u64>], pilot: &Pilot, workers: u64, task_s: f64, limit_s: Option<f64>) -> TaskPlan {
    let missing = length(holes);
    let wanted = limit_s.map_or(task_s, |limit| task_s.min(limit / 3.0));
    let by_time = (wanted / pilot.mean_s.max(1e-6)) as u64;
    let by_share = missing.div_ceil(TASKS_A_WORKER * workers.max(1));
    let cases_a_task = by_time.min(by_share).min(MOST).max(missing.div_ceil(TASKS)).max(1);
    let ranges = holes.iter().flat_map(|hole| pieces(hole, cases_a_task)).collect();
    let expected = cases_a_task as f64 * pilot.mean_s;
    let limit_s = limit_s.unwrap_or(60.0 + 3.0 * expected + 5.0 * pilot.longest_s);
    TaskPlan { ranges, cases_a_task, task_s: expected, limit_s }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tasks_cover_what_is_missing_once_and_fit_their_limit() {
        let pilot = Pilot { cases: 5, mean_s: 0.5, longest_s: 2.0, peak_bytes: Some(40_000_000) };
        for (holes, workers, limit) in [
            (Vec::from([(0, 1000)]), 2, None),
            (Vec::from([(3, 4), (10, 5000)]), 8, Some(60.0)),
            (Vec::from([(0, 1)]), 1, Some(1.0)),
            (Vec::from([(0, 2_000_000)]), 4, None),
        ] {
            let holes: Vec<Range<u64>> = holes.into_iter().map(|(a, b)| a..b).collect();
            let plan = cut(&holes, &pilot, workers, 300.0, limit);
            let flat = |ranges: &[Range<u64>]| ranges.iter().flat_map(|r| r.clone()).collect::<Vec<u64>>();
            assert_eq!(flat(&plan.ranges), flat(&holes));
            assert!(
                plan.cases_a_task == 1 || plan.task_s <= 300.0_f64.min(limit.unwrap_or(900.0) / 3.0),
                "{plan:?}"
            );
            assert!(plan.limit_s >= plan.task_s || plan.cases_a_task == 1);
        }
        assert_eq!(pilot.memory_bytes(4, 1), Some(640_000_000));
        assert!(peak_bytes().is_some_and(|bytes| bytes > 1_000_000) || !cfg!(target_os = "linux"));
        assert_eq!(nth(&[3..4, 10..12], 0), 3);
        assert_eq!(nth(&[3..4, 10..12], 2), 11);
    }
}
