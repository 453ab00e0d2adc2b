//! Smooth functions of standardised covariates: a low-rank kernel. docs/diagnosis/model.md, section 5.

use crate::constants::Constants;
use crate::data::Table;
use models::Condition;
use models::covariate::{Covariate, CovariateRole, SMOOTH};
use nalgebra::{DMatrix, DVector};

/// Which covariates a kernel sees, each kind with its length in standard deviations; an infinite one leaves
/// it out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lengths {
    /// Settings: amplitude, frequency, speed, load, pressure.
    pub condition: f64,
    /// Time.
    pub time: f64,
    /// Position along the plate.
    pub position: f64,
    /// Temperature and humidity.
    pub climate: f64,
    /// Which covariates are seen at all.
    pub seen: [bool; COUNT],
}

impl Lengths {
    fn of(&self, covariate: usize) -> f64 {
        if !self.seen[covariate] {
            return f64::INFINITY;
        }
        match SMOOTH[covariate].role {
            CovariateRole::Setting => self.condition,
            CovariateRole::Time => self.time,
            CovariateRole::Place => self.position,
            CovariateRole::Climate => self.climate,
        }
    }
}

/// Lengths of the form uncertainty in standard deviations of each covariate; a form does not depend on the
/// place.
pub fn form_lengths(k: &Constants) -> Lengths {
    let (length, far) = (k.form_length, f64::INFINITY);
    Lengths { condition: length, time: length, position: far, climate: far, seen: [true; COUNT] }
}

/// Standardised covariates of passes.
#[derive(Debug, Clone)]
pub struct Coordinates {
    mean: [f64; COUNT],
    /// Zero where the table says nothing of a covariate.
    sd: [f64; COUNT],
    largest_amplitude: f64,
}

/// Deviations of a covariate beyond which a place counts as the edge of the design.
const EDGE_SD: f64 = 4.0;
/// Number of covariates.
pub(crate) const COUNT: usize = SMOOTH.len();
/// Temperature or humidity of which time explains more than this share of the deviation is time by another
/// name.
const OF_ITS_OWN: f64 = 0.5;

impl Coordinates {
    /// Mean and deviation of each covariate over the table. One that some passes lack is left out, and
    /// weather that is time by another name.
    pub fn of(table: &Table) -> Self {
        Self::from(table, OF_ITS_OWN)
    }

    /// The same; with a share of zero all weather that changes, for functions that do not go over time.
    pub fn from(table: &Table, of_its_own: f64) -> Self {
        let n = table.len() as f64;
        let largest_amplitude = table.design.largest_amplitude_m;
        let (mut mean, mut sd) = ([0.0; COUNT], [0.0; COUNT]);
        for (k, c) in SMOOTH.iter().enumerate() {
            let Some(values) = scaled(c, &table.passes, largest_amplitude) else { continue };
            mean[k] = values.iter().sum::<f64>() / n;
            sd[k] = (values.iter().map(|v| (v - mean[k]).powi(2)).sum::<f64>() / n).sqrt();
            let own = match c.role {
                CovariateRole::Climate if of_its_own > 0.0 => without_time(table, &values),
                _ => sd[k],
            };
            if own < c.least_spread || own < of_its_own * sd[k] {
                sd[k] = 0.0;
            }
        }
        Self { mean, sd, largest_amplitude }
    }

    /// Temperature and humidity, where they change in a way that time does not tell.
    pub fn climate(&self) -> impl Iterator<Item = &'static Covariate> + '_ {
        let all = SMOOTH.iter().zip(&self.sd);
        all.filter(|(c, sd)| c.role == CovariateRole::Climate && **sd > 0.0).map(|(c, _)| *c)
    }

    /// Settings that the table changes.
    pub fn varying(&self) -> impl Iterator<Item = usize> {
        (0..COUNT).filter(|&k| self.sd[k] > 1e-12 && SMOOTH[k].role == CovariateRole::Setting)
    }

