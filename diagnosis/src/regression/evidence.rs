//! The evidence of a hypothesis of which the form is not exact. docs/diagnosis/model.md, section 7.
//!
//! `y = m(phi, theta) + s D delta + noise`: D is the effect's change net of what recalibrating the baseline
//! could imitate, delta a smooth Gaussian process of unit variance over the operating space, s on a grid.
//! The integral over the parameters is Laplace's, with the half-line of a size that cannot be negative.

use crate::constants::Constants;
use crate::regression::{
    Basis, Bends, Change, Covariance, Freedom, HALF_LN_2PI, Layout, Member, NUISANCES, Problem, bounded_step,
    carry, log_sum_exp,
};
use effects::Prior;
use nalgebra::{DMatrix, DVector};
use statrs::function::erf::erfc;

/// Rounds of the search for a mode, at the three shares of form uncertainty.
const MODE_ROUNDS: [usize; 3] = [4, 6, 3];
/// Damping of that search: at the start, factors after a step that helps and one that does not, bounds.
const DAMPING: f64 = 1e-3;
const EASED: f64 = 0.1;
const STIFFENED: f64 = 20.0;
const DAMPING_BOUNDS: [f64; 2] = [1e-9, 1e6];
/// Dampings that one round tries.
const TRIALS: usize = 4;
/// Gain in minus twice the log posterior below which a mode is found.
const CONVERGED: f64 = 0.05;
/// Deviations below which the tail of a Gaussian is taken by Mills' ratio.
const MILLS: f64 = -6.0;

/// One hypothesis at the mode of its posterior, with Laplace's approximation about it, at one share of form
/// uncertainty.
#[derive(Clone)]
pub struct Posterior {
    /// Members and their laws.
    pub members: Vec<Member>,
    /// Coordinates.
    pub u: Vec<f64>,
    /// How far it may depart from its form.
    pub freedom: Freedom,
    /// Log evidence.
    pub log_evidence: f64,
    /// Prediction of the form itself, N.
    pub prediction: DVector<f64>,
    /// Prediction of the mechanism, N: the form with what is bent.
    pub mechanism: DVector<f64>,
    /// The effects' change net of recalibration, and what is bent.
    pub change: Change,
    /// Posterior covariance of the coordinates.
    pub covariance: DMatrix<f64>,
    /// Weights of the departure from the form, on its columns ([`Change::columns`]).
    pub departure: DVector<f64>,
    /// The same law where nothing is bent; none where it is so already. See [`Posterior::by_law`].
    pub plain: Option<Box<Posterior>>,
}

impl Posterior {
    /// The hypothesis by its law: parameters that a rig can use, where the bent one has a function beside
    /// them.
    pub fn by_law(&self) -> &Posterior {
        self.plain.as_deref().unwrap_or(self)
    }

    /// The departure from the form at the passes of the fit, N.
    pub fn departure_n(&self, basis: &Basis) -> DVector<f64> {
        self.change.columns(basis, self.freedom.share) * &self.departure
    }

    /// chi2 by which mu0 and the stiffnesses are pulled from their calibration.
    pub fn pull(&self) -> f64 {
        self.u[..NUISANCES].iter().map(|x| x * x).sum()
    }
}

/// Where a fit stands: coordinates, prediction, change and covariance there, minus twice the log density.
struct Mode {
    u: Vec<f64>,
    m: DVector<f64>,
    change: Change,
    covariance: Covariance,
    cost: f64,
}

/// The mode under the covariance of one freedom, sought from `start`, and the Jacobian there.
fn mode(
    problem: &Problem,
    members: &[Member],
    start: &[f64],
    basis: &Basis,
    freedom: Freedom,
    rounds: usize,
) -> (Mode, DMatrix<f64>) {
    let bounds = problem.bounds(members);
    let precision = problem.prior_precision(members);
    let y = DVector::from_column_slice(&problem.lateral);
    let at = |u: Vec<f64>| {
        let m = problem.predict(members, &u);
        let change = Change::by(problem, members, &u, &m, basis, freedom);
        let covariance = problem.covariance(&change.columns(basis, freedom.share));
        let penalty: f64 = u.iter().zip(&precision).map(|(x, p)| p * x * x).sum();
        let cost = covariance.quadratic(&(&y - &m)) + covariance.log_det + penalty;
        Mode { u, m, change, covariance, cost }
    };
    let mut here = at(start.to_vec());
    let mut damping = DAMPING;
    let mut jacobian = problem.jacobian(members, &here.u, &here.m);
    // Whether the Jacobian is that of this place; every second one is carried along with the step.
    let mut own = true;
    for round in 0..rounds {
        let residual = &y - &here.m;
        let (hessian, gradient) = equations(&here.covariance, &jacobian, &residual, &precision, &here.u);
        let (mut gained, exact) = (0.0, own);
        for _ in 0..TRIALS {
            let Some(next) = bounded_step(&hessian, &gradient, damping, &here.u, &bounds) else { break };
            let there = at(next);
            if there.cost < here.cost {
                gained = here.cost - there.cost;
                carry(&mut jacobian, &here.u, &there.u, &(&there.m - &here.m));
                (here, own) = (there, false);
                damping = (damping * EASED).max(DAMPING_BOUNDS[0]);
                break;
            }
            damping = (damping * STIFFENED).min(DAMPING_BOUNDS[1]);
        }
        let found = gained < CONVERGED;
        if found && exact {
            break;
        }
        if found || round % 2 == 1 {
            (jacobian, own) = (problem.jacobian(members, &here.u, &here.m), true);
        }
    }
    if !own {
        jacobian = problem.jacobian(members, &here.u, &here.m);
    }
    (here, jacobian)
}

