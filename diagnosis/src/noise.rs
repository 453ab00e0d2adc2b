//! The variance of each pass: stated repeatability, checked against replicates, never fitted to a residual.

use crate::data::{RigFile, Table};
use crate::fit::{Problem, minimise};
use crate::wildcard::{Wildcard, lengths};
use models::condition::Condition;
use models::covariate;
use models::quantity::PeakToPeak;
use serde::Serialize;

/// What the replicates say about the stated repeatability.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PureError {
    /// Degrees of freedom of the replicates.
    pub degrees_of_freedom: usize,
    /// Their variance over the stated one; `None` without replicates.
    pub variance_ratio: Option<f64>,
    /// Factor on the stated variance that was used.
    pub used: f64,
}

/// Degrees of freedom that the statement in rig.toml counts for.
const STATED_WEIGHT: f64 = 40.0;
/// A pass further than this from the smooth surface (in deviations) is an outlier, if it is one of few.
const OUTLIER: f64 = 3.5;
/// Above this share of such passes they are a gap, not outliers.
const OUTLIER_SHARE: f64 = 0.02;

/// Fills in the problem's variances and gives the smooth surface on which they rest.
pub fn settle(table: &Table, rig: &RigFile, problem: &mut Problem) -> (Wildcard, PureError) {
    let start = minimise(problem, &[], &[0.0; 3], &rough(problem, rig), 12);
    problem.variance = variance(problem, rig, &start.u, start.prediction.as_slice(), 1.0);
    // The level of friction enters the variance: it is taken from a smooth surface, not from the baseline.
    let smoothnesses = lengths(table);
    let first = Wildcard::fit(table, problem, &start.u, &smoothnesses[..1]);
    let level: Vec<f64> = first.smooth.iter().copied().collect();
    problem.variance = variance(problem, rig, &start.u, &level, 1.0);
    let pure = replicates(table, problem, &level);
    for v in &mut problem.variance {
        *v *= pure.used;
    }
    let second = Wildcard::fit(table, problem, &start.u, smoothnesses);
    let far: Vec<f64> = (0..problem.len())
        .map(|i| (problem.lateral[i] - second.smooth[i]).abs() / problem.variance[i].sqrt())
        .collect();
    let count = far.iter().filter(|d| **d > OUTLIER).count();
    if count > 0 && (count as f64) <= OUTLIER_SHARE * problem.len() as f64 + 1.0 {
        for (v, d) in problem.variance.iter_mut().zip(&far) {
            if *d > OUTLIER {
                *v *= (d / 2.0).powi(2);
            }
        }
    }
    (second, pure)
}

fn rough(problem: &Problem, rig: &RigFile) -> Vec<f64> {
    problem
        .lateral
        .iter()
        .zip(&problem.passes)
        .map(|(l, p)| {
            let level = l.abs() + 0.05 * problem.nominal.mu0 * p.normal_force_n;
            (0.1 * level).powi(2) + rig.noise.force_sd_n.powi(2)
        })
        .collect()
}

/// Variances given the level of friction: relative scatter, noise of the lateral axis, and that of the normal
/// axis through the slope of the prediction (effective variance).
pub fn variance(problem: &Problem, rig: &RigFile, center: &[f64], level: &[f64], factor: f64) -> Vec<f64> {
    let heavier: Vec<_> =
        problem.passes.iter().map(|p| Condition { normal_force_n: p.normal_force_n * 1.01, ..*p }).collect();
    let base = problem.predict(&[], center);
    let more = problem.predict_at(&[], center, &heavier);
    let force = rig.noise.force_sd_n;
    (0..problem.len())
        .map(|i| {
            let slope = (more[i] - base[i]) / (0.01 * problem.passes[i].normal_force_n);
            let relative = rig.noise.pass_relative_sd * level[i];
            factor * (relative * relative + force * force * (1.0 + slope * slope)).max(1e-12)
        })
        .collect()
}

/// Repeats of one condition, compared among themselves after a common drift in time is taken out.
fn replicates(table: &Table, problem: &Problem, smooth: &[f64]) -> PureError {
    let mut groups: std::collections::BTreeMap<[Option<i64>; 6], Vec<usize>> =
        std::collections::BTreeMap::new();
    for (i, p) in table.passes.iter().enumerate() {
        let key = covariate::SETTINGS.map(|c| Some(c.level?(c.of(p)?)));
        groups.entry(key).or_default().push(i);
    }
    let (mut sum, mut freedom) = (0.0, 0usize);
    for rows in groups.values().filter(|r| r.len() > 1) {
        for pair in rows.windows(2) {
            let (i, j) = (pair[0], pair[1]);
            let apart = (table.passes[i].time_s - table.passes[j].time_s).abs();
            let places = (table.passes[i].position_m - table.passes[j].position_m).abs();
            // Only neighbours in time and place: what lies between others may be drift, not scatter.
            let still = table.passes[i].amplitude == PeakToPeak::ZERO;
            if apart > 0.1 * table.design.duration_s
                || (!still && places > 0.01 * table.design.stroke_m.max(1e-9))
            {
                continue;
            }
            // What regulation leaves of the load's scatter is taken out along the smooth surface.
            let difference = (table.lateral[i] - smooth[i]) - (table.lateral[j] - smooth[j]);
            sum += difference * difference / (problem.variance[i] + problem.variance[j]);
            freedom += 1;
        }
    }
    let used = (STATED_WEIGHT + sum) / (STATED_WEIGHT + freedom as f64);
    // Scatter below the statement is believed only as far as the replicates carry it.
    PureError {
        degrees_of_freedom: freedom,
        variance_ratio: (freedom > 0).then(|| sum / freedom as f64),
        used: used.clamp(0.8, 3.0),
    }
}
