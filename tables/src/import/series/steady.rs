//! Stretches of steady sliding, and the pass that each of them is.

use super::path::{pieces, sums};
use crate::import::targets::Id;
use crate::import::values::{Values, mean as average, middle, sorted};
use models::Pass;

/// Relative change over the window about a sample from which it is not steady.
const STEADY: f64 = 0.1;
/// Deviations of noise that two means of one load may lie apart: a leg has thousands of such pairs.
const BY_NOISE: f64 = 4.0;

/// Stretches of a leg in which velocity, load and vibration are steady.
pub fn steady(samples: &[Values], slopes: &[f64], h: usize, from: usize, still: f64) -> Vec<(usize, usize)> {
    let to = from + slopes.len();
    let n = slopes.len();
    // Means over the window, and how far two of them lie apart by the noise of the samples alone.
    let smooth = |id: Id| -> (Vec<f64>, f64) {
        let values: Vec<f64> = samples[from..to].iter().map(|s| s.get(id).unwrap_or(0.0)).collect();
        let steps = sorted(values.windows(2).map(|w| (w[1] - w[0]).abs()));
        // The median step of white noise is 0.954 of its deviation.
        let noise = middle(&steps).unwrap_or(0.0) / 0.954 * (2.0 / (2 * h + 1) as f64).sqrt();
        // A mean over any window is a difference of two sums from the leg's start.
        let sums = sums(values.into_iter());
        let window = |k: usize| (k.saturating_sub(h), (k + h + 1).min(n));
        ((0..n).map(window).map(|(a, b)| (sums[b] - sums[a]) / (b - a) as f64).collect(), BY_NOISE * noise)
    };
    let known = |id: &Id| samples[from..to].iter().any(|s| s.get(*id).is_some());
    let vibration = [Id::AmplitudePp, Id::AmplitudePeak, Id::AmplitudeRms, Id::Frequency];
    let mut tracks: Vec<(Vec<f64>, f64)> = vec![smooth(Id::NormalForce)];
    tracks.extend(vibration.into_iter().filter(known).map(smooth));
    let is_steady = |k: usize| {
        let (a, b) = (k.saturating_sub(h), (k + h).min(n - 1));
        let same = |(v, noise): &(Vec<f64>, f64)| (v[b] - v[a]).abs() <= STEADY * v[k].abs() + noise;
        // The slope is smooth over the window: five places see a rest between its ends.
        let places = sorted((0..5).map(|j| slopes[a + j * (b - a) / 4]));
        let moves = slopes[k].abs() > still && places[4] - places[0] <= STEADY * slopes[k].abs();
        moves && tracks.iter().all(same)
    };
    let pieces = pieces((0..n).map(is_steady), from).into_iter();
    pieces.filter_map(|(steady, piece)| steady.then_some(piece)).collect()
}

/// One pass of a stretch: means, and the speed as the slope of the path.
pub fn mean(samples: &[Values], path: &[f64], times: &[f64]) -> (Values, Spread) {
    let n = samples.len() as f64;
    let (t0, p0) = (times.iter().sum::<f64>() / n, path.iter().sum::<f64>() / n);
    let top: f64 = times.iter().zip(path).map(|(t, p)| (t - t0) * (p - p0)).sum();
    let velocity = top / times.iter().map(|t| (t - t0).powi(2)).sum::<f64>();
    // A path that is the integral of a speed without a direction rises always.
    let direction = average(samples, |s| s.get(Id::Direction)).map_or(velocity.signum(), f64::signum);
    let lateral = |s: &Values| s.lateral(direction);
    let sd = |f: &dyn Fn(&Values) -> Option<f64>| {
        let mean = average(samples, f).unwrap_or(0.0);
        let squares: f64 = samples.iter().filter_map(f).map(|v| (v - mean).powi(2)).sum();
        (squares / (n - 1.0)).sqrt()
    };
    let (normal_sd_n, lateral_sd_n) = (sd(&|s| s.get(Id::NormalForce)), sd(&lateral));
    let spread = Spread { normal_sd_n, lateral_sd_n, samples: samples.len() as u64 };
    let mut pass = samples[0].clone();
    pass.average(samples);
    pass.put_motion(velocity.abs(), direction, average(samples, lateral));
    (pass, spread)
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
