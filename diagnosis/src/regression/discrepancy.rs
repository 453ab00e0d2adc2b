//! The open set: any smooth departure from the baseline. docs/diagnosis/model.md, section 6.
//!
//! `y = baseline + friction-like part + direction-odd part + white excess + noise`, each part Gaussian with
//! its scale on a fixed grid, so that no scale is fitted. Its evidence is what a named effect has to beat.

use crate::constants::Constants;
use crate::data::Table;
use crate::regression::{
    COUNT, Coordinates, Covariance, HALF_LN_2PI, Kernel, Lengths, NUISANCES, Problem, Scaled, log_sum_exp,
    rows_times,
};
use models::{Condition, Covariate};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// The smoothnesses that are tried: rough; as smooth as the form uncertainty of an effect, so that the open
/// set can follow what that can; smoother yet, so that a cause that bends little is as cheap as an effect
/// that imitates it; a spot of the plate, alike at all conditions; two that go with temperature and humidity,
/// where these change by themselves; and each covariate alone: a law of the load is cheap there, and dear
/// where it might bend with all others too.
pub fn lengths(k: &Constants, table: &Table) -> Vec<Lengths> {
    let all = (0..k.discrepancy_lengths.len()).map(|i| Lengths {
        condition: k.discrepancy_lengths[i],
        time: k.discrepancy_time_lengths[i],
        position: k.discrepancy_position_lengths[i],
        climate: k.discrepancy_climate_lengths[i],
        seen: [true; COUNT],
    });
    let coordinates = Coordinates::of(table);
    let (sees, alone) = (coordinates.climate().next().is_some(), k.discrepancy_lengths[0]);
    let far = f64::INFINITY;
    let each = coordinates.varying().map(|only| {
        let seen = std::array::from_fn(|k| k == only);
        Lengths { condition: alone, time: alone, position: alone, climate: far, seen }
    });
    all.filter(|l| sees || !l.climate.is_finite()).chain(each).collect()
}

/// Step of a difference in a nuisance's coordinate.
const STEP: f64 = 1e-3;

/// The discrepancy fitted to a table.
pub struct Discrepancy {
    lengths: Lengths,
    coordinates: Coordinates,
    kernel: Kernel,
    /// Log evidence over the grid without the point where all scales vanish.
    pub log_evidence: f64,
    friction: f64,
    odd: f64,
    white: f64,
    weights: DVector<f64>,
    covariance: Covariance,
    center: Vec<f64>,
    /// Smooth estimate of the lateral force at the table's passes, N.
    pub smooth: DVector<f64>,
}

/// Size on which a departure is measured at a pass: between the friction there and full friction, N.
pub(crate) fn scale(baseline: f64, full: f64) -> f64 {
    (baseline.abs() * full).sqrt()
}

fn rows(
    problem: &Problem,
    center: &[f64],
    passes: &[Condition],
    coordinates: &Coordinates,
    (kernel, lengths): (&Kernel, &Lengths),
    parts: (f64, f64),
) -> (DVector<f64>, DMatrix<f64>, Vec<f64>) {
    let baseline = problem.predict_at(&[], center, passes);
    let mu0 = problem.baseline(center).mu0;
    let r = kernel.rank();
    let mut phi = DMatrix::zeros(passes.len(), 2 * r + NUISANCES);
    let mut sizes = Vec::with_capacity(passes.len());
    for (i, p) in passes.iter().enumerate() {
        let size = scale(baseline[i], mu0 * p.normal_force_n);
        let basis = kernel.basis(&coordinates.place(p, lengths));
        for (j, b) in basis.iter().enumerate() {
            phi[(i, j)] = parts.0 * p.direction.sign() * size * b;
            phi[(i, r + j)] = parts.1 * size * b;
        }
        sizes.push(size);
    }
    let mut moved = center.to_vec();
    for k in 0..NUISANCES {
        moved[k] += STEP;
        let there = problem.predict_at(&[], &moved, passes);
        moved[k] = center[k];
        phi.set_column(2 * r + k, &((there - &baseline) / STEP));
    }
    (baseline, phi, sizes)
}

