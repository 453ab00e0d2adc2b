//! Time series cut into passes: a stretch of steady sliding is one pass.
//!
//! The path is the position, or the integral of the velocity. Its turning points part it into legs; within a leg the local
//! slope of the path is the velocity, and a sample is steady where velocity, load and vibration change by less than a tenth
//! over the window about it. Steady samples in a row are a stretch; its beginning, in which friction settles, is left out.

use super::targets::Id;
use super::values::{Dropped, Values, mean as average};
use models::pass::Pass;
use serde::Serialize;

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
/// Relative change over the window about a sample from which it is not steady.
const STEADY: f64 = 0.1;
/// Share of the path's range that a turn must go back to be one.
const TURN: f64 = 0.05;
/// Relative standard error of a velocity that is good enough: a change of a tenth is several of them.
const SLOPE_KNOWN: f64 = 0.015;
/// Half window within a leg, as a share of its samples, and the fewest.
const WINDOW: (usize, usize) = (50, 3);
/// Share of the largest speed below which the stage stands still.
const STILL: f64 = 1e-4;

/// What became of the samples.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Counts {
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
    let path = path(samples, &times)?;
    let turns = turning_points(&path);
    let mut counts =
        Counts { samples: samples.len(), reversals: turns.len().saturating_sub(2), ..Counts::default() };
    refuse_one_way(samples, &turns)?;
    let legs: Vec<(usize, (Vec<f64>, usize))> =
        turns.windows(2).map(|leg| (leg[0], velocities(&times, &path, leg[0], leg[1]))).collect();
    let fastest = legs.iter().flat_map(|(_, (slopes, _))| slopes).fold(0.0f64, |m, v| m.max(v.abs()));
    let still = STILL * fastest;
    let ranges: Vec<(usize, usize)> =
        legs.iter().flat_map(|(from, (slopes, half))| steady(samples, slopes, *half, *from, still)).collect();
    counts.stretches = ranges.len();
    let stretched: usize = ranges.iter().map(|r| r.1 - r.0).sum();
    counts.changing = samples.len() - stretched;
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
    let columns = [
        Id::Time,
        Id::Position,
        Id::Velocity,
        Id::NormalForce,
        Id::LateralForce,
        Id::FrictionForce,
        Id::FrictionCoefficient,
    ];
    let needed: Vec<Id> = columns.into_iter().filter(|id| 2 * known(*id) > samples.len()).collect();
    let drop = |s: &Values, id: Id, reason: &str| Dropped {
        row: s.place,
        column: id.target().column.into(),
        text: s.get(id).map(|v| v.to_string()).unwrap_or_default(),
        reason: reason.into(),
    };
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

/// What a stretch has besides its means.
#[derive(Clone, Copy, Debug)]
pub struct Spread {
    normal_sd_n: f64,
    lateral_sd_n: f64,
    samples: u64,
}

impl Spread {
    /// Into the pass.
    pub fn put(&self, pass: &mut Pass) {
        pass.normal_force_sd_n = Some(self.normal_sd_n);
        pass.lateral_force_sd_n = Some(self.lateral_sd_n);
        pass.samples = Some(self.samples);
    }
}

/// The path in m: the position, else the integral of the velocity.
fn path(samples: &[Values], times: &[f64]) -> Result<Vec<f64>, String> {
    let positions: Vec<f64> = samples.iter().filter_map(|s| s.get(Id::Position)).collect();
    if positions.len() == samples.len() {
        return Ok(positions);
    }
    let velocity = |s: &Values| {
        let speed = s.speed()?;
        Some(if speed == 0.0 { 0.0 } else { s.direction()? * speed })
    };
    let velocities: Vec<f64> = samples.iter().filter_map(velocity).collect();
    if velocities.len() < samples.len() {
        return Err(
            "a series needs a position, a velocity with a sign, or a speed and a direction in every row"
                .into(),
        );
    }
    let mut at = 0.0;
    let mut path = vec![0.0];
    for k in 1..times.len() {
        at += 0.5 * (velocities[k] + velocities[k - 1]) * (times[k] - times[k - 1]);
        path.push(at);
    }
    Ok(path)
}

/// Places where the path turns by more than a share of its range, with both ends.
fn turning_points(path: &[f64]) -> Vec<usize> {
    let (low, high) =
        path.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), p| (a.min(*p), b.max(*p)));
    let back = TURN * (high - low);
    let (mut turns, mut lowest, mut highest, mut way) = (vec![0], 0, 0, 0.0);
    for k in 0..path.len() {
        if path[k] > path[highest] {
            highest = k;
        }
        if path[k] < path[lowest] {
            lowest = k;
        }
        if way >= 0.0 && path[k] < path[highest] - back {
            if way > 0.0 {
                turns.push(highest);
            }
            (way, lowest) = (-1.0, k);
        } else if way <= 0.0 && path[k] > path[lowest] + back {
            if way < 0.0 {
                turns.push(lowest);
            }
            (way, highest) = (1.0, k);
        }
    }
    turns.push(path.len());
    turns
}