/// Improves a fit under the covariance of one freedom and gives its evidence. `members` may be empty (no
/// gap): then there is no form uncertainty.
pub fn laplace(
    problem: &Problem,
    members: &[Member],
    start: &[f64],
    basis: &Basis,
    freedom: Freedom,
    rounds: usize,
) -> Posterior {
    let (Mode { u, m, change, covariance, .. }, jacobian) =
        mode(problem, members, start, basis, freedom, rounds);
    let (n, bounds) = (problem.len(), problem.bounds(members));
    let residual = DVector::from_column_slice(&problem.lateral) - &m;
    let precision = problem.prior_precision(members);
    let (mut hessian, gradient) = equations(&covariance, &jacobian, &residual, &precision, &u);
    // A uniform prior bounds the integral where the data say nothing: a Gaussian of its own variance stands
    // for it. Without, a shape that nothing depends on (an exponent, at size zero) would count with an
    // endless volume.
    let parameters = members.iter().flat_map(|member| member.parameters(&problem.design));
    for (k, parameter) in parameters.enumerate().map(|(k, p)| (k + NUISANCES, p)) {
        if let Prior::Uniform(..) = parameter.prior {
            hessian[(k, k)] += 12.0 / (bounds[k].1 - bounds[k].0).powi(2);
        }
    }
    let log_2pi = 1.837_877_066_409_345_3;
    let d = u.len() as f64;
    let mut log_evidence = -0.5 * (covariance.quadratic(&residual) + covariance.log_det + n as f64 * log_2pi)
        + problem.log_prior(members, &u)
        + 0.5 * d * log_2pi;
    let posterior = match hessian.clone().cholesky() {
        Some(factor) => {
            log_evidence -= factor.l_dirty().diagonal().iter().map(|x| x.ln()).sum::<f64>();
            factor.inverse()
        }
        None => {
            log_evidence = f64::NEG_INFINITY;
            DMatrix::identity(u.len(), u.len())
        }
    };
    let layout = Layout::of(members);
    for (index, member) in members.iter().enumerate() {
        let at = layout.size(index);
        if let Prior::HalfNormal(_) = member.parameters(&problem.design)[0].prior {
            // At the bound the optimum may lie beyond: the quadratic is integrated over the half line.
            let sd = posterior[(at, at)].sqrt();
            let beyond = if u[at] <= bounds[at].0 { gradient[at].max(0.0) * sd } else { 0.0 };
            log_evidence += log_half_line(u[at] / sd, beyond);
        }
    }
    // The departure's columns come before those of what passes have in common.
    let weights = covariance.weights(&residual);
    let departure = weights.rows(0, weights.len() - problem.common.ncols()).into_owned();
    let bent = change.columns(basis, 0.0);
    let mechanism = &m + &bent * departure.rows(0, bent.ncols());
    Posterior {
        members: members.to_vec(),
        u,
        freedom,
        log_evidence,
        prediction: m,
        mechanism,
        change,
        covariance: posterior,
        departure,
        plain: None,
    }
}

/// `ln` of the integral of a unit Gaussian with slope `beyond` over the half line from `-reach`.
fn log_half_line(reach: f64, beyond: f64) -> f64 {
    let z = reach - beyond;
    // ln(exp(b^2/2) Phi(z)); for large b the two nearly cancel: Mills' ratio.
    if z < MILLS {
        0.5 * beyond * beyond - 0.5 * z * z - (-z).ln() - HALF_LN_2PI - (1.0 / (z * z))
    } else {
        0.5 * beyond * beyond + (0.5 * erfc(-z / std::f64::consts::SQRT_2)).max(1e-300).ln()
    }
}

/// Curvature and gradient of half the cost, prior included.
pub(crate) fn equations(
    covariance: &Covariance,
    jacobian: &DMatrix<f64>,
    residual: &DVector<f64>,
    precision: &[f64],
    u: &[f64],
) -> (DMatrix<f64>, DVector<f64>) {
    let d = u.len();
    let mut joined = jacobian.clone().insert_columns(d, 1, 0.0);
    joined.set_column(d, residual);
    let all = covariance.inner(&joined, &joined);
    let mut hessian = all.view((0, 0), (d, d)).into_owned();
    (0..d).for_each(|k| hessian[(k, k)] += precision[k]);
    let gradient = DVector::from_fn(d, |k, _| -all[(k, d)] + precision[k] * u[k]);
    (hessian, gradient)
}

