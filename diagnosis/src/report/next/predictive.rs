//! What a hypothesis expects at conditions that were not measured, and how surely, correlated between conditions.
//!
//! A cause is uncertain in its parameters and its departure from form, the open set in its smooth parts, all
//! in the baseline. A second pass at a condition adds less: the hypothesis' own doubt about it is gone.

use crate::data::RigFile;
use crate::hypotheses::Fitted;
use crate::regression::{Basis, Posterior, Problem, Recalibration};
use crate::verdict::Decision;
use models::Condition;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// One hypothesis' predictions over a grid of conditions.
pub struct Predictive {
    /// Names joined by `+`; `unknown` for the open set, `no gap` for the baseline.
    pub name: String,
    /// Probability after the verdict's gates.
    pub probability: f64,
    /// Expected lateral forces, N.
    pub mean: DVector<f64>,
    /// Covariance of what it does not know, without the scatter of passes, N^2.
    pub covariance: DMatrix<f64>,
    /// Variance of a pass about that, N^2.
    pub scatter: Vec<f64>,
}

/// The hypotheses that a decision leaves: the likeliest candidates, no gap and the open set. The leader comes first.
pub fn predictives(fitted: &Fitted, rig: &RigFile, decision: &Decision, at: &[Condition]) -> Vec<Predictive> {
    let k = &fitted.problem.constants;
    let problem = fitted.problem.at(at);
    let basis = fitted.kernels.at(at);
    let mut order: Vec<usize> = (0..fitted.candidates.len()).collect();
    order.sort_by(|&a, &b| decision.probabilities[b].total_cmp(&decision.probabilities[a]).then(a.cmp(&b)));
    if let Some(leader) = decision.leader() {
        order.retain(|&i| i != leader);
        order.insert(0, leader);
    }
    order.truncate(k.design_candidates);
    let of = |name: String, probability: f64, best: &Posterior| {
        let (mean, covariance) = expected(fitted, &problem, &basis, best);
        let probability = probability.max(k.design_least_probability);
        Predictive { name, probability, mean, covariance, scatter: Vec::new() }
    };
    let cause = |i: usize| {
        let c = &fitted.candidates[i];
        of(c.names().join("+"), decision.probabilities[i], &c.best)
    };
    let mut list: Vec<Predictive> = order.into_par_iter().map(cause).collect();
    list.push(of("no gap".to_string(), decision.no_gap, &fitted.baseline));

    let level: Vec<f64> = list[0].mean.iter().copied().collect();
    let scatter = fitted.scatter_of_a_pass(&problem, rig, &fitted.baseline.u, &level);
    list.iter_mut().for_each(|belief| belief.scatter.clone_from(&scatter));
    let (mean, covariance, white) = fitted.discrepancy.belief(&fitted.problem, at);
    let scatter = scatter.iter().zip(&white).map(|(s, w)| s + w).collect();
    let (name, probability) = ("unknown".to_string(), decision.open_set.max(k.design_least_probability));
    list.push(Predictive { name, probability, mean, covariance, scatter });
    list
}

/// Mean and covariance of a fitted hypothesis at a grid: parameters and departure from form, jointly.
fn expected(fitted: &Fitted, grid: &Problem, basis: &Basis, e: &Posterior) -> (DVector<f64>, DMatrix<f64>) {
    let problem = &fitted.problem;
    let plain = grid.predict(&e.members, &e.u);
    let here = grid.jacobian(&e.members, &e.u, &plain);
    let there = problem.jacobian(&e.members, &e.u, &e.prediction);
    let d = e.u.len();
    let r = e.departure.len();
    let (mut seen, mut planned) = (there.insert_columns(d, r, 0.0), here.insert_columns(d, r, 0.0));
    let mut mean = plain.clone();
    if r > 0 {
        let shift = Recalibration::of(problem, &e.u, &e.prediction).shift;
        let columns = e.change.at(grid, &e.members, &e.u, &plain, &shift).columns(basis, e.freedom.share);
        mean += &columns * &e.departure;
        seen.columns_mut(d, r).copy_from(&e.change.columns(&fitted.basis, e.freedom.share));
        planned.columns_mut(d, r).copy_from(&columns);
    }
    let mut precision = problem.covariance(&DMatrix::zeros(problem.len(), 0)).inner(&seen, &seen);
    for (k, p) in problem.prior_precision(&e.members).iter().enumerate() {
        // A uniform prior is as wide as its bounds; a little keeps what the table does not touch finite.
        precision[(k, k)] += p.max(1e-2);
    }
    (d..d + r).for_each(|k| precision[(k, k)] += 1.0);
    let factor = precision.cholesky().expect("a prior makes the precision positive definite");
    let root = factor.l().solve_lower_triangular(&planned.transpose());
    let root = root.expect("a Cholesky factor has no zero on its diagonal");
    (mean, root.transpose() * root)
}
