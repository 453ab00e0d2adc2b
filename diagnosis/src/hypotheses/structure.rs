//! Whether what the recalibrated baseline leaves is scatter: runs, steps, spots and periods along the order
//! of measurement and along each covariate, compared with shuffled passes. docs/diagnosis/model.md, section
//! 6.
//!
//! A window that slides over the passes in the order of each covariate finds steps and spots (a scan
//! statistic), a periodogram over time and place what repeats. The level is that of the family; its tail is
//! that of the largest of many (Gumbel).

mod axis;
mod factor;
pub mod fitted_shape;
mod form;
mod locations;
mod scatter_model;
pub mod shapes;

use crate::regression::{Posterior, Problem};
use crate::scatter::{moments, shuffled, strongest};
use models::covariate::{COVARIATES, CovariateRole};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::{E, PI};

/// Shortest window, and the ratio of each to the next.
const SHORTEST: usize = 4;
const LONGER: f64 = 1.5;
/// Periods that are looked for at most.
const PERIODS: usize = 120;
/// Deviations beyond which a pass does not count for more: one bad pass is no structure.
const BOUNDED_SD: f64 = 3.0;
/// Passes up to which each is conditioned on all before it.
const MOST_ORDERED: usize = 1000;
/// Euler's constant.
const EULER: f64 = 0.577_215_664_901_532_9;

/// The strongest structure in what a model leaves.
#[derive(Debug, Clone, PartialEq)]
pub struct Structure {
    /// In words: a stretch of a covariate, or a period in it.
    pub place: String,
    /// Family-wise p-value.
    pub p: f64,
}

impl Structure {
    /// Nats for a departure of that kind against scatter, at most: the largest Bayes factor that a p-value
    /// allows (Sellke, Bayarri and Berger 2001).
    pub fn nats(&self) -> f64 {
        if self.p < 1.0 / E { -(-E * self.p * self.p.ln()).ln() } else { 0.0 }
    }
}

/// One way to look at passes in a row.
struct Look {
    words: String,
    /// Rows of the table in the order of a covariate.
    order: Vec<usize>,
    /// Where each pass of that order lies, over the range; for periods, `None` for windows.
    places: Option<Vec<f64>>,
}

/// Largest sum over a window of passes, over its deviation.
fn strongest_window(values: impl Iterator<Item = f64>, sums: &mut Vec<f64>) -> f64 {
    sums.clear();
    sums.push(0.0);
    sums.extend(values.scan(0.0, |total, v| {
        *total += v;
        Some(*total)
    }));
    let n = sums.len() - 1;
    let (all, mut most, mut length) = (sums[n] / n as f64, 0.0f64, SHORTEST);
    while 2 * length <= n {
        let deviation = (length as f64 * (1.0 - length as f64 / n as f64)).sqrt();
        let largest = sums.windows(length + 1).map(|w| (w[length] - w[0] - all * length as f64).abs());
        most = most.max(largest.fold(0.0, f64::max) / deviation);
        length = (length as f64 * LONGER).ceil() as usize;
    }
    most
}

/// Largest power at a whole number of periods over the range.
fn strongest_period(values: impl Iterator<Item = f64> + Clone, places: &[f64]) -> f64 {
    let count = (places.len() / 3).min(PERIODS);
    let turns: Vec<(f64, f64)> = places.iter().map(|x| (2.0 * PI * x).sin_cos()).collect();
    let mut at: Vec<(f64, f64)> = turns.clone();
    let mut most = 0.0f64;
    for _ in 0..count {
        let (s, c) = values.clone().zip(&at).fold((0.0, 0.0), |(s, c), (v, t)| (s + v * t.0, c + v * t.1));
        most = most.max(s * s + c * c);
        for (a, t) in at.iter_mut().zip(&turns) {
            *a = (a.0 * t.1 + a.1 * t.0, a.1 * t.1 - a.0 * t.0);
        }
    }
    most.sqrt()
}