/// Largest share by which a hypothesis may depart from its form. Of two causes the stricter one sets it: else
/// a companion that does nothing frees the other.
fn largest_share(members: &[Member]) -> f64 {
    members.iter().map(Member::departs_by).fold(f64::INFINITY, f64::min)
}

/// Freedom with which laws are compared before the others are tried.
pub fn middle_freedom(k: &Constants, members: &[Member]) -> Freedom {
    Freedom::share(k.form_shares[1].min(largest_share(members)))
}

/// Evidence of a hypothesis averaged over its freedoms, with the best one's solution, sought from `start`.
pub fn averaged_over_form(
    problem: &Problem,
    start: &[f64],
    members: &[Member],
    basis: &Basis,
) -> (f64, Posterior) {
    if members.is_empty() {
        let e = laplace(problem, members, start, basis, Freedom::NONE, MODE_ROUNDS[0]);
        return (e.log_evidence, e);
    }
    let most = largest_share(members);
    let k = &problem.constants;
    let [small, medium, large] = k.form_shares;
    let [first, second, third] = MODE_ROUNDS;
    let middle = laplace(problem, members, start, basis, middle_freedom(k, members), second);
    let from = |freedom: Freedom, rounds: usize| laplace(problem, members, &middle.u, basis, freedom, rounds);
    let [one, two, three, four, five] = k.form_weights;
    let mut list = vec![(from(Freedom::share(small), first), one)];
    if most >= large {
        list.push((from(Freedom::share(large), third), three));
    }
    for (bends, weight) in [(Bends::Input, four), (Bends::Size, five)] {
        if basis.bends(members, bends) {
            let bent = Freedom { share: middle.freedom.share, bend: k.bend_share, bends };
            list.push((from(bent, second), weight));
        }
    }
    if most >= medium {
        list.push((middle, two));
    }
    let weights: f64 = list.iter().map(|(_, w)| w).sum();
    let weighted: Vec<f64> = list.iter().map(|(e, w)| e.log_evidence + (w / weights).ln()).collect();
    let total = log_sum_exp(&weighted);
    let best =
        (0..list.len()).max_by(|&a, &b| weighted[a].total_cmp(&weighted[b])).expect("at least one share");
    let plain = (0..list.len())
        .filter(|&i| list[i].0.freedom.bend == 0.0)
        .max_by(|&a, &b| weighted[a].total_cmp(&weighted[b]))
        .filter(|_| list[best].0.freedom.bend > 0.0)
        .map(|i| Box::new(list[i].0.clone()));
    (total, Posterior { plain, ..list.swap_remove(best).0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::regression::{Kernels, minimise};
    use crate::tests::{Deviates, rig, table};

    /// Without a gap a law can gain no more than its best size does: at size zero its shapes change nothing,
    /// and a volume that nothing limits must not count for it.
    #[test]
    fn a_law_without_effect_gains_nothing() {
        let table = table(&mut Deviates(11), 0.0);
        let mut problem = Problem::new(&table, &rig(), &Default::default());
        crate::scatter::noise::settle(&table, &rig(), &mut problem, &crate::scatter::Belief::ByResidual);
        let all: Vec<usize> = (0..effects::library().len()).collect();
        let basis = Kernels::on(&problem, &table, &all).at(&problem.passes);
        let none = minimise(&problem, &[], &[0.0; NUISANCES], &problem.variance, 15);
        let none = laplace(&problem, &[], &none.u, &basis, Freedom::NONE, 4);
        let mut tried = 0;
        for effect in 0..effects::library().len() {
            for law in 0..effects::library()[effect].laws.len() {
                let member = Member { effect, law };
                // Sizes at or near zero, shapes at an end of their range: where a fit without a gap may rest.
                for (size, end) in [(0.0, false), (0.0, true), (1e-3, false), (1e-3, true)] {
                    let mut u = none.u.clone();
                    for (i, p) in member.parameters(&problem.design).iter().enumerate() {
                        let (low, high) = p.coordinate_bounds();
                        u.push(if i == 0 {
                            low.max(0.0) + size
                        } else if end {
                            high
                        } else {
                            low
                        });
                    }
                    let k = &problem.constants;
                    let freedom = Freedom { bend: k.bend_share, ..Freedom::share(k.form_shares[1]) };
                    let with = laplace(&problem, &[member], &u, &basis, freedom, 0);
                    let gain = with.log_evidence - none.log_evidence;
                    let name = (effects::library()[effect].name, effects::library()[effect].laws[law].name);
                    assert!(gain.is_finite() && gain < 3.0, "{name:?}: {gain:.1} nats");
                    tried += 1;
                }
            }
        }
        assert!(tried > 200, "{tried}");
    }
}
