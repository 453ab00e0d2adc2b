//! Stretch that the tissue holds from one contact to the next.
//!
//! The slider's own stretch vanishes at lift-off, as in the baseline; what the tissue below it holds relaxes
//! in flight and is added to the stretch of every instant of the next contact, up to the friction limit.

use super::sweep::POINTS;
use std::f64::consts::PI;

/// Share of the largest stretch within which a cycle ends as it began.
const SETTLED: f64 = 1e-7;

/// What is held, and for how long.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Held {
    /// Share of a contact's stretch that is held at lift-off. 0 in the baseline.
    pub share: f64,
    /// Relaxation time in flight, s.
    pub time: f64,
    /// Spread `p` of the relaxation times: `(1 + p t/time)^(-1/p)` is left after `t`; 0 leaves an
    /// exponential.
    pub spread: f64,
    /// Weight `b` of the mean stretch of the cycle against the largest one: `largest^(1-b) mean^b`.
    pub of_mean: f64,
    /// Stretch `y` of which half would be held, m: of a stretch x the share is `x/(x + y)`.
    pub elastic: f64,
}

impl Held {
    /// Nothing is held.
    pub const NOTHING: Held = Held { share: 0.0, time: 1.0, spread: 0.0, of_mean: 0.0, elastic: 0.0 };

    /// What is left of a stretch after a time in flight (s).
    fn left(&self, flight: f64) -> f64 {
        let times = flight / self.time;
        if self.spread < 1e-6 { (-times).exp() } else { (1.0 + self.spread * times).powf(-1.0 / self.spread) }
    }

    /// Mean over the cycle of the stretch that pulls on the plate, m: for the limits over a contact, as
    /// stretches, the plate's way in a step, and the angles (rad) in contact and in flight of a vibration of
    /// angular frequency `omega`.
    pub(super) fn mean_stretch(&self, limits: &[f64], way: f64, [arc, flight]: [f64; 2], omega: f64) -> f64 {
        let mut own = [0.0; POINTS + 1];
        let mut x = 0.0f64;
        for (own, &limit) in own.iter_mut().zip(limits) {
            *own = x.min(limit);
            x = *own + way;
        }
        let share = self.share * self.left(flight / omega);
        let top = limits.iter().fold(0.0f64, |a, &b| a.max(b));
        let mut mean = 0.0;
        let change = |held: f64| {
            let (mut sum, mut largest, mut last) = (0.0, 0.0f64, 0.0);
            for (own, &limit) in own.iter().zip(limits) {
                last = (own + held).min(limit);
                sum += last;
                largest = largest.max(last);
            }
            let first = held.min(limits[0]);
            mean = (sum - 0.5 * (first + last)) / (limits.len() - 1) as f64 * arc / (2.0 * PI);
            let stretch = largest.powf(1.0 - self.of_mean) * mean.powf(self.of_mean);
            share * stretch * stretch / (stretch + self.elastic).max(f64::MIN_POSITIVE) - held
        };
        models::root::secant(change, [0.0, share * top], share * top, SETTLED * top);
        mean
    }
}