/// Time and every covariate that varies, by windows; time and place by periods too.
fn looks(problem: &Problem) -> Vec<Look> {
    let n = problem.len();
    let mut list = Vec::new();
    for c in COVARIATES {
        let Some(values) = c.of_all(&problem.passes) else { continue };
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
        let (first, last) = (values[order[0]], values[order[n - 1]]);
        if last <= first {
            continue;
        }
        if matches!(c.role, CovariateRole::Time | CovariateRole::Place) {
            let places = order.iter().map(|&i| (values[i] - first) / (last - first)).collect();
            let words = format!("a period in {}", c.words);
            list.push(Look { words, order: order.clone(), places: Some(places) });
        }
        list.push(Look { words: format!("a stretch of {}", c.words), order, places: None });
    }
    list
}

/// The strongest structure in what a model leaves, after what passes have in common; none of a table too
/// short to shuffle.
pub fn structure(problem: &Problem, model: &Posterior) -> Option<Structure> {
    let n = problem.len();
    let looks = looks(problem);
    if n < 4 * SHORTEST || looks.is_empty() {
        return None;
    }
    let bounded: Vec<f64> =
        innovations(problem, model).iter().map(|d| d.clamp(-BOUNDED_SD, BOUNDED_SD)).collect();
    // As the sensor reads it, and as friction has it: against the motion.
    let along = bounded.iter().zip(&problem.passes).map(|(d, p)| d * p.direction.sign()).collect();
    let signals: [Vec<f64>; 2] = [bounded, along];
    let (mut sums, mut moved) = (Vec::new(), vec![0.0; n]);
    let scores = shuffled(n, |order, signs| {
        let mut row = Vec::with_capacity(looks.len() * signals.len());
        for look in &looks {
            for values in &signals {
                moved.iter_mut().zip(order).for_each(|(m, &i)| *m = values[i] * signs[i]);
                let values = look.order.iter().map(|&i| moved[i]);
                row.push(match &look.places {
                    None => strongest_window(values, &mut sums),
                    Some(places) => strongest_period(values, places),
                });
            }
        }
        row
    });
    let (largest, which) = strongest(&scores);
    let (mean, sd) = moments(&largest[1..]);
    // Of the largest of many the distribution is Gumbel's: its tail reaches farther than the shuffles do.
    let scale = sd.max(f64::MIN_POSITIVE) * 6f64.sqrt() / PI;
    let reduced = (largest[0] - mean) / scale + EULER;
    let tail = -(-(-reduced).exp()).exp_m1();
    let words = looks[which / signals.len()].words.clone();
    Some(Structure { place: words, p: tail.clamp(f64::MIN_POSITIVE, 1.0) })
}

/// What each pass brings beside those before it, in its deviations: passes that have scatter in common are no
/// structure, but a step that outlasts what they have in common is. Of long tables what is in common is taken
/// out as a whole instead.
fn innovations(problem: &Problem, model: &Posterior) -> Vec<f64> {
    let n = problem.len();
    let residual = DVector::from_column_slice(&problem.lateral) - &model.prediction;
    let own = |beside: &DVector<f64>| (0..n).map(|i| beside[i] / problem.variance[i].sqrt()).collect();
    if problem.common.ncols() == 0 {
        return own(&residual);
    }
    if n <= MOST_ORDERED {
        let mut whole = &problem.common * problem.common.transpose();
        (0..n).for_each(|i| whole[(i, i)] += problem.variance[i]);
        // Rows stand in the order of measurement: each is conditioned on those before.
        if let Some(white) = whole.cholesky().and_then(|c| c.l().solve_lower_triangular(&residual)) {
            return white.as_slice().to_vec();
        }
    }
    let shared = problem.covariance(&DMatrix::zeros(n, 0)).weights(&residual);
    own(&(residual - &problem.common * shared))
}
