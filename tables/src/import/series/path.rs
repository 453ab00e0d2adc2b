//! The path of a record, where it turns, and how fast it is.

use crate::import::targets::Id;
use crate::import::values::{Values, middle, sorted};

/// Share of the path's range that a turn must go back to be one.
const TURN: f64 = 0.05;
/// Relative standard error of a velocity that is good enough: a change of a tenth is several of them.
const SLOPE_KNOWN: f64 = 0.015;
/// Fewest samples of half a window.
const FEWEST: usize = 3;
/// Share of a leg's largest speed that is moving; what moves rests again below a fifth of it.
const MOVING: f64 = 0.1;

/// The sums of the first values, from none to all of them.
pub fn sums(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let further = values.scan(0.0, |sum, value| {
        *sum += value;
        Some(*sum)
    });
    std::iter::once(0.0).chain(further).collect()
}

/// The path in m: the position, else the integral of the velocity.
pub fn path(samples: &[Values], times: &[f64]) -> Result<Vec<f64>, String> {
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
        let needed = "a position, a velocity with a sign, or a speed and a direction";
        return Err(format!("a series needs {needed} in every row"));
    }
    let step = |k: usize| 0.5 * (velocities[k] + velocities[k - 1]) * (times[k] - times[k - 1]);
    Ok(sums((1..times.len()).map(step)))
}

/// Places where the path turns by more than a share of its range, with both ends.
pub fn turning_points(path: &[f64]) -> Vec<usize> {
    let low = path.iter().copied().fold(f64::INFINITY, f64::min);
    let high = path.iter().copied().fold(f64::NEG_INFINITY, f64::max);
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

/// The pieces of a leg in which the stage moves, and those in which it rests.
pub fn at_rests(times: &[f64], path: &[f64], from: usize, to: usize) -> Vec<(usize, usize)> {
    let (slopes, _) = velocities(times, path, from, to, FEWEST);
    let fastest = slopes.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let mut moves = false;
    let moving = slopes.iter().map(|v| {
        moves = v.abs() > if moves { 0.2 * MOVING } else { MOVING } * fastest;
        moves
    });
    pieces(moving, from).into_iter().map(|(_, piece)| piece).collect()
}

/// Samples from number `from` on in a row of one state: that state, and the range.
pub fn pieces(states: impl Iterator<Item = bool>, from: usize) -> Vec<(bool, (usize, usize))> {
    let (states, mut end): (Vec<bool>, _) = (states.collect(), from);
    let piece = |run: &[bool]| {
        end += run.len();
        (run[0], (end - run.len(), end))
    };
    states.chunk_by(|a, b| a == b).map(piece).collect()
}

/// Velocity of every sample of a leg, and the half window that it took: from `least` on, the window is
/// doubled until the slope of moving is known well enough to see a change of a tenth, or it is a sixth of the
/// leg.
pub fn velocities(times: &[f64], path: &[f64], from: usize, to: usize, least: usize) -> (Vec<f64>, usize) {
    let mut half = least.max(FEWEST);
    loop {
        let (slopes, uncertainty) = slopes(times, path, from, to, half);
        if uncertainty <= SLOPE_KNOWN || 6 * 2 * half > to - from {
            return (slopes, half);
        }
        half *= 2;
    }
}

/// Slope of the path about every sample of a leg, by least squares over the window, and the median of its
/// relative standard error where it is no rest. Sums from the leg's start make every window a difference of
/// two.
fn slopes(times: &[f64], path: &[f64], from: usize, to: usize, half: usize) -> (Vec<f64>, f64) {
    let centre = from + (to - from) / 2;
    let mut sums = vec![[0.0; 5]];
    for k in from..to {
        let (t, p, last) = (times[k] - times[centre], path[k] - path[centre], sums[k - from]);
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
    let (slopes, errors): (Vec<f64>, Vec<f64>) = (0..to - from).map(slope).unzip();
    let fastest = slopes.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let moving = slopes.iter().zip(errors).filter(|(v, _)| v.abs() > 0.2 * MOVING * fastest);
    let error = middle(&sorted(moving.map(|(_, error)| error))).unwrap_or(0.0);
    (slopes, error)
}
