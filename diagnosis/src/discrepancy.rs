//! The open set: what any smooth departure from the baseline would look like, whatever its cause.
//!
//! `y = baseline + friction-like part + direction-odd part + white excess + noise`, each part Gaussian with its
//! scale on a fixed grid, so that no scale is fitted. Its evidence is what a named effect has to beat.

use crate::constants::Constants;
use crate::data::Table;
use crate::fit::Problem;
use crate::gaussian::{Covariance, log_sum_exp};
use crate::kernel::{Coordinates, Kernel, Lengths};
use crate::layout::NUISANCES;
use models::condition::Condition;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// The smoothnesses that are tried: rough; as smooth as the form uncertainty of an effect, so that the open set can follow
/// what that can; smoother yet, so that a cause that bends little is as cheap as an effect that imitates it; a spot of the
/// plate, alike at all conditions; and two that go with temperature and humidity, where these change by themselves.
pub fn lengths(k: &Constants, table: &Table) -> Vec<Lengths> {
    let all = (0..k.discrepancy_lengths.len()).map(|i| Lengths {
        condition: k.discrepancy_lengths[i],
        time: k.discrepancy_time_lengths[i],
        position: k.discrepancy_position_lengths[i],
        climate: k.discrepancy_climate_lengths[i],
    });
    let sees = Coordinates::of(table).sees_climate();
    all.filter(|l| sees || !l.climate.is_finite()).collect()
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
fn scale(baseline: f64, full: f64) -> f64 {
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
        let basis = kernel.basis(&coordinates.place(p, problem.design.largest_amplitude_m, lengths));
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
        for i in 0..passes.len() {
            phi[(i, 2 * r + k)] = (there[i] - baseline[i]) / STEP;
        }
    }
    (baseline, phi, sizes)
}

impl Discrepancy {
    /// Fits the discrepancy about the baseline at `center` (nuisance coordinates): the best of some smoothnesses (of
    /// [`lengths`], unless only a level is wanted), with the evidence of their mean.
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
        let coordinates = Coordinates::of(table);
        let places: Vec<_> = problem
            .passes
            .iter()
            .map(|p| coordinates.place(p, problem.design.largest_amplitude_m, &lengths))
            .collect();
        let kernel = Kernel::new(&places, k.discrepancy_rank, k.kernel_rest);
        let r = kernel.rank();
        let (baseline, phi, sizes) =
            rows(problem, center, &problem.passes, &coordinates, (&kernel, &lengths), (1.0, 1.0));
        let n = problem.len();
        let residual = DVector::from_fn(n, |i, _| problem.lateral[i] - baseline[i]);
        // The nuisances' prior is centred on the nominal values, not on where the baseline was recalibrated.
        let pull: DVector<f64> = DVector::from_fn(NUISANCES, |k, _| center[k]);
        let nuisance = phi.columns(2 * r, NUISANCES).into_owned();
        let residual = residual + nuisance * pull;
        let mut all = Vec::new();
        let mut best = (f64::NEG_INFINITY, 0.0, 0.0, 0.0);
        for white in k.discrepancy_white {
            let variance: Vec<f64> =
                (0..n).map(|i| problem.variance[i] + (white * sizes[i]).powi(2)).collect();
            let sqrt: DVector<f64> = DVector::from_iterator(n, variance.iter().map(|v| 1.0 / v.sqrt()));
            let mut whitened = phi.clone();
            for mut c in whitened.column_iter_mut() {
                c.component_mul_assign(&sqrt);
            }
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
                    let size = |j: usize| {
                        if j < r {
                            friction
                        } else if j < 2 * r {
                            odd
                        } else {
                            1.0
                        }
                    };
                    let active: Vec<usize> = (0..2 * r + NUISANCES).filter(|&j| size(j) > 0.0).collect();
                    let a = active.len();
                    let mut inner = DMatrix::from_fn(a, a, |i, j| {
                        gram[(active[i], active[j])] * size(active[i]) * size(active[j])
                    });
                    for i in 0..a {
                        inner[(i, i)] += 1.0;
                    }
                    let g = DVector::from_fn(a, |i, _| score[active[i]] * size(active[i]));
                    let Some(factor) = inner.cholesky() else { continue };
                    let inner_det: f64 =
                        2.0 * factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
                    let fitted = g.dot(&factor.solve(&g));
                    let value =
                        -0.5 * (chi - fitted + log_det + inner_det) - n as f64 * 0.918_938_533_204_672_8;
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
        let variance: Vec<f64> = (0..n).map(|i| problem.variance[i] + (white * sizes[i]).powi(2)).collect();
        let covariance = Covariance::new(&variance, &scaled);
        let weights = covariance.weights(&residual);
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

    /// Expected lateral forces at other conditions (N), the rows of the smooth part there, and the sizes on which a
    /// departure is measured (N).
    fn expected(&self, problem: &Problem, passes: &[Condition]) -> (DVector<f64>, DMatrix<f64>, Vec<f64>) {
        let parts = (self.friction, self.odd);
        let kernel = (&self.kernel, &self.lengths);
        let (baseline, phi, sizes) = rows(problem, &self.center, passes, &self.coordinates, kernel, parts);
        let r = self.kernel.rank();
        let shift = phi.columns(2 * r, NUISANCES) * DVector::from_column_slice(&self.center[..NUISANCES]);
        (baseline - shift + &phi * &self.weights, phi, sizes)
    }

    /// Predicted lateral forces at other conditions, their covariance without scatter, and the variance of the white
    /// excess there (N, N^2, N^2).
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