/// The forces of a table about the baseline: what is to be explained, and the columns that may explain it.
pub(crate) struct Linear {
    /// Covariates of the kernel.
    pub coordinates: Coordinates,
    /// Its pivots.
    pub kernel: Kernel,
    /// Baseline at the centre, N.
    pub baseline: DVector<f64>,
    /// Columns, N: the part that turns with the direction, the part that does not, then the nuisances.
    pub columns: DMatrix<f64>,
    /// Size on which a departure is measured at each pass, N.
    pub sizes: Vec<f64>,
    /// Measured less baseline, N, the nuisances counted from their nominal values.
    pub residual: DVector<f64>,
}

impl Linear {
    /// The forces of a table about the baseline at `center`, for one smoothness.
    pub fn about(table: &Table, problem: &Problem, center: &[f64], lengths: Lengths) -> Self {
        let k = &problem.constants;
        let coordinates = Coordinates::of(table);
        let places: Vec<_> = problem.passes.iter().map(|p| coordinates.place(p, &lengths)).collect();
        let kernel = Kernel::new(&places, k.discrepancy_rank, k.kernel_rest);
        let (baseline, columns, sizes) =
            rows(problem, center, &problem.passes, &coordinates, (&kernel, &lengths), (1.0, 1.0));
        // The nuisances' prior is centred on the nominal values, not on where the baseline was recalibrated.
        let pull = DVector::from_column_slice(&center[..NUISANCES]);
        let residual = DVector::from_column_slice(&problem.lateral) - &baseline
            + columns.columns(2 * kernel.rank(), NUISANCES) * pull;
        Linear { coordinates, kernel, baseline, columns, sizes, residual }
    }
}

impl Discrepancy {
    /// Fits the discrepancy about the baseline at `center` (nuisance coordinates): the best of some
    /// smoothnesses (of [`lengths`], unless only a level is wanted), with the evidence of their mean.
    pub fn fit(table: &Table, problem: &Problem, center: &[f64], lengths: &[Lengths]) -> Self {
        let all: Vec<Self> =
            lengths.par_iter().map(|l| Self::with_lengths(table, problem, center, *l)).collect();
        let evidence: Vec<f64> = all.iter().map(|w| w.log_evidence).collect();
        let mean = log_sum_exp(&evidence) - (lengths.len() as f64).ln();
        let best = all.into_iter().reduce(|a, b| if b.log_evidence > a.log_evidence { b } else { a });
        Discrepancy { log_evidence: mean, ..best.expect("there are lengths") }
    }

