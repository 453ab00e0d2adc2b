//! What the force channel shows of an edge: the contact's own response, the stated filter, and a lag or a
//! delay.

use super::{Against, Edge};
use models::{Condition, FrictionModel, PeakToPeak};
use serde::Serialize;

/// Step of the simulated edge, s: an eighth of the fastest ring-up that a plate has.
const STEP_S: f64 = 2.5e-4;
/// Time simulated before the command, s.
const BEFORE_S: f64 = 0.06;
/// Time before the command over which the level is read, and length of the same at the end, s.
const LEVEL_S: f64 = 0.04;
/// Change of force below which an edge says nothing, in standard deviations of a sample.
const VISIBLE: f64 = 3.0;
/// Change of mu' below which an edge says nothing.
const LEAST_CHANGE: f64 = 1e-3;

/// How the channel may be late.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ResponseForm {
    /// All of the signal by one time: a wrong stamp, a slow link.
    Delay,
    /// A first-order lag behind the stated filter.
    FirstOrder,
    /// A filter of second order (Butterworth) in the place of the stated one.
    SecondOrder,
}

impl ResponseForm {
    /// All of them.
    pub const ALL: [ResponseForm; 3] =
        [ResponseForm::Delay, ResponseForm::FirstOrder, ResponseForm::SecondOrder];

    /// Least and greatest mean delay that is tried, s, beside a stated filter of that mean delay.
    pub fn range(self, stated_s: f64) -> [f64; 2] {
        match self {
            ResponseForm::Delay => [-0.1, 0.2],
            ResponseForm::FirstOrder => [0.0, 0.2],
            ResponseForm::SecondOrder => [-0.9 * stated_s, 0.2],
        }
    }
}

/// Mean delay of a second-order Butterworth filter, s, from its -3 dB bandwidth, Hz: the first moment of
/// its impulse response.
pub fn mean_delay_s(bandwidth_hz: f64) -> f64 {
    std::f64::consts::SQRT_2 / (2.0 * std::f64::consts::PI * bandwidth_hz)
}

/// An edge, ready to be compared.
pub struct Prepared {
    /// Times from the command, s, and forces, N, along the motion before the edge.
    pub lateral: Vec<(f64, f64)>,
    /// Friction before and behind, N.
    pub levels: [f64; 2],
    /// Friction that the contact carries at most at each step, either way, N.
    limit: Vec<f64>,
    /// Force about which it does so, N: what is no friction.
    middle: f64,
    /// Velocity along the motion before the edge at each step, m/s.
    velocity: Vec<f64>,
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (n, sum) = values.fold((0, 0.0), |(n, sum), v| (n + 1, sum + v));
    (n > 0).then(|| sum / f64::from(n))
}

/// The value of a series at a time, straight between its entries, level beyond its ends.
fn at(series: &[(f64, f64)], t: f64) -> f64 {
    let i = series.partition_point(|s| s.0 <= t);
    match (i.checked_sub(1).map(|i| series[i]), series.get(i)) {
        (Some(a), Some(b)) => a.1 + (b.1 - a.1) * (t - a.0) / (b.0 - a.0),
        (Some(a), None) => a.1,
        (None, b) => b.map_or(0.0, |b| b.1),
    }
}

impl Prepared {
    /// Prepares an edge; `None` where the law or the measurement shows no change.
    pub fn of(edge: &Edge, law: &dyn FrictionModel) -> Option<Self> {
        let last = edge.lateral.last()?.0;
        let level = |from: f64, to: f64| {
            let inside: Vec<f64> =
                edge.lateral.iter().filter(|s| s.0 >= from && s.0 < to).map(|s| s.1).collect();
            let mean = mean(inside.iter().copied())?;
            let square = inside.iter().map(|f| (f - mean).powi(2)).sum::<f64>();
            Some((mean, square / (inside.len().max(2) - 1) as f64))
        };
        let ((before, var_before), (behind, var_behind)) =
            (level(-LEVEL_S, 0.0)?, level(last - LEVEL_S, last)?);
        let visible = (behind - before).abs() > VISIBLE * var_before.max(var_behind).sqrt();
        let steps = ((BEFORE_S + last) / STEP_S) as usize;
        let time = |j: usize| j as f64 * STEP_S - BEFORE_S;
        let velocity: Vec<f64> = (0..steps).map(|j| at(&edge.velocity, time(j))).collect();
        let (limit, middle) = match edge.against {
            // A turn: the same friction the other way.
            Against::Position => (vec![0.5 * (before - behind).abs(); steps], 0.5 * (before + behind)),
            Against::Amplitude => {
                let shares = shares(edge, law, (0..steps).map(time))?;
                (shares.iter().map(|share| (before + share * (behind - before)).abs()).collect(), 0.0)
            }
        };
        let (lateral, levels) = (edge.lateral.clone(), [before, behind]);
        visible.then_some(Prepared { lateral, levels, limit, middle, velocity })
    }