/// Velocity of every sample of a leg, and the half window that it took: from a small share of the leg on, the window is doubled
/// until the slope is known well enough to see a change of a tenth, or it is a sixth of the leg.
fn velocities(times: &[f64], path: &[f64], from: usize, to: usize) -> (Vec<f64>, usize) {
    let mut half = ((to - from) / WINDOW.0).max(WINDOW.1);
    loop {
        let (slopes, uncertainty) = slopes(times, path, from, to, half);
        if uncertainty <= SLOPE_KNOWN || 6 * 2 * half > to - from {
            return (slopes, half);
        }
        half *= 2;
    }
}

/// Slope of the path about every sample of a leg, by least squares over the window, and the median of its
/// relative standard error. Sums from the leg's start make every window a difference of two.
fn slopes(times: &[f64], path: &[f64], from: usize, to: usize, half: usize) -> (Vec<f64>, f64) {
    let middle = from + (to - from) / 2;
    let mut sums = vec![[0.0; 5]];
    for k in from..to {
        let (t, p, last) = (times[k] - times[middle], path[k] - path[middle], sums[k - from]);
        sums.push([last[0] + t, last[1] + p, last[2] + t * t, last[3] + t * p, last[4] + p * p]);
    }
    let slope = |k: usize| {
        let (a, b) = (k.saturating_sub(half), (k + half + 1).min(to - from));
        let n = (b - a) as f64;
        let [t, p, tt, tp, pp] = std::array::from_fn(|j| sums[b][j] - sums[a][j]);
        let (top, bottom) = (tp - t * p / n, tt - t * t / n);
        if bottom <= 0.0 || n < 3.0 {
            return (0.0, f64::INFINITY);
        }
        let slope = top / bottom;
        let scatter = ((pp - p * p / n - slope * top) / (n - 2.0)).max(0.0);
        (slope, (scatter / bottom).sqrt() / slope.abs())
    };
    let (slopes, mut errors): (Vec<f64>, Vec<f64>) = (0..to - from).map(slope).unzip();
    errors.sort_by(f64::total_cmp);
    let median = errors.get(errors.len() / 2).copied().unwrap_or(0.0);
    (slopes, median)
}

/// Stretches of a leg in which velocity, load and vibration are steady.
fn steady(samples: &[Values], slopes: &[f64], h: usize, from: usize, still: f64) -> Vec<(usize, usize)> {
    let to = from + slopes.len();
    let smooth = |id: Id| -> Vec<f64> {
        // Sums from the leg's start: a mean over any window is a difference of two.
        let mut sums = vec![0.0];
        for s in &samples[from..to] {
            sums.push(sums[sums.len() - 1] + s.get(id).unwrap_or(0.0));
        }
        let n = to - from;
        (0..n)
            .map(|k| {
                let (a, b) = (k.saturating_sub(h), (k + h + 1).min(n));
                (sums[b] - sums[a]) / (b - a) as f64
            })
            .collect()
    };
    let known = |id: &Id| samples[from..to].iter().any(|s| s.get(*id).is_some());
    let mut tracks: Vec<Vec<f64>> = vec![slopes.to_vec(), smooth(Id::NormalForce)];
    tracks.extend(
        [Id::AmplitudePp, Id::AmplitudePeak, Id::AmplitudeRms, Id::Frequency]
            .into_iter()
            .filter(known)
            .map(smooth),
    );
    let n = to - from;
    let is_steady = |k: usize| {
        let (a, b) = (k.saturating_sub(h), (k + h).min(n - 1));
        let same = |v: &Vec<f64>| (v[b] - v[a]).abs() <= STEADY * v[k].abs();
        slopes[k].abs() > still && tracks.iter().all(same) && samples[from + a].run == samples[from + b].run
    };
    let (mut ranges, mut begin) = (Vec::new(), None);
    for k in 0..=n {
        match (begin, k < n && is_steady(k)) {
            (None, true) => begin = Some(k),
            (Some(b), false) => {
                ranges.push((from + b, from + k));
                begin = None;
            }
            _ => {}
        }
    }
    ranges
}

/// One pass of a stretch: means, and the speed as the slope of the path.
fn mean(samples: &[Values], path: &[f64], times: &[f64]) -> (Values, Spread) {
    let n = samples.len() as f64;
    let (t0, p0) = (times.iter().sum::<f64>() / n, path.iter().sum::<f64>() / n);
    let (mut top, mut bottom) = (0.0, 0.0);
    for (t, p) in times.iter().zip(path) {
        top += (t - t0) * (p - p0);
        bottom += (t - t0).powi(2);
    }
    let velocity = top / bottom;
    // A path that is the integral of a speed without a direction rises always.
    let direction = average(samples, |s| s.get(Id::Direction)).map_or(velocity.signum(), f64::signum);
    let lateral = |s: &Values| s.lateral(direction);
    let sd = |f: &dyn Fn(&Values) -> Option<f64>| {
        let mean = average(samples, f).unwrap_or(0.0);
        let squares: f64 = samples.iter().filter_map(f).map(|v| (v - mean).powi(2)).sum();
        (squares / (n - 1.0)).sqrt()
    };
    let spread = Spread {
        normal_sd_n: sd(&|s| s.get(Id::NormalForce)),
        lateral_sd_n: sd(&lateral),
        samples: samples.len() as u64,
    };
    let mut pass = samples[0].clone();
    pass.average(samples);
    pass.put_motion(velocity.abs(), direction, average(samples, lateral));
    (pass, spread)
}

#[cfg(test)]
mod tests;
