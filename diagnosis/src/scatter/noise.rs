//! The variance of each pass: never fitted to a cause. docs/diagnosis/model.md, section 3.

use crate::constants::Constants;
use crate::data::{RigFile, Table};
use crate::regression::{Discrepancy, Problem, lengths, minimise};
use crate::scatter::{self, Belief, Scatter};
use models::{Condition, PeakToPeak, covariate};
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::collections::BTreeMap;

/// What the replicates say about the stated repeatability.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
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
/// Chance of error at which replicates exclude a factor on the stated variance.
const EXCLUDED: f64 = 1e-3;
/// Least variance of a pass, N^2.
const LEAST_VARIANCE: f64 = 1e-12;
/// Replicates lie this close together: share of the duration, and of the stroke.
const NEAR_IN_TIME: f64 = 0.1;
const NEAR_IN_PLACE: f64 = 0.01;
/// Before the level of friction is known: relative deviation of a pass, and the share of full friction added to its level.
const ROUGH_SD: f64 = 0.1;
const ROUGH_LEVEL: f64 = 0.05;
/// Deviations, before the level is known, from which a pass counts by its distance; rounds of each of the first two fits.
const BOUNDED_SD: f64 = 3.0;
const START_ROUNDS: usize = 12;

/// Fills in the problem's scatter and gives the smooth surface beside it.
pub fn settle(
    table: &Table,
    rig: &RigFile,
    problem: &mut Problem,
    belief: &Belief,
) -> (Discrepancy, PureError, Scatter) {
    let rough = |(l, p): (&f64, &Condition)| {
        let level = l.abs() + ROUGH_LEVEL * problem.nominal.mu0 * p.normal_force_n;
        (ROUGH_SD * level).powi(2) + rig.noise.force_sd_n.powi(2)
    };
    let rough: Vec<f64> = problem.lateral.iter().zip(&problem.passes).map(rough).collect();
    let mut start = minimise(problem, &[], &[0.0; 3], &rough, START_ROUNDS);
    // A pass far off must not carry the start with it: beyond some deviations it counts by its distance.
    let bounded: Vec<f64> = (0..problem.len())
        .map(|i| {
            let far = (problem.lateral[i] - start.prediction[i]).abs() / rough[i].sqrt();
            rough[i] * (far / BOUNDED_SD).max(1.0).powi(2)
        })
        .collect();
    start = minimise(problem, &[], &start.u, &bounded, START_ROUNDS);
    let center = start.u;
    // The level of friction enters the variance: it is taken from a smooth surface, not from the baseline.
    let stated = |level: &[f64]| variance(problem, rig, &center, level, 1.0);
    let mut scatter = scatter::estimate(table, problem, &center, &stated, belief);
    let stated: Vec<_> = stated(&scatter.level).iter().zip(&scatter.inflation).map(|(v, i)| v * i).collect();
    let pure = replicates(table, problem, &stated, &scatter);
    problem.variance =
        stated.iter().enumerate().map(|(i, v)| v * pure.used + problem.law_variance(i)).collect();
    scatter.scale = pure.used.sqrt();
    scatter.enter(table, problem);
    let lengths = lengths(&problem.constants, table);
    (Discrepancy::fit(table, problem, &center, &lengths), pure, scatter)
}

/// Variances given the level of friction: relative scatter, noise of the lateral axis, and that of the normal
/// axis through the slope of the prediction (effective variance).
pub fn variance(problem: &Problem, rig: &RigFile, center: &[f64], level: &[f64], factor: f64) -> Vec<f64> {
    let heavier = |p: &Condition| Condition { normal_force_n: p.normal_force_n * (1.0 + LOAD_STEP), ..*p };
    let heavier: Vec<_> = problem.passes.iter().map(heavier).collect();
    let base = problem.predict(&[], center);
    let more = problem.predict_at(&[], center, &heavier);
    let force = rig.noise.force_sd_n;
    (0..problem.len())
        .map(|i| {
            let slope = (more[i] - base[i]) / (LOAD_STEP * problem.passes[i].normal_force_n);
            // Beyond the last load at which a base law can tell friction grows with the load.
            let slope = if slope.is_nan() { base[i] / problem.passes[i].normal_force_n } else { slope };
            let relative = rig.noise.pass_relative_sd * level[i];
            factor * (relative * relative + force * force * (1.0 + slope * slope)).max(LEAST_VARIANCE)
        })
        .collect()
}

