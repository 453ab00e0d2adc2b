//! Time series cut into passes: a stretch of steady sliding is one pass.
//!
//! The path is the position, or the integral of the velocity. Its turning points part it into legs; within a leg the local
//! slope of the path is the velocity, and a sample is steady where velocity, load and vibration change by less than a tenth
//! over the window about it. Steady samples in a row are a stretch; its beginning, in which friction settles, is left out.

use super::targets::Id;
use super::values::{Dropped, Values};
use path::{path, turning_points, velocities};
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

/// Cuts samples into passes. They must be in the order of time.
///
/// # Errors
/// In words: time that does not rise, no path, no steady stretch.
pub fn cut(samples: &[Values], how: &Cut) -> Result<(Vec<Values>, Vec<Spread>, Counts), String> {
    let times = rising(samples)?;
    let path = path(samples, &times)?;
    let turns = turning_points(&path);
    refuse_one_way(samples, &turns)?;
    let reversals = turns.len().saturating_sub(2);
    let mut counts = Counts { cut: *how, samples: samples.len(), reversals, ..Counts::default() };
    let legs = turns.windows(2).map(|leg| (leg[0], velocities(&times, &path, leg[0], leg[1])));
    let legs: Vec<(usize, (Vec<f64>, usize))> = legs.collect();
    let fastest = legs.iter().flat_map(|(_, (slopes, _))| slopes).fold(0.0f64, |m, v| m.max(v.abs()));
    let ranges = legs.iter().flat_map(|(from, (v, half))| steady(samples, v, *half, *from, STILL * fastest));
    let ranges: Vec<(usize, usize)> = ranges.collect();
    counts.stretches = ranges.len();
    counts.changing = samples.len() - ranges.iter().map(|r| r.1 - r.0).sum::<usize>();
    let (mut passes, mut spreads) = (Vec::new(), Vec::new());
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
                let (pass, spread) = mean(&samples[at..end], &path[at..end], &times[at..end]);
                passes.push(pass);
                spreads.push(spread);
                counts.in_passes += end - at;
            }
            at = end;
        }
    }
    if passes.is_empty() {
        return Err(format!(
            "no steady stretch of sliding among {} samples: {} are of changing speed, load or vibration, {} of beginnings, {} in stretches \
             of fewer than {FEWEST} samples",
            counts.samples, counts.changing, counts.settling, counts.too_short
        ));
    }
    Ok((passes, spreads, counts))
}

/// The times of the samples, which must rise.
fn rising(samples: &[Values]) -> Result<Vec<f64>, String> {
    let times: Vec<f64> = samples.iter().filter_map(|s| s.get(Id::Time)).collect();
    if times.len() < samples.len() {
        return Err("a series needs a time in every row (map a column to time)".into());
    }
    if let Some(k) = times.windows(2).position(|w| w[1] <= w[0]) {
        let why = if times[k + 1] < times[k] {
            "it goes back: give one record at a time"
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

/// Takes off what is no sample: rows in which a value is empty that most rows have, and a last sample that is
/// the one before it once more, as some recorders write their end.
pub fn unusable(samples: &mut Vec<Values>) -> Vec<Dropped> {
    let known = |id: Id| samples.iter().filter(|s| s.get(id).is_some()).count();
    let motion = [Id::Time, Id::Position, Id::Velocity, Id::NormalForce];
    let columns = motion.into_iter().chain([Id::LateralForce, Id::FrictionForce, Id::FrictionCoefficient]);
    let needed: Vec<Id> = columns.filter(|id| 2 * known(*id) > samples.len()).collect();
    let drop = |s: &Values, id: Id, reason: &str| s.drop(id.target().column, s.get(id), reason);
    let empty = |s: &Values| needed.iter().copied().find(|id| s.get(*id).is_none());
    let mut dropped: Vec<Dropped> =
        samples.iter().filter_map(|s| Some(drop(s, empty(s)?, "empty"))).collect();
    samples.retain(|s| empty(s).is_none());
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
