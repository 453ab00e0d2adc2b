//! Parameter intervals by profile likelihood, with their shape. docs/diagnosis/model.md, section 10.

use crate::regression::{
    Basis, Covariance, Layout, Member, NUISANCES, Posterior, Problem, bounded_step, equations,
};
use effects::Parameter;
use nalgebra::DVector;
use serde::Serialize;
use std::ops::Range;

/// Shape of a profile.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ProfileShape {
    /// Both ends are inside the parameter's range.
    Bounded,
    /// One end only.
    OneSided,
    /// The fall never reaches either end.
    Flat,
    /// The table adds nothing to what was assumed: value and interval are the prior's.
    Prior,
}

/// A parameter with its interval.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Estimate {
    /// Name.
    pub name: &'static str,
    /// Most probable value.
    pub value: f64,
    /// 95 % interval of the library's form.
    pub ci95: [f64; 2],
    /// Unit.
    pub unit: &'static str,
    /// Shape of the interval.
    pub shape: ProfileShape,
}

/// Fall of twice the log posterior that bounds a 95 % interval: that quantile of chi2 with one degree of freedom.
const FALL: f64 = 3.841;
/// Deviations of a normal that bound 95 %.
const NORMAL_95: f64 = 1.96;

/// Profiles every parameter of the hypothesis.
pub fn estimates(problem: &Problem, best: &Posterior, basis: &Basis) -> Vec<Vec<Estimate>> {
    let covariance = problem.covariance(&best.change.columns(basis, best.freedom.share));
    let precision = problem.prior_precision(&best.members);
    let profiles = Profiles { problem, best, covariance, precision: &precision };
    let floor = profiles.cost(&best.u, &best.prediction);
    let one = |(p, k): (Parameter, usize)| {
        let bounds = p.coordinate_bounds();
        let [low, high] = [-1.0, 1.0].map(|side| profiles.end(floor, k, side, bounds));
        let shape = match (low, high) {
            _ if assumed(problem, best, &precision, k) => ProfileShape::Prior,
            (Some(_), Some(_)) => ProfileShape::Bounded,
            (None, None) => ProfileShape::Flat,
            _ => ProfileShape::OneSided,
        };
        let at = |end: Option<f64>, bound: f64| p.value(end.filter(|u| !u.is_nan()).unwrap_or(bound));
        let ci95 = [at(low, bounds.0), at(high, bounds.1)];
        Estimate { name: p.name, value: p.value(best.u[k]), ci95, unit: p.unit, shape }
    };
    let own = |(member, places): (&Member, Range<usize>)| -> Vec<Estimate> {
        member.parameters(&problem.design).into_iter().zip(places).map(one).collect()
    };
    best.members.iter().zip(Layout::of(&best.members).members()).map(own).collect()
}

/// Intervals from the curvature at the mode, for hypotheses that do not lead.
pub fn curvature(problem: &Problem, e: &Posterior) -> Vec<Estimate> {
    let parameters = e.members.iter().flat_map(|m| m.parameters(&problem.design));
    let precision = problem.prior_precision(&e.members);
    parameters
        .zip(NUISANCES..)
        .map(|(p, at)| {
            let u = e.u[at];
            let reach = NORMAL_95 * e.covariance[(at, at)].max(0.0).sqrt();
            let (low, high) = p.coordinate_bounds();
            Estimate {
                name: p.name,
                value: p.value(u),
                ci95: [p.value((u - reach).max(low)), p.value((u + reach).min(high))],
                unit: p.unit,
                shape: match u - reach < low || u + reach > high {
                    _ if assumed(problem, e, &precision, at) => ProfileShape::Prior,
                    true => ProfileShape::OneSided,
                    false => ProfileShape::Bounded,
                },
            }
        })
        .collect()
}

/// Whether the table hardly narrows the prior of a coordinate.
fn assumed(problem: &Problem, e: &Posterior, precision: &[f64], k: usize) -> bool {
    1.0 - e.covariance[(k, k)] * precision[k] < problem.constants.least_contraction
}

