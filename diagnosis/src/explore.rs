//! Global starts: a coarse scan of each law over its sizes and shapes, then local fits of the best few.

use crate::fit::{Fit, Member, NUISANCES, Problem, minimise};
use crate::linear::Covariance;
use effects::{Parameter, Prior};
use nalgebra::{DMatrix, DVector};

/// Rows that the scan looks at.
const SCAN_ROWS: usize = 160;
/// Starts that are fitted on the scan's rows, and those of them refined on all.
const STARTS: (usize, usize) = (4, 2);

/// Sizes and shapes at which a law is tried.
fn grid(parameters: &[Parameter], stroke: f64) -> Vec<Vec<f64>> {
    let mut list: Vec<Vec<f64>> = vec![Vec::new()];
    let fine = parameters.iter().any(|p| is_wavelength(p));
    for p in parameters {
        let (low, high) = p.coordinate_bounds();
        let values: Vec<f64> = match p.prior {
            Prior::HalfNormal(_) if fine => vec![0.4, 1.5],
            Prior::HalfNormal(_) => vec![0.04, 0.12, 0.35, 0.9, 2.0, 4.5],
            Prior::Normal(_) => vec![-3.0, -1.2, -0.4, -0.1, 0.1, 0.4, 1.2, 3.0],
            Prior::LogNormal(..) => vec![-2.0, -1.0, 0.0, 1.0, 2.0],
            Prior::Uniform(a, b) if is_wavelength(p) => {
                // Two wavelengths differ on a stroke if they differ by half a period over it.
                let step = 0.4 / stroke.max(1e-4);
                let count = (((1.0 / a - 1.0 / b) / step).ceil() as usize).clamp(4, 240);
                (0..=count)
                    .map(|i| p.coordinate(1.0 / (1.0 / b + (1.0 / a - 1.0 / b) * i as f64 / count as f64)))
                    .collect()
            }
            // A phase is cyclic over the unit interval inside its bounds.
            Prior::Uniform(..) if fine => [0.0, 0.2, 0.4, 0.6, 0.8].map(|x| p.coordinate(x)).to_vec(),
            Prior::Uniform(..) => vec![-2.4, -1.2, 0.0, 1.2, 2.4],
        };
        let values: Vec<f64> = values.into_iter().filter(|v| *v >= low && *v <= high).collect();
        list = list
            .iter()
            .flat_map(|head| {
                values.iter().map(|v| {
                    let mut row = head.clone();
                    row.push(*v);
                    row
                })
            })
            .collect();
    }
    list
}

fn is_wavelength(p: &Parameter) -> bool {
    p.unit == "m" && matches!(p.prior, Prior::Uniform(..))
}

/// Local optima of the last member's parameters beside the given coordinates of the others, best first.
///
/// `held` are the coordinates of nuisances and of all members but the last; `variance` may be tempered.
pub fn optima(problem: &Problem, members: &[Member], held: &[f64], variance: &[f64]) -> Vec<Fit> {
    let Some(last) = members.last() else {
        return vec![minimise(problem, members, held, variance, 20)];
    };
    let parameters = last.parameters();
    let fine = parameters.iter().any(is_wavelength);
    let n = problem.len();
    let limit = if fine { n } else { SCAN_ROWS };
    let stride = n.div_ceil(limit).max(1);
    let rows: Vec<usize> = (0..n).step_by(stride).collect();
    let part = problem.select(&rows);
    let part_variance: Vec<f64> = rows.iter().map(|&i| variance[i]).collect();
    // Nuisances (and the other members) follow linearly while the scan walks.
    let others = &members[..members.len() - 1];
    let origin = part.predict(others, held);
    let jacobian = part.jacobian(others, held, &origin);
    let plain = Covariance::new(&part_variance, &DMatrix::zeros(rows.len(), 0));
    let mut hessian = plain.inner(&jacobian, &jacobian);
    for (k, p) in problem.prior_precision(others).iter().enumerate() {
        hessian[(k, k)] += p.max(1e-9);
    }
    let Some(factor) = hessian.cholesky() else { return Vec::new() };
    let mut weighted = jacobian.clone();
    for (i, v) in part_variance.iter().enumerate() {
        weighted.row_mut(i).scale_mut(1.0 / *v);
    }
    let project = weighted.transpose();
    let y = DVector::from_column_slice(&part.lateral);
    let mut scored: Vec<(f64, Vec<f64>)> = grid(parameters, problem.design.stroke_m)
        .into_iter()
        .map(|tail| {
            let mut u = held.to_vec();
            u.extend(&tail);
            let residual = &y - part.predict(members, &u);
            let score = &project * &residual;
            let step = factor.solve(&score);
            let cost: f64 = residual.iter().zip(&part_variance).map(|(r, v)| r * r / v).sum::<f64>()
                - score.dot(&step);
            for (k, s) in step.iter().enumerate() {
                u[k] += s.clamp(-2.0, 2.0);
            }
            (cost, u)
        })
        .collect();
    scored.sort_by(|a, b| a.0.total_cmp(&b.0));
    // Starts that differ: in the size's sign, or by more than one step of any shape.
    let mut starts: Vec<&Vec<f64>> = Vec::new();
    for (_, u) in &scored {
        let fresh = starts.iter().all(|s| {
            (held.len()..u.len()).any(|k| (u[k] - s[k]).abs() > if k == held.len() { 0.8 } else { 0.5 })
        });
        if fresh {
            starts.push(u);
        }
        if starts.len() == STARTS.0 {
            break;
        }
    }
    let mut fits: Vec<Fit> =
        starts.into_iter().map(|u| minimise(&part, members, u, &part_variance, 12)).collect();
    fits.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    let best = fits.first().map_or(0.0, |f| f.cost);
    fits.retain(|f| f.cost < 1.3 * best + 10.0);
    fits.truncate(STARTS.1);
    let mut whole: Vec<Fit> = fits.iter().map(|f| minimise(problem, members, &f.u, variance, 8)).collect();
    whole.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    whole
}

/// Variances with a floor of `share` of a residual gap: starts are sought on what the gap looks like at large,
/// not on its last per cent.
pub fn tempered(problem: &Problem, gap: &DVector<f64>, share: f64) -> Vec<f64> {
    problem.variance.iter().zip(gap.iter()).map(|(v, g)| v + (share * g).powi(2)).collect()
}

/// Coordinates of a baseline fit followed by nothing: where a single effect starts from.
pub fn held_nuisances(fit: &Fit) -> Vec<f64> {
    fit.u[..NUISANCES].to_vec()
}
