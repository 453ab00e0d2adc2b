//! The scatter under which shapes are tried: as settled, larger, or independent where it is to last.

use super::form::Way;
use crate::regression::{Covariance, Posterior, Problem, log_sum_exp};
use crate::scatter::Scatter;
use nalgebra::{DMatrix, DVector};

/// Scales of independent scatter where none is to last.
const SCALES: [f64; 4] = [1.0, 1.3, 1.7, 2.2];
/// Deviations of a part of the scatter that no function of a setting makes, in units of full friction.
const MORE: [f64; 4] = [0.02, 0.06, 0.2, 0.6];

/// What scatter is taken for.
#[derive(Debug, Clone, Copy)]
pub(super) enum Under {
    /// As it was settled.
    Settled,
    /// With a further part in proportion to friction.
    More(f64),
    /// This much larger and independent; so many columns of scatter that lasts are left out.
    Independent(f64, usize),
}

impl Under {
    /// A problem with this scatter, its baseline at these nuisances.
    pub(super) fn problem(self, part: &Problem, u: &[f64], prediction: &DVector<f64>) -> Problem {
        let with = |variance: Vec<f64>| Problem { variance, ..part.clone() };
        let each = part.variance.iter();
        match self {
            Under::Settled => part.clone(),
            Under::More(size) => {
                let signal = Way::Friction.signal(part, u, prediction);
                with(each.zip(signal.iter()).map(|(v, s)| v + (size * s).powi(2)).collect())
            }
            Under::Independent(scale, lasting) => {
                let shifts = part.common.columns(lasting, part.common.ncols() - lasting).into_owned();
                Problem { common: shifts, ..with(each.map(|v| v * scale * scale).collect()) }
            }
        }
    }
}

/// One of them: its covariance, and log evidence of no gap under it, with its prior, beside that as settled.
pub(super) struct Ground {
    pub(super) under: Under,
    pub(super) covariance: Covariance,
    pub(super) nats: f64,
}

/// All of them, half of the weight for scatter as settled, the rest even; and the nats of larger scatter.
pub(super) fn grounds(
    part: &Problem,
    jacobian: &DMatrix<f64>,
    residual: &DVector<f64>,
    (none, prediction): (&Posterior, &DVector<f64>),
    (scatter, lasting): (&Scatter, usize),
) -> (Vec<Ground>, f64) {
    let evidence = |c: &Covariance| -0.5 * (c.quadratic(residual) + c.log_det);
    let of = |under: Under| (under, under.problem(part, &none.u, prediction).covariance(jacobian));
    let settled = of(Under::Settled);
    let own = evidence(&settled.1);
    let kinds = if lasting > 0 { 2.0 } else { 1.0 };
    let ground = |(under, covariance): (Under, Covariance), gained: f64, share: f64| {
        let nats = evidence(&covariance) - own + gained + share.ln();
        Ground { under, covariance, nats }
    };
    let mut list: Vec<Ground> =
        MORE.map(|size| ground(of(Under::More(size)), 0.0, 0.5 / kinds / MORE.len() as f64)).into();
    let more = log_sum_exp(&list.iter().map(|g| g.nats).collect::<Vec<_>>()) - (0.5 / kinds).ln();
    list.push(ground(settled, 0.0, 0.5));
    if lasting > 0 {
        let share = 0.5 / kinds / SCALES.len() as f64;
        list.extend(
            SCALES.map(|scale| ground(of(Under::Independent(scale, lasting)), scatter.slow_cost, share)),
        );
    }
    (list, more)
}
