//! The scatter of real passes: how wrong the stated repeatability is, what shifts between runs, what lasts
//! from pass to pass, and which passes do not belong. docs/diagnosis/model.md, section 3.
//!
//! A statement of repeatability is a prior. A flexible surface, the open set's, stands for whatever friction
//! may do; what single passes leave beside it is scatter:
//!
//! `y = surface + level * shift[run] + e`, `shift ~ N(0, run_sd^2)`,
//! `e ~ (1 - share) N(0, scale^2 v) + share Cauchy(0, 5 scale sqrt(v))`, correlated from pass to pass.
//!
//! Scales climb the marginal likelihood of the surface; responsibilities come from the residual of each pass
//! about a surface that did not see it, in turn. A pass counts by its responsibility, so the answer changes
//! smoothly with the number of bad passes. All hypotheses share the result.

pub(crate) mod clusters;
mod lasting;
pub mod noise;
mod serial;
mod surface;
mod suspects;

pub(crate) use clusters::{Space, moments, shuffled, strongest};
pub use noise::{PureError, settle, variance};

use crate::constants::Constants;
use crate::data::Table;
use crate::regression::{Problem, beside_each_other, lengths};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use serde::Serialize;
use surface::{ScatterSurface, State};

/// A pass that does not belong to the rest of its table.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Suspect {
    /// Number of the point.
    pub point: u64,
    /// Row of the table.
    #[serde(skip)]
    pub row: usize,
    /// Measured less what the other passes lead to expect, N.
    pub residual_n: f64,
    /// The same in standard deviations of a pass that belongs.
    pub deviations: f64,
    /// Probability that it does not belong.
    pub probability: f64,
}

/// What a table says about its own scatter.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Scatter {
    /// Standard deviation of a pass over the stated one, as it was used.
    pub scale: f64,
    /// Relative standard deviation of the level of friction from run to run; `None` where the table has one run.
    pub run_relative_sd: Option<f64>,
    /// Correlation of a pass's scatter with that of the next.
    pub serial_correlation: f64,
    /// Passes that do not belong, in the order of the table.
    pub suspects: Vec<Suspect>,
    /// Where passes that stand out lie together, which makes them a departure and no bad passes.
    pub together_in: Option<String>,
    /// Size of the scatter that lasts over that of the independent one, and its own correlation.
    #[serde(skip)]
    pub slow: [f64; 2],
    /// Nats that it had to gain.
    #[serde(skip)]
    pub slow_cost: f64,
    /// Probability of each pass not to belong.
    #[serde(skip)]
    pub outside: Vec<f64>,
    /// Factor on the variance of each pass: one, and more for a pass that may not belong.
    #[serde(skip)]
    pub inflation: Vec<f64>,
    /// Friction at each pass without its scatter, N.
    #[serde(skip)]
    pub level: Vec<f64>,
    /// The same of the baseline: what passes have in common is measured on it. On the measured level a shift
    /// of runs would pull every fit that misses towards zero.
    #[serde(skip)]
    pub under: Vec<f64>,
    /// Scale of the scatter if the recalibrated baseline were all there is.
    #[serde(skip)]
    pub bare_scale: f64,
    /// Nats by which a surface beats that.
    #[serde(skip)]
    pub structure_nats: f64,
    /// Probability that scatter alone clusters as much as what the baseline leaves.
    #[serde(skip)]
    pub clustered_p: f64,
}

/// Rounds in which scales and responsibilities take turns. Every smoothness is tried in those listed: the
/// first round shows little while bad passes still count.
const ROUNDS: usize = 8;
const ALL_SMOOTHNESSES: [usize; 2] = [0, 3];
/// Rounds in which weights are those of Student's t, before there is a scale to go by.
const HEAVY: usize = 2;
/// Change of a weight below which the rounds end.
const SETTLED: f64 = 0.02;
/// Median of a standard deviate's size.
const HALF_NORMAL_MEDIAN: f64 = 0.6745;
/// Deviations from which a pass that stands out of a cause is worth another fit.
const FAR_SD: f64 = 4.5;
/// Bounds of the baseline's level over the measured one.
const UNDER: [f64; 2] = [0.5, 2.0];
/// Largest share of the passes that may be bad where the baseline explains all others.
const FEW: f64 = 0.05;
/// Passes' worth of weight that is worth another fit.
const WORTH: f64 = 2.0;

/// Which passes are taken to belong.
#[derive(Debug, Clone, PartialEq)]
pub enum Belief {
    /// Each by its residual about a surface that did not see it.
    ByResidual,
    /// All.
    All,
    /// By residuals about the mean of a leading cause or of the baseline, and what follows from them.
    AboutMean {
        /// Residuals, in deviations of a pass.
        deviations: Vec<f64>,
        /// Probabilities not to belong.
        outside: Vec<f64>,
    },
}

