//! Time series cut into passes: a stretch of steady sliding is one pass.
//!
//! The path is the position, or the integral of the velocity. Its turning points and its rests part it into
//! legs; within a leg the local slope of the path is the velocity, and a sample is steady where velocity,
//! load and vibration differ by less than a tenth over the window about it. Steady samples in a row are a
//! stretch; its beginning, in which friction settles, is left out.

use super::targets::Id;
use super::values::{Dropped, Values, middle, sorted};
use path::{at_rests, path, turning_points, velocities};
use serde::Serialize;
use steady::{mean, steady};

mod path;
mod steady;

pub use steady::Spread;

/// How a series is cut.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Cut {
    /// s at the beginning of a stretch that are left out; a fifth of it where this is not stated.
    pub settle_s: Option<f64>,
    /// s that a pass may last: longer stretches are several passes.
    pub window_s: Option<f64>,
}

/// Fewest samples of a pass.
const FEWEST: usize = 10;
/// Share of the largest speed below which the stage stands still.
const STILL: f64 = 1e-4;
/// Half a window is at least this fraction of a leg.
const WINDOW: usize = 50;

/// How a series was cut, and what became of its samples.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Counts {
    /// The requested cut.
    pub cut: Cut,
    /// Samples read.
    pub samples: usize,
    /// Samples in passes.
    pub in_passes: usize,
    /// Samples left out while speed, load or vibration changed, or nothing slid.
    pub changing: usize,
    /// Samples left out at the beginnings of stretches.
    pub settling: usize,
    /// Samples left out in stretches too short for a pass.
    pub too_short: usize,
    /// Turning points of the sliding direction.
    pub reversals: usize,
    /// Steady stretches.
    pub stretches: usize,
}

/// Cuts samples into passes, each run by itself. The samples of a run must be in the order of time.
///
/// # Errors
/// In words: time that does not rise, no path, no steady stretch.
pub fn cut(samples: &[Values], how: &Cut) -> Result<(Vec<(Values, Spread)>, Counts), String> {
    let mut counts = Counts { cut: *how, samples: samples.len(), ..Counts::default() };
    let mut passes = Vec::new();
    for run in samples.chunk_by(|a, b| a.run == b.run) {
        passes.extend(cut_run(run, &mut counts)?);
    }
    if passes.is_empty() {
        return Err(format!(
            "no steady stretch of sliding among {} samples: {} are of changing speed, load or vibration, {} of beginnings, {} in stretches \
             of fewer than {FEWEST} samples",
            counts.samples, counts.changing, counts.settling, counts.too_short
        ));
    }
    Ok((passes, counts))
}

/// Cuts the samples of a run.
fn cut_run(samples: &[Values], counts: &mut Counts) -> Result<Vec<(Values, Spread)>, String> {
    let (how, mut passes) = (counts.cut, Vec::new());
    let times = rising(samples)?;
    let path = path(samples, &times)?;
    let turns = turning_points(&path);
    refuse_one_way(samples, &turns)?;
    counts.reversals += turns.len().saturating_sub(2);
    let legs = turns.windows(2).flat_map(|leg| at_rests(&times, &path, leg[0], leg[1]));
    let legs: Vec<(usize, (Vec<f64>, usize))> =
        legs.map(|(from, to)| (from, velocities(&times, &path, from, to, (to - from) / WINDOW))).collect();
    let fastest = legs.iter().flat_map(|(_, (slopes, _))| slopes).fold(0.0f64, |m, v| m.max(v.abs()));
    let ranges = legs.iter().flat_map(|(from, (v, half))| steady(samples, v, *half, *from, STILL * fastest));
    let ranges: Vec<(usize, usize)> = ranges.collect();
    counts.stretches += ranges.len();
    counts.changing += samples.len() - ranges.iter().map(|r| r.1 - r.0).sum::<usize>();
    for (from, to) in ranges {
        let lasts = times[to - 1] - times[from];
        let settled = times[from] + how.settle_s.unwrap_or(0.2 * lasts);
        let begin = from + times[from..to].partition_point(|t| *t < settled);
        counts.settling += begin - from;
        let mut at = begin;
        while at < to {
            let end = match how.window_s {
                Some(window) => at + times[at..to].partition_point(|t| *t < times[at] + window),
                None => to,
            };
            let end = end.max(at + 1);
            // The rest of a stretch that is shorter than half a window is no pass of its own.
            let rest = how.window_s.is_some_and(|w| at > begin && times[end - 1] - times[at] < 0.5 * w);
            if end - at < FEWEST || rest {
                counts.too_short += end - at;
            } else {
                let pass = mean(&samples[at..end], &path[at..end], &times[at..end]);
                if pass.0.speed().is_some_and(|speed| speed > STILL * fastest) {
                    passes.push(pass);
                    counts.in_passes += end - at;
                } else {
                    counts.changing += end - at;
                }
            }
            at = end;
        }
    }
    Ok(passes)
}