    /// Time in which the stage stretches the contact from rest until it slides, s.
    pub fn stretching_s(&self, stiffness: f64) -> f64 {
        self.levels[0].abs() / (stiffness * self.velocity.first().map_or(f64::INFINITY, |v| v.abs()))
    }

    /// What the channel shows at each sample if the contact rests on a spring of this stiffness (N/m) that
    /// is stretched until it slides, behind a filter of the stated mean delay and `form` with a mean delay
    /// `late_s`.
    pub fn shown(&self, stiffness: f64, stated_s: f64, form: ResponseForm, late_s: f64) -> Vec<f64> {
        let mut force = self.levels[0] - self.middle;
        let step = |(limit, velocity): (&f64, &f64)| {
            force = (force + stiffness * velocity * STEP_S).clamp(-limit, *limit);
            force + self.middle
        };
        let truth: Vec<f64> = self.limit.iter().zip(&self.velocity).map(step).collect();
        let filtered = match form {
            ResponseForm::Delay => second_order(&truth, stated_s),
            ResponseForm::FirstOrder => first_order(&second_order(&truth, stated_s), late_s),
            ResponseForm::SecondOrder => second_order(&truth, stated_s + late_s),
        };
        let shift = if form == ResponseForm::Delay { late_s } else { 0.0 };
        let last = filtered.len() - 1;
        let value = |t: f64| {
            let x = ((t - shift + BEFORE_S) / STEP_S).clamp(0.0, last as f64);
            let i = x as usize;
            filtered[i] + (filtered[(i + 1).min(last)] - filtered[i]) * (x - i as f64)
        };
        self.lateral.iter().map(|(t, _)| value(*t)).collect()
    }
}

/// How far friction is on its way from the one level to the other at each time, by the law at the amplitude
/// as read back.
fn shares(edge: &Edge, law: &dyn FrictionModel, times: impl Iterator<Item = f64>) -> Option<Vec<f64>> {
    let friction = |t: f64| {
        let amplitude = PeakToPeak::from_metres(at(&edge.amplitude, t).max(0.0));
        let condition = Condition { amplitude, ..edge.condition };
        law.relative_friction(&condition).ok().map(|f| f.mu_relative)
    };
    let all = times.map(friction).collect::<Option<Vec<f64>>>()?;
    let (first, last) = ((BEFORE_S / STEP_S) as usize, (LEVEL_S / STEP_S) as usize);
    let before = mean(all[..first].iter().copied())?;
    let change = mean(all[all.len() - last..].iter().copied())? - before;
    (change.abs() > LEAST_CHANGE).then(|| all.iter().map(|m| (m - before) / change).collect())
}

/// A first-order lag by the bilinear rule, whose mean delay is exact at any step.
fn first_order(x: &[f64], late_s: f64) -> Vec<f64> {
    let (mut y, mut before) = (x[0], x[0]);
    let (a, b) = (2.0 * late_s - STEP_S, 2.0 * late_s + STEP_S);
    x.iter()
        .map(|x| {
            y = (a * y + STEP_S * (x + before)) / b;
            before = *x;
            y
        })
        .collect()
}

/// A second-order Butterworth filter of this mean delay, likewise; none at zero.
fn second_order(x: &[f64], late_s: f64) -> Vec<f64> {
    if late_s <= 0.0 {
        return x.to_vec();
    }
    let root = std::f64::consts::SQRT_2;
    let k = 0.5 * root * STEP_S / late_s;
    let norm = 1.0 / (1.0 + root * k + k * k);
    let (b, a) = (k * k * norm, [2.0 * (k * k - 1.0) * norm, (1.0 - root * k + k * k) * norm]);
    let mut z = [x[0] * (1.0 - b), x[0] * (b - a[1])];
    x.iter()
        .map(|x| {
            let y = b * x + z[0];
            z = [2.0 * b * x - a[0] * y + z[1], b * x - a[1] * y];
            y
        })
        .collect()
}
