//! Least squares within bounds (Levenberg 1944, Marquardt 1963). docs/diagnosis/model.md, section 7.

use crate::regression::{Member, Problem};
use nalgebra::{DMatrix, DVector};

/// Damping at the start, its factors after a step that helps and one that does not, and its least value.
const DAMPING: f64 = 1e-2;
const EASED: f64 = 0.2;
const STIFFENED: f64 = 6.0;
const LEAST_DAMPING: f64 = 1e-9;
/// Dampings that one round tries.
const TRIALS: usize = 6;
/// Gain in chi2 below which a fit has converged.
const GAIN: f64 = 1e-3;
/// Longest step in one coordinate, in deviations of its prior.
const LONGEST_STEP: f64 = 3.0;

/// Where a fit ended.
#[derive(Debug, Clone)]
pub struct Fit {
    /// Coordinates.
    pub u: Vec<f64>,
    /// Prediction there, N.
    pub prediction: DVector<f64>,
    /// Weighted sum of squares plus the prior's.
    pub cost: f64,
}

/// Levenberg-Marquardt with projection onto the bounds; weights are the inverse variances.
pub fn minimise(problem: &Problem, members: &[Member], from: &[f64], variance: &[f64], rounds: usize) -> Fit {
    let bounds = problem.bounds(members);
    let precision = problem.prior_precision(members);
    let n = problem.len();
    let cost_of = |u: &[f64], m: &DVector<f64>| -> f64 {
        let misfit: f64 = (0..n).map(|i| (problem.lateral[i] - m[i]).powi(2) / variance[i]).sum();
        misfit + u.iter().zip(&precision).map(|(x, p)| p * x * x).sum::<f64>()
    };
    let mut u: Vec<f64> = from.iter().zip(&bounds).map(|(x, b)| x.clamp(b.0, b.1)).collect();
    let mut m = problem.predict(members, &u);
    let mut cost = cost_of(&u, &m);
    if rounds == 0 {
        return Fit { u, prediction: m, cost };
    }
    let mut damping = DAMPING;
    let mut jacobian = problem.jacobian(members, &u, &m);
    // Whether the Jacobian is that of this place, or one that was carried along with the last step.
    let mut own = true;
    for round in 0..rounds {
        let (hessian, gradient) = normal_equations(problem, &jacobian, &m, variance, &precision, &u);
        let mut improved = false;
        for _ in 0..TRIALS {
            let Some(next) = bounded_step(&hessian, &gradient, damping, &u, &bounds) else { break };
            let there = problem.predict(members, &next);
            let value = cost_of(&next, &there);
            if value < cost {
                let gain = cost - value;
                if round % 2 == 0 {
                    carry(&mut jacobian, &u, &next, &(&there - &m));
                }
                (u, m, cost) = (next, there, value);
                damping = (damping * EASED).max(LEAST_DAMPING);
                improved = gain > GAIN * (1.0 + 1e-4 * cost);
                break;
            }
            damping *= STIFFENED;
        }
        if !improved && own {
            break;
        }
        // Every second Jacobian is computed, and one where a carried one led nowhere.
        own = !improved || round % 2 == 1;
        if own && round + 1 < rounds {
            jacobian = problem.jacobian(members, &u, &m);
        }
    }
    Fit { u, prediction: m, cost }
}

/// Carries a Jacobian along with a step by the least change that agrees with it (Broyden 1965): a computed
/// one costs a prediction a coordinate.
pub fn carry(jacobian: &mut DMatrix<f64>, from: &[f64], to: &[f64], change: &DVector<f64>) {
    let step = DVector::from_iterator(from.len(), to.iter().zip(from).map(|(t, f)| t - f));
    let square = step.norm_squared();
    if square > 0.0 {
        let missed = change - &*jacobian * &step;
        jacobian.ger(1.0 / square, &missed, &step, 1.0);
    }
}

fn normal_equations(
    problem: &Problem,
    jacobian: &DMatrix<f64>,
    m: &DVector<f64>,
    variance: &[f64],
    precision: &[f64],
    u: &[f64],
) -> (DMatrix<f64>, DVector<f64>) {
    let d = u.len();
    let n = problem.len();
    let mut hessian = DMatrix::zeros(d, d);
    let mut gradient = DVector::zeros(d);
    for a in 0..d {
        let column = jacobian.column(a);
        gradient[a] = -(0..n).map(|i| column[i] * (problem.lateral[i] - m[i]) / variance[i]).sum::<f64>()
            + precision[a] * u[a];
        for b in 0..=a {
            let other = jacobian.column(b);
            let v: f64 = (0..n).map(|i| column[i] * other[i] / variance[i]).sum();
            hessian[(a, b)] = v;
            hessian[(b, a)] = v;
        }
        hessian[(a, a)] += precision[a];
    }
    (hessian, gradient)
}

/// A damped Gauss-Newton step that stays within the bounds; coordinates pushed against a bound stay there.
pub fn bounded_step(
    hessian: &DMatrix<f64>,
    gradient: &DVector<f64>,
    damping: f64,
    u: &[f64],
    bounds: &[(f64, f64)],
) -> Option<Vec<f64>> {
    let d = u.len();
    let mut free: Vec<usize> = (0..d)
        .filter(|&k| {
            !((u[k] <= bounds[k].0 && gradient[k] > 0.0) || (u[k] >= bounds[k].1 && gradient[k] < 0.0))
        })
        .collect();
    for _ in 0..d {
        if free.is_empty() {
            return None;
        }
        let f = free.len();
        let mut h = DMatrix::from_fn(f, f, |i, j| hessian[(free[i], free[j])]);
        (0..f).for_each(|i| h[(i, i)] += damping * h[(i, i)].max(1e-6) + 1e-10);
        let g = DVector::from_fn(f, |i, _| -gradient[free[i]]);
        let step = h.cholesky()?.solve(&g);
        let mut next = u.to_vec();
        let mut blocked = None;
        for (i, &k) in free.iter().enumerate() {
            let target = u[k] + step[i].clamp(-LONGEST_STEP, LONGEST_STEP);
            if target < bounds[k].0 || target > bounds[k].1 {
                blocked.get_or_insert(i);
            }
            next[k] = target.clamp(bounds[k].0, bounds[k].1);
        }
        match blocked {
            // A coordinate already at its bound stays there and the others take a step of their own.
            Some(i) if u[free[i]] <= bounds[free[i]].0 || u[free[i]] >= bounds[free[i]].1 => {
                free.remove(i);
            }
            _ => return Some(next),
        }
    }
    None
}