/// Correlation of the scatter of neighbours: of what lasts, diluted by what does not.
fn correlation([size, rho]: [f64; 2]) -> f64 {
    rho * size * size / (1.0 + size * size)
}

/// Estimates the scatter of a table. `stated` gives the variances that rig.toml states at a level of friction.
pub fn estimate(
    table: &Table,
    problem: &Problem,
    center: &[f64],
    stated: &dyn Fn(&[f64]) -> Vec<f64>,
    belief: &Belief,
) -> Scatter {
    let k = &*problem.constants;
    let n = problem.len();
    let surfaces: Vec<ScatterSurface> =
        lengths(k, table).into_par_iter().map(|l| ScatterSurface::new(table, problem, center, l)).collect();
    let start = State::start(table.run_count > 1).within(&lasting::bounds(k, table));
    let under = problem.predict(&[], center).as_slice().to_vec();
    let mut level = under.clone();
    let mut variance = stated(&level);
    let mut weight = match belief {
        Belief::AboutMean { deviations, outside } => suspects::weights(k, outside, deviations),
        _ => vec![1.0; n],
    };
    let (mut best, mut state) = (0, start);
    for round in 0..ROUNDS {
        if ALL_SMOOTHNESSES.contains(&round) {
            let fits: Vec<(f64, State)> =
                surfaces.par_iter().map(|s| s.climbed(&variance, &weight, &level, state)).collect();
            best = (0..fits.len()).fold(0, |b, i| if fits[i].0 > fits[b].0 { i } else { b });
            state = fits[best].1;
        } else {
            state = surfaces[best].climbed(&variance, &weight, &level, state).1;
        }
        let seen = surfaces[best].seen(&variance, &weight, &level, &state);
        let judged = || suspects::weights(k, &suspects::responsibilities(k, &seen.left_out), &seen.left_out);
        let next = match belief {
            Belief::ByResidual if round < HEAVY => suspects::heavy(&seen.left_out),
            Belief::ByResidual => judged(),
            _ => weight.clone(),
        };
        let moved = next.iter().zip(&weight).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        (weight, level) = (next, seen.level);
        variance = stated(&level);
        if round > ALL_SMOOTHNESSES[1] && moved < SETTLED {
            break;
        }
    }
    let surface = &surfaces[best];
    let seen = surface.seen(&variance, &weight, &level, &state);
    let space = clusters::Space::of(problem);
    let (deviations, outside, together_in) = match belief {
        Belief::ByResidual => {
            let mut outside = suspects::responsibilities(k, &seen.left_out);
            let place = suspects::take_back(problem, &space, &mut outside, &seen.left_out);
            (seen.left_out, outside, place)
        }
        Belief::All => (seen.left_out, vec![0.0; n], None),
        Belief::AboutMean { deviations, outside } => (deviations.clone(), outside.clone(), None),
    };
    let weight = suspects::weights(k, &outside, &deviations);
    let (whole, _) = surface.climbed(&variance, &weight, &level, state);
    let bare = surface.bare(&variance, &weight, &level, &state);
    // A scatter about the baseline has no mean of its own anywhere.
    let bounded = |(d, w): (&f64, &f64)| (d / w.sqrt()).clamp(-suspects::BOUNDED_SD, suspects::BOUNDED_SD);
    let about = surface.seen(&variance, &weight, &level, &bare.1).beside;
    let beside: Vec<f64> = about.iter().zip(&weight).map(bounded).collect();
    let along = beside.iter().zip(&problem.passes).map(|(d, p)| d * p.direction.sign()).collect();
    let clustered = space.cluster(&[beside, along], &[]).p;
    let suspect = |i: usize| Suspect {
        point: table.points[i],
        row: i,
        residual_n: deviations[i] * variance[i].sqrt(),
        deviations: deviations[i],
        probability: outside[i],
    };
    Scatter {
        scale: 1.0,
        run_relative_sd: (table.run_count > 1).then(|| state.run(k)),
        serial_correlation: if state.slow(k)[0] > 0.0 {
            correlation(state.slow(k))
        } else {
            serial::correlation(k, table, &seen.beside)
        },
        suspects: (0..n).filter(|&i| outside[i] > k.suspect_probability).map(suspect).collect(),
        together_in,
        slow: state.slow(k),
        slow_cost: if state.slow(k)[0] > 0.0 { k.slow_nats } else { 0.0 },
        outside: outside.clone(),
        inflation: weight.iter().map(|w| 1.0 / w).collect(),
        level: seen.level,
        under,
        bare_scale: bare.2,
        structure_nats: (whole - bare.0).max(0.0),
        clustered_p: clustered,
    }
}