    fn with_lengths(table: &Table, problem: &Problem, center: &[f64], lengths: Lengths) -> Self {
        let k = &problem.constants;
        let Linear { coordinates, kernel, baseline, columns: phi, sizes, residual } =
            Linear::about(table, problem, center, lengths);
        let r = kernel.rank();
        let n = problem.len();
        let with_white = |white: f64| -> Vec<f64> {
            problem.variance.iter().zip(&sizes).map(|(v, size)| v + (white * size).powi(2)).collect()
        };
        let mut all = Vec::new();
        let mut best = (f64::NEG_INFINITY, 0.0, 0.0, 0.0);
        for white in k.discrepancy_white {
            let variance = with_white(white);
            let sqrt: DVector<f64> = DVector::from_iterator(n, variance.iter().map(|v| 1.0 / v.sqrt()));
            let whitened = rows_times(problem.beside_common(&phi), &sqrt);
            let z = residual.component_mul(&sqrt);
            let t = whitened.transpose();
            let gram = &t * &whitened;
            let score = &t * &z;
            let chi = z.norm_squared();
            let log_det: f64 = variance.iter().map(|v| v.ln()).sum();
            for friction in k.discrepancy_even {
                for odd in k.discrepancy_odd {
                    if white == 0.0 && friction == 0.0 && odd == 0.0 {
                        continue;
                    }
                    let sizes = (0..gram.ncols()).map(|j| match j / r.max(1) {
                        0 => friction,
                        1 => odd,
                        _ => 1.0,
                    });
                    let Some(parts) = Scaled::new(&gram, &score, sizes.collect()) else { continue };
                    let value =
                        -0.5 * (chi - parts.explained + log_det + parts.log_det) - n as f64 * HALF_LN_2PI;
                    all.push(value);
                    if value > best.0 {
                        best = (value, friction, odd, white);
                    }
                }
            }
        }
        let log_evidence = log_sum_exp(&all) - (all.len() as f64).ln();
        let (_, friction, odd, white) = best;
        let mut scaled = phi;
        for j in 0..r {
            scaled.column_mut(j).scale_mut(friction);
            scaled.column_mut(r + j).scale_mut(odd);
        }
        let covariance = Covariance::new(&with_white(white), &problem.beside_common(&scaled));
        let weights = covariance.weights(&residual).rows(0, scaled.ncols()).into_owned();
        let smooth = baseline
            - scaled.columns(2 * r, NUISANCES) * DVector::from_column_slice(&center[..NUISANCES])
            + &scaled * &weights;
        Discrepancy {
            lengths,
            coordinates,
            kernel,
            log_evidence,
            friction,
            odd,
            white,
            weights,
            covariance,
            center: center.to_vec(),
            smooth,
        }
    }

    /// Where it has the nuisances, in their prior deviations.
    pub fn nuisances(&self) -> &[f64] {
        &self.weights.as_slice()[2 * self.kernel.rank()..]
    }

    /// Temperature and humidity, where it goes over them.
    pub fn climate(&self) -> impl Iterator<Item = &'static Covariate> + '_ {
        self.coordinates.climate().filter(|_| self.lengths.climate.is_finite())
    }

    /// Expected lateral forces at other conditions (N), the rows of the smooth part there, and the sizes on
    /// which a departure is measured (N).
    fn expected(&self, problem: &Problem, passes: &[Condition]) -> (DVector<f64>, DMatrix<f64>, Vec<f64>) {
        let parts = (self.friction, self.odd);
        let kernel = (&self.kernel, &self.lengths);
        let (baseline, phi, sizes) = rows(problem, &self.center, passes, &self.coordinates, kernel, parts);
        let r = self.kernel.rank();
        let shift = phi.columns(2 * r, NUISANCES) * DVector::from_column_slice(&self.center[..NUISANCES]);
        (baseline - shift + &phi * &self.weights, phi, sizes)
    }

    /// Predicted lateral forces at other conditions, their covariance without scatter, and the variance of
    /// the white excess there (N, N^2, N^2).
    pub fn belief(&self, problem: &Problem, passes: &[Condition]) -> (DVector<f64>, DMatrix<f64>, Vec<f64>) {
        let (mean, phi, sizes) = self.expected(problem, passes);
        let white = sizes.iter().map(|s| (self.white * s).powi(2)).collect();
        (mean, self.covariance.posterior_covariance(&phi), white)
    }

    /// Predicted lateral force and its standard deviation (white excess included, pass scatter not) at other
    /// conditions, N.
    pub fn predict(&self, problem: &Problem, passes: &[Condition]) -> (Vec<f64>, Vec<f64>) {
        let (mean, phi, sizes) = self.expected(problem, passes);
        let smooth = |i: usize| self.covariance.posterior_variance(&phi.row(i).transpose()).max(0.0);
        let sd = (0..passes.len()).map(|i| (smooth(i) + (self.white * sizes[i]).powi(2)).sqrt()).collect();
        (mean.iter().copied().collect(), sd)
    }
}