/// The times of the samples, which must rise.
fn rising(samples: &[Values]) -> Result<Vec<f64>, String> {
    let times: Vec<f64> = samples.iter().filter_map(|s| s.get(Id::Time)).collect();
    if times.len() < samples.len() {
        return Err("a series needs a time in every row (map a column to time)".into());
    }
    if let Some(k) = times.windows(2).position(|w| w[1] <= w[0]) {
        let why = if times[k + 1] < times[k] {
            "it goes back: map the column that numbers the steps (HEADER=run), or give one record at a time"
        } else {
            "samples share a stamp: the clock is too coarse; map time from a finer column, or from one that counts the samples at a \
             known rate (--map Sample=time:0.01s is a sample every 0.01 s)"
        };
        return Err(format!(
            "the time does not rise from row {} ({} s) to row {} ({} s): {why}",
            samples[k].place,
            times[k],
            samples[k + 1].place,
            times[k + 1]
        ));
    }
    Ok(times)
}

/// Refuses a position that turns back while the direction stays the same: the friction would have a wrong
/// sign in every other leg.
fn refuse_one_way(samples: &[Values], turns: &[usize]) -> Result<(), String> {
    let ways: Vec<f64> = samples.iter().filter_map(|s| s.get(Id::Direction)).collect();
    let one = ways.len() == samples.len() && ways.windows(2).all(|w| w[0] == w[1]);
    let by_position = samples.iter().all(|s| s.get(Id::Position).is_some());
    match turns {
        [_, turn, .., _] if one && by_position => Err(format!(
            "the position turns back {} times (first in row {}), but the direction is {} in every row: leave the direction out of --set and \
             --map, the position gives it",
            turns.len() - 2,
            samples[*turn].place,
            ways[0]
        )),
        _ => Ok(()),
    }
}

/// Takes off what is no sample: rows in which a value is empty that most rows have, or is one that no pass
/// can have; and a last sample that is the one before it once more, as some recorders write their end.
pub fn unusable(samples: &mut Vec<Values>) -> Vec<Dropped> {
    let known = |id: Id| samples.iter().filter(|s| s.get(id).is_some()).count();
    let motion = [Id::Time, Id::Position, Id::Velocity, Id::Speed, Id::Direction, Id::NormalForce];
    let columns = motion.into_iter().chain([Id::LateralForce, Id::FrictionForce, Id::FrictionCoefficient]);
    let needed: Vec<Id> = columns.filter(|id| 2 * known(*id) > samples.len()).collect();
    let drop = |s: &Values, id: Id, reason: &str| s.drop(id.target().column, s.get(id), reason);
    let loads = samples.iter().filter_map(|s| s.get(Id::NormalForce)).map(f64::abs);
    let load = middle(&sorted(loads.filter(|load| *load > 0.0)));
    // What rests has no direction.
    let rests = |s: &Values, id: Id| id == Id::Direction && s.speed() == Some(0.0);
    let bad = |s: &Values| match needed.iter().copied().find(|id| s.get(*id).is_none() && !rests(s, *id)) {
        Some(id) => Some(drop(s, id, "empty")),
        None => s.implausible(load?),
    };
    let mut dropped: Vec<Dropped> = samples.iter().filter_map(bad).collect();
    samples.retain(|s| bad(s).is_none());
    if let [.., before, last] = samples.as_slice()
        && last.get(Id::Time).is_some()
        && before.get(Id::Time) == last.get(Id::Time)
    {
        dropped.push(drop(last, Id::Time, "the last sample is there twice"));
        samples.pop();
    }
    dropped
}

#[cfg(test)]
mod tests;