impl Scatter {
    /// Which passes belong, judged again about the mean of a leading cause; none where that says nothing new.
    ///
    /// What the cause explains belongs after all, though a surface did not follow it. What stands out of it is bad where the
    /// cause holds for the others: their scatter is no larger than it should be, and those that stand out fall anywhere.
    pub fn about_mean(&self, problem: &Problem, mean: &DVector<f64>) -> Option<Belief> {
        let k = &*problem.constants;
        let n = problem.len();
        let residual = DVector::from_column_slice(&problem.lateral) - mean;
        let shared = problem.covariance(&DMatrix::zeros(n, 0)).weights(&residual);
        let beside = residual - &problem.common * shared;
        let mut deviations: Vec<f64> =
            (0..n).map(|i| beside[i] / (problem.variance[i] / self.inflation[i]).sqrt()).collect();
        let mut sizes: Vec<f64> = deviations.iter().map(|d| d.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let spread = sizes[n / 2] / HALF_NORMAL_MEDIAN;
        deviations.iter_mut().for_each(|d| *d /= spread.max(1.0));
        let mut outside = suspects::responsibilities(k, &deviations);
        let holds = spread < k.cause_holds_spread
            && suspects::take_back(problem, &clusters::Space::of(problem), &mut outside.clone(), &deviations)
                .is_none();
        if !holds {
            outside.iter_mut().zip(&self.outside).for_each(|(o, before)| *o = o.min(*before));
        }
        let called = |o: &f64| *o > k.suspect_probability;
        let found =
            (0..n).any(|i| called(&outside[i]) && !called(&self.outside[i]) && deviations[i].abs() > FAR_SD);
        // Passes' worth of weight that belongs after all.
        let weight = suspects::weights(k, &outside, &deviations);
        let regained: f64 =
            (0..n).filter(|&i| !called(&outside[i])).map(|i| weight[i] - 1.0 / self.inflation[i]).sum();
        (found || regained > WORTH).then_some(Belief::AboutMean { deviations, outside })
    }

    /// The same about the recalibrated baseline, where that makes a few more passes suspect.
    pub fn about_baseline(&self, problem: &Problem, mean: &DVector<f64>) -> Option<Belief> {
        let suspects =
            |outside: &[f64]| outside.iter().filter(|o| **o > problem.constants.suspect_probability).count();
        let few = |outside: &[f64]| {
            suspects(outside) > suspects(&self.outside)
                && suspects(outside) as f64 <= FEW * problem.len() as f64
        };
        let about = self.about_mean(problem, mean);
        about.filter(|belief| matches!(belief, Belief::AboutMean { outside, .. } if few(outside)))
    }

    /// Enters a problem whose variances are those of single passes: what passes have in common leaves them
    /// and becomes columns of its own.
    pub fn enter(&self, table: &Table, problem: &mut Problem) {
        let (share, common) = if self.slow[0] > 0.0 {
            (1.0, self.lasting(table, &problem.constants, &problem.variance))
        } else {
            serial::columns(self.serial_correlation, table, problem, &self.inflation)
        };
        problem.variance.iter_mut().for_each(|v| *v *= share);
        problem.common = common;
        if let Some(sd) = self.run_relative_sd.filter(|sd| *sd > 0.0) {
            let mut shifts = DMatrix::zeros(problem.len(), table.run_count);
            (0..problem.len()).for_each(|i| shifts[(i, table.runs[i])] = sd * self.under[i]);
            problem.common = beside_each_other(&problem.common, &shifts);
        }
    }

    /// How many of the columns that passes have in common are those of the scatter that lasts; they come first.
    pub fn lasting_columns(&self, problem: &Problem) -> usize {
        if self.slow[0] > 0.0 { lasting::modes(&problem.constants, problem.len()) } else { 0 }
    }

    /// Columns of the scatter that lasts, N, beside these variances of single passes.
    pub fn lasting(&self, table: &Table, k: &Constants, variance: &[f64]) -> DMatrix<f64> {
        let [size, rho] = self.slow;
        if size == 0.0 {
            return DMatrix::zeros(variance.len(), 0);
        }
        let mut columns = lasting::cosines(k, table);
        let powers = lasting::powers(rho, variance.len(), columns.ncols());
        for (mut column, power) in columns.column_iter_mut().zip(powers) {
            for i in 0..column.len() {
                let own = (variance[i] / self.inflation[i]).sqrt();
                let under = (self.under[i] / self.level[i]).abs().clamp(UNDER[0], UNDER[1]);
                column[i] *= size * power.sqrt() * own * under;
            }
        }
        columns
    }
}