/// A hypothesis whose coordinates are profiled.
struct Profiles<'a> {
    problem: &'a Problem,
    best: &'a Posterior,
    covariance: Covariance,
    precision: &'a [f64],
}

impl Profiles<'_> {
    fn cost(&self, u: &[f64], m: &DVector<f64>) -> f64 {
        let y = DVector::from_column_slice(&self.problem.lateral);
        self.covariance.quadratic(&(y - m))
            + u.iter().zip(self.precision).map(|(x, p)| p * x * x).sum::<f64>()
    }

    /// The coordinate at which the profile has fallen by [`FALL`]; `None` where it never does within bounds.
    fn end(&self, floor: f64, k: usize, side: f64, bounds: (f64, f64)) -> Option<f64> {
        let best = self.best;
        let sd = best.covariance[(k, k)].max(1e-16).sqrt();
        let limit = if side < 0.0 { best.u[k] - bounds.0 } else { bounds.1 - best.u[k] };
        if limit <= 0.0 {
            return None;
        }
        let mut start = best.u.clone();
        let mut fall = |distance: f64| -> f64 {
            let (u, value) = self.profile(&start, k, best.u[k] + side * distance);
            start = u;
            value - floor
        };
        let (mut near, mut far) = (0.0, (NORMAL_95 * sd).min(limit));
        let mut value = fall(far);
        while value < FALL {
            if far >= limit {
                return None;
            }
            near = far;
            far = (far * 1.7 + 1e-6).min(limit);
            value = fall(far);
        }
        let mut at_far = value.sqrt();
        let mut at_near = if near == 0.0 { 0.0 } else { fall(near).max(0.0).sqrt() };
        let goal = FALL.sqrt();
        // The root of the fall is nearly straight: a few secants suffice.
        let mut x = far;
        for _ in 0..4 {
            x = near + (far - near) * (goal - at_near) / (at_far - at_near).max(1e-9);
            let root = fall(x).max(0.0).sqrt();
            if (root - goal).abs() < 0.02 {
                break;
            }
            if root > goal {
                (far, at_far) = (x, root);
            } else {
                (near, at_near) = (x, root);
            }
        }
        Some(best.u[k] + side * x)
    }

    /// Best cost with one coordinate fixed, by Gauss-Newton in the others.
    fn profile(&self, start: &[f64], k: usize, value_at: f64) -> (Vec<f64>, f64) {
        let Profiles { problem, best, covariance, precision } = self;
        let mut bounds = problem.bounds(&best.members);
        bounds[k] = (value_at, value_at);
        let mut u = start.to_vec();
        u[k] = value_at;
        let y = DVector::from_column_slice(&problem.lateral);
        let mut m = problem.predict(&best.members, &u);
        let mut value = self.cost(&u, &m);
        for _ in 0..4 {
            let mut jacobian = problem.jacobian(&best.members, &u, &m);
            jacobian.column_mut(k).fill(0.0);
            let (mut hessian, gradient) = equations(covariance, &jacobian, &(&y - &m), precision, &u);
            // What a uniform prior does not bound stays finite.
            (0..u.len()).filter(|i| precision[*i] == 0.0).for_each(|i| hessian[(i, i)] += 1e-9);
            let Some(mut next) = bounded_step(&hessian, &gradient, 1e-6, &u, &bounds) else { break };
            next[k] = value_at;
            let mut there = problem.predict(&best.members, &next);
            let mut v = self.cost(&next, &there);
            // A step that goes too far is no end of the way: an interval that stops there is too narrow.
            for _ in 0..3 {
                if v < value {
                    break;
                }
                next.iter_mut().zip(&u).for_each(|(next, u)| *next = 0.5 * (*next + u));
                there = problem.predict(&best.members, &next);
                v = self.cost(&next, &there);
            }
            if v >= value - 1e-3 {
                if v < value {
                    (u, value) = (next, v);
                }
                break;
            }
            (u, m, value) = (next, there, v);
        }
        (u, value)
    }
}