    /// Standardised covariates divided by the lengths. What a condition does not say is taken as the table's
    /// mean.
    pub fn place(&self, p: &Condition, lengths: &Lengths) -> [f64; COUNT] {
        std::array::from_fn(|k| {
            let c = SMOOTH[k];
            let length = lengths.of(k);
            match c.of(p) {
                Some(value) if self.sd[k] > 1e-12 && length.is_finite() => {
                    // What lies far outside the design counts as its edge.
                    let place = (c.scaled(value, self.largest_amplitude) - self.mean[k]) / self.sd[k];
                    place.clamp(-EDGE_SD, EDGE_SD) / length
                }
                _ => 0.0,
            }
        })
    }
}

/// Values of a covariate on its scale; none of one that some passes lack.
pub(crate) fn scaled(c: &Covariate, passes: &[Condition], largest_amplitude: f64) -> Option<Vec<f64>> {
    passes.iter().map(|p| c.of(p).map(|v| c.scaled(v, largest_amplitude))).collect()
}

/// Standard deviation of what a cubic in time leaves of the values.
fn without_time(table: &Table, values: &[f64]) -> f64 {
    let n = values.len();
    let half = (0.5 * table.design.duration_s).max(1e-9);
    let powers = DMatrix::from_fn(n, 4, |i, j| (table.passes[i].time_s / half - 1.0).powi(j as i32));
    let measured = DVector::from_column_slice(values);
    let fitted = powers.clone().svd(true, true).solve(&measured, 1e-9);
    let left = fitted.map_or_else(|_| measured.clone(), |c| &measured - &powers * c);
    (left.norm_squared() / n as f64).sqrt()
}

/// A squared-exponential kernel, represented by pivots chosen by incomplete Cholesky.
#[derive(Debug, Clone)]
pub struct Kernel {
    pivots: Vec<[f64; COUNT]>,
    /// Lower triangle of the factor at the pivots.
    factor: DMatrix<f64>,
}

fn correlation(a: &[f64; COUNT], b: &[f64; COUNT]) -> f64 {
    let d: f64 = a.iter().zip(b).map(|(x, y)| (x - y) * (x - y)).sum();
    (-0.5 * d).exp()
}

impl Kernel {
    /// Chooses at most `rank` pivots among the places, until no place has more than `rest` variance left.
    pub fn new(places: &[[f64; COUNT]], rank: usize, rest: f64) -> Self {
        let n = places.len();
        let mut left = vec![1.0f64; n];
        let mut columns: Vec<Vec<f64>> = Vec::new();
        let mut chosen: Vec<usize> = Vec::new();
        for _ in 0..rank.min(n) {
            let most = left.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1).then(b.0.cmp(&a.0)));
            let (pivot, &top) = most.expect("a table has passes");
            if top < rest {
                break;
            }
            let root = top.sqrt();
            let at = |i: usize| {
                let seen: f64 = columns.iter().map(|c| c[i] * c[pivot]).sum();
                (correlation(&places[i], &places[pivot]) - seen) / root
            };
            let column: Vec<f64> = (0..n).map(at).collect();
            left.iter_mut().zip(&column).for_each(|(left, c)| *left = (*left - c * c).max(0.0));
            left[pivot] = 0.0;
            chosen.push(pivot);
            columns.push(column);
        }
        let r = chosen.len();
        let factor = DMatrix::from_fn(r, r, |i, j| if j <= i { columns[j][chosen[i]] } else { 0.0 });
        Self { pivots: chosen.iter().map(|&i| places[i]).collect(), factor }
    }

    /// Number of smooth directions.
    pub fn rank(&self) -> usize {
        self.pivots.len()
    }

    /// Values of the basis at a place: `basis . basis'` approximates the kernel.
    pub fn basis(&self, place: &[f64; COUNT]) -> Vec<f64> {
        let r = self.rank();
        let mut row = vec![0.0; r];
        for i in 0..r {
            let mut v = correlation(place, &self.pivots[i]);
            (0..i).for_each(|j| v -= row[j] * self.factor[(i, j)]);
            row[i] = v / self.factor[(i, i)];
        }
        row
    }

    /// The basis at many places, a row each.
    pub fn matrix(&self, places: &[[f64; COUNT]]) -> DMatrix<f64> {
        let rows: Vec<Vec<f64>> = places.iter().map(|p| self.basis(p)).collect();
        DMatrix::from_fn(places.len(), self.rank(), |i, j| rows[i][j])
    }
}