/// Repeats of one condition, compared among themselves after a common drift in time is taken out; and, where
/// they leave it open, the scatter about the baseline if that is all there is.
fn replicates(table: &Table, problem: &Problem, variance: &[f64], scatter: &Scatter) -> PureError {
    let mut groups: BTreeMap<[Option<i64>; 6], Vec<usize>> = BTreeMap::new();
    for (i, p) in table.passes.iter().enumerate() {
        let own = table.in_its_loads(p);
        let key = covariate::SETTINGS.map(|c| Some(c.level?(c.of(&own)?)));
        groups.entry(key).or_default().push(i);
    }
    let (mut sum, mut largest, mut freedom) = (0.0, 0.0_f64, 0usize);
    // What lasts is half the same in neighbours, and the rest of it is no repeatability.
    let lasting = scatter.lasting(table, &problem.constants, variance);
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
            let difference = (table.lateral[i] - scatter.level[i]) - (table.lateral[j] - scatter.level[j]);
            let moved = (lasting.row(i) - lasting.row(j)).norm_squared();
            let square = difference * difference / (variance[i] + variance[j] + moved);
            (sum, largest, freedom) = (sum + square, largest.max(square), freedom + 1);
        }
    }
    let k = &problem.constants;
    // Where the replicates exclude the upper bound, without the two that differ most, they alone count.
    // Scatter below the statement is believed only as far as they carry it.
    let [low, high] = k.variance_factor_bounds;
    let least = quotient(sum - largest, freedom.saturating_sub(1), 1.0 - EXCLUDED);
    let repeated = match least {
        Some(least) if least > high => sum / freedom as f64,
        _ => ((k.stated_freedom + sum) / (k.stated_freedom + freedom as f64)).clamp(low, high),
    };
    let used =
        repeated * (scatter.bare_scale.powi(2) / repeated).max(1.0).powf(believed(k, scatter, sum, freedom));
    let variance_ratio = (freedom > 0).then(|| sum / freedom as f64);
    PureError { degrees_of_freedom: freedom, variance_ratio, used }
}

/// A sum of squares over a quantile of chi squared: the end of the interval of their variance.
fn quotient(sum: f64, freedom: usize, share: f64) -> Option<f64> {
    Some(sum / ChiSquared::new(freedom as f64).ok()?.inverse_cdf(share))
}

impl PureError {
    /// How many times as much as stated the replicates scatter, where they exclude the factor that was used.
    pub fn excludes_the_used(&self) -> Option<f64> {
        let sum = self.variance_ratio? * self.degrees_of_freedom as f64;
        let [low, high] =
            [1.0 - EXCLUDED, EXCLUDED].map(|share| quotient(sum, self.degrees_of_freedom, share));
        let within = low? <= self.used && self.used <= high?;
        (!within).then(|| (sum / self.degrees_of_freedom as f64).sqrt())
    }
}

/// How far a scatter about the recalibrated baseline is scatter, and no structure that no surface follows:
/// less where a surface does better, where it clusters, where replicates, which see no structure, scatter
/// less, and where it speaks too softly against the statement.
fn believed(k: &Constants, scatter: &Scatter, sum: f64, freedom: usize) -> f64 {
    let square = scatter.bare_scale.powi(2);
    let ratio = sum / (freedom as f64 * square).max(f64::MIN_POSITIVE);
    let pure = if freedom > 0 && ratio < 1.0 {
        0.5 * freedom as f64 * (ratio - 1.0 - ratio.max(1e-6).ln())
    } else {
        0.0
    };
    let clustered = scatter.clustered_p.powi(2) / (scatter.clustered_p.powi(2) + k.clustered_p.powi(2));
    // A weak cause that recalibration half takes up looks like a little more scatter: the statement stands
    // until the table speaks against it.
    let against = 0.5 * scatter.level.len() as f64 * (square - 1.0 - square.max(1e-6).ln());
    let speaks = 1.0 / (1.0 + (k.statement_nats - against).exp());
    speaks * clustered / (1.0 + (scatter.structure_nats + pure - k.structure_nats).exp())
}
