//! The variance of each pass: stated repeatability, checked against replicates, never fitted to a residual.

use crate::data::{RigFile, Table};
use crate::discrepancy::{Discrepancy, lengths};
use crate::fit::Problem;
use crate::least_squares::minimise;
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

/// Relative step in the normal force for the slope of a prediction.
const LOAD_STEP: f64 = 0.01;
/// Least variance of a pass, N^2.
const LEAST_VARIANCE: f64 = 1e-12;
/// Replicates lie this close together: share of the duration, and of the stroke.
const NEAR_IN_TIME: f64 = 0.1;
const NEAR_IN_PLACE: f64 = 0.01;
/// Before the level of friction is known: relative deviation of a pass, and the share of full friction added to its level.
const ROUGH_SD: f64 = 0.1;
const ROUGH_LEVEL: f64 = 0.05;

/// Fills in the problem's variances and gives the smooth surface on which they rest.
pub fn settle(table: &Table, rig: &RigFile, problem: &mut Problem) -> (Discrepancy, PureError) {
    let start = minimise(problem, &[], &[0.0; 3], &rough(problem, rig), 12);
    problem.variance = variance(problem, rig, &start.u, start.prediction.as_slice(), 1.0);
    // The level of friction enters the variance: it is taken from a smooth surface, not from the baseline.
    let k = problem.constants.clone();
    let lengths = lengths(&k, table);
    let first = Discrepancy::fit(table, problem, &start.u, &lengths[..1]);
    let level: Vec<f64> = first.smooth.iter().copied().collect();
    problem.variance = variance(problem, rig, &start.u, &level, 1.0);
    let pure = replicates(table, problem, &level);
    for v in &mut problem.variance {
        *v *= pure.used;
    }
    let second = Discrepancy::fit(table, problem, &start.u, &lengths);
    let far: Vec<f64> = (0..problem.len())
        .map(|i| (problem.lateral[i] - second.smooth[i]).abs() / problem.variance[i].sqrt())
        .collect();
    let count = far.iter().filter(|d| **d > k.outlier_sd).count();
    if count > 0 && (count as f64) <= k.outlier_share * problem.len() as f64 + 1.0 {
        for (v, d) in problem.variance.iter_mut().zip(&far) {
            if *d > k.outlier_sd {
                *v *= (d / k.outlier_reach).powi(2);
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
            let level = l.abs() + ROUGH_LEVEL * problem.nominal.mu0 * p.normal_force_n;
            (ROUGH_SD * level).powi(2) + rig.noise.force_sd_n.powi(2)
        })
        .collect()
}

/// Variances given the level of friction: relative scatter, noise of the lateral axis, and that of the normal
/// axis through the slope of the prediction (effective variance).
pub fn variance(problem: &Problem, rig: &RigFile, center: &[f64], level: &[f64], factor: f64) -> Vec<f64> {
    let heavier: Vec<_> = problem
        .passes
        .iter()
        .map(|p| Condition { normal_force_n: p.normal_force_n * (1.0 + LOAD_STEP), ..*p })
        .collect();
    let base = problem.predict(&[], center);
    let more = problem.predict_at(&[], center, &heavier);
    let force = rig.noise.force_sd_n;
    (0..problem.len())
        .map(|i| {
            let slope = (more[i] - base[i]) / (LOAD_STEP * problem.passes[i].normal_force_n);
            let relative = rig.noise.pass_relative_sd * level[i];
            factor * (relative * relative + force * force * (1.0 + slope * slope)).max(LEAST_VARIANCE)
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
            if apart > NEAR_IN_TIME * table.design.duration_s
                || (!still && places > NEAR_IN_PLACE * table.design.stroke_m.max(1e-9))
            {
                continue;
            }
            // What regulation leaves of the load's scatter is taken out along the smooth surface.
            let difference = (table.lateral[i] - smooth[i]) - (table.lateral[j] - smooth[j]);
            sum += difference * difference / (problem.variance[i] + problem.variance[j]);
            freedom += 1;
        }
    }
    let k = &problem.constants;
    let used = (k.stated_freedom + sum) / (k.stated_freedom + freedom as f64);
    // Scatter below the statement is believed only as far as the replicates carry it.
    PureError {
        degrees_of_freedom: freedom,
        variance_ratio: (freedom > 0).then(|| sum / freedom as f64),
        used: used.clamp(k.variance_factor_bounds[0], k.variance_factor_bounds[1]),
    }
}
