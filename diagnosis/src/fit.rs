//! Bounded least squares of one hypothesis on a table, in coordinates that are standard normal a priori.

use crate::data::RigFile;
use effects::{Active, Baseline, Design, Law, Parameter, Place, known, library};
use models::condition::Condition;
use models::rig_file::CertifiedKey;
use nalgebra::{DMatrix, DVector};

/// Deviation of the logarithm of mu0 a priori where the still passes give it, and where they do not.
const MU0_LOG_SD: (f64, f64) = (0.3, 0.8);
/// Certified deviations below this share of a law's own prior are taken as this: closer to exact than any table can tell,
/// and still a number to divide by.
const EXACT: f64 = 1e-6;
/// Number of baseline parameters: logarithms of mu0, normal and lateral stiffness.
pub const NUISANCES: usize = 3;

/// One member of a hypothesis: index of the effect among the known ones, and of its law.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Member {
    /// Index among [`known`] causes, the library first.
    pub effect: usize,
    /// Index of the law.
    pub law: usize,
}

impl Member {
    /// The law.
    pub fn form(&self) -> &'static Law {
        &known()[self.effect].laws()[self.law]
    }
    /// The law's parameters.
    pub fn parameters(&self) -> &'static [Parameter] {
        self.form().parameters
    }
    /// The effect's name.
    pub fn name(&self) -> &'static str {
        known()[self.effect].name()
    }
    /// Largest share of its change by which it may depart from its form.
    pub fn departs_by(&self) -> f64 {
        known()[self.effect].departs_by()
    }
    /// Where the effect sits.
    pub fn place(&self) -> Place {
        known()[self.effect].place()
    }
}

/// The data of a fit: passes, forces and their variances; a subset of a table where rows were left out.
#[derive(Debug, Clone)]
pub struct Problem {
    /// Conditions.
    pub passes: Vec<Condition>,
    /// Measured lateral forces, N.
    pub lateral: Vec<f64>,
    /// Variances of the lateral forces, N^2.
    pub variance: Vec<f64>,
    /// Scales of the table.
    pub design: Design,
    /// Baseline at the prior's centre.
    pub nominal: Baseline,
    /// Prior deviations of the logarithms of mu0, normal and lateral stiffness.
    pub prior_sd: [f64; NUISANCES],
    /// Certified deviations of effect sizes, by effect and law, in units of the law's own prior.
    pub certified: Vec<(Member, f64)>,
}

/// Instrument errors that no table of passes tells from another baseline, with the logarithmic change of the baseline's
/// parameters that each is. What a certificate leaves open of them is part of the recalibration; without a certificate the
/// instrument is taken at its word, and a pull of the stiffnesses is the only sign.
fn gains_within_the_baseline() -> impl Iterator<Item = (CertifiedKey, [f64; NUISANCES])> {
    library()
        .iter()
        .filter(|e| e.needs().iter().any(|n| n.is_standard()))
        .flat_map(|e| e.laws())
        .filter_map(|law| Some((law.certified_by?, law.acts_as?)))
}

impl Problem {
    /// The problem of a whole table.
    pub fn new(table: &crate::data::Table, rig: &RigFile) -> Self {
        let mu0 = table.still_coefficient();
        // Without still passes the largest friction seen is the best first word on mu0.
        let guess = mu0.unwrap_or_else(|| {
            table
                .passes
                .iter()
                .zip(&table.lateral)
                .map(|(p, l)| p.direction.sign() * l / p.normal_force_n)
                .fold(0.05, f64::max)
        });
        let sd = rig.finger.stiffness_relative_sd.max(1e-3);
        let mut certified = Vec::new();
        for (index, effect) in library().iter().enumerate() {
            for (law, form) in effect.laws().iter().enumerate() {
                if let (Some(sd), effects::Prior::Normal(wide) | effects::Prior::HalfNormal(wide)) =
                    (form.certified_by.and_then(|key| rig.calibration.sd(key)), form.parameters[0].prior)
                {
                    certified.push((Member { effect: index, law }, (sd / wide).clamp(EXACT, 1.0)));
                }
            }
        }
        let mut prior_sd = [if mu0.is_some() { MU0_LOG_SD.0 } else { MU0_LOG_SD.1 }, sd, sd];
        for (key, e_folds) in gains_within_the_baseline() {
            let open = rig.calibration.sd(key).unwrap_or(0.0);
            for (own, e_fold) in prior_sd.iter_mut().zip(e_folds) {
                *own = own.hypot(e_fold * open);
            }
        }
        Problem {
            passes: table.passes.clone(),
            lateral: table.lateral.clone(),
            variance: vec![1.0; table.len()],
            design: table.design,
            nominal: Baseline {
                mu0: guess,
                normal_stiffness_n_per_m: rig.finger.normal_stiffness_n_per_m,
                lateral_stiffness_n_per_m: rig.finger.lateral_stiffness_n_per_m,
            },
            prior_sd,
            certified,
        }
    }

    /// Number of passes.
    pub fn len(&self) -> usize {
        self.passes.len()
    }

    /// True without passes.
    pub fn is_empty(&self) -> bool {
        self.passes.is_empty()
    }

    /// The same problem on some of its rows.
    pub fn select(&self, rows: &[usize]) -> Self {
        Problem {
            passes: rows.iter().map(|&i| self.passes[i]).collect(),
            lateral: rows.iter().map(|&i| self.lateral[i]).collect(),
            variance: rows.iter().map(|&i| self.variance[i]).collect(),
            certified: self.certified.clone(),
            ..*self
        }
    }

    /// The same problem with other forces (of a fit, or simulated).
    pub fn with_lateral(&self, lateral: Vec<f64>) -> Self {
        Problem { lateral, ..self.clone() }
    }

    /// The baseline at coordinates.
    pub fn baseline(&self, u: &[f64]) -> Baseline {
        Baseline {
            mu0: self.nominal.mu0 * (self.prior_sd[0] * u[0]).exp(),
            normal_stiffness_n_per_m: self.nominal.normal_stiffness_n_per_m * (self.prior_sd[1] * u[1]).exp(),
            lateral_stiffness_n_per_m: self.nominal.lateral_stiffness_n_per_m
                * (self.prior_sd[2] * u[2]).exp(),
        }
    }

    /// Number of coordinates of a hypothesis.
    pub fn dimension(members: &[Member]) -> usize {
        NUISANCES + members.iter().map(|m| m.parameters().len()).sum::<usize>()
    }

    /// Bounds of the coordinates.
    pub fn bounds(&self, members: &[Member]) -> Vec<(f64, f64)> {
        let mut bounds = vec![(-40.0, 40.0); NUISANCES];
        for m in members {
            bounds.extend(m.parameters().iter().map(Parameter::coordinate_bounds));
        }
        bounds
    }

    /// Precision of the Gaussian prior of each coordinate; zero for a uniform one.
    pub fn prior_precision(&self, members: &[Member]) -> Vec<f64> {
        let mut list = vec![1.0; NUISANCES];
        for m in members {
            for (i, p) in m.parameters().iter().enumerate() {
                list.push(match p.prior {
                    effects::Prior::Uniform(..) => 0.0,
                    _ if i == 0 => 1.0 / self.certificate(m).powi(2),
                    _ => 1.0,
                });
            }
        }
        list
    }

    fn certificate(&self, member: &Member) -> f64 {
        self.certified.iter().find(|(m, _)| m == member).map_or(1.0, |(_, sd)| *sd)
    }

    /// Log prior density at coordinates.
    pub fn log_prior(&self, members: &[Member], u: &[f64]) -> f64 {
        let half_log_2pi = 0.918_938_533_204_672_8;
        let mut sum: f64 = u[..NUISANCES].iter().map(|x| -0.5 * x * x - half_log_2pi).sum();
        let mut at = NUISANCES;
        for m in members {
            for (i, p) in m.parameters().iter().enumerate() {
                let sd = if i == 0 { self.certificate(m) } else { 1.0 };
                sum += p.log_prior(u[at] / sd) - sd.ln();
                at += 1;
            }
        }
        sum
    }

    /// Parameters in the laws' own units.
    pub fn thetas(members: &[Member], u: &[f64]) -> Vec<Vec<f64>> {
        let mut at = NUISANCES;
        members
            .iter()
            .map(|m| {
                m.parameters()
                    .iter()
                    .map(|p| {
                        at += 1;
                        p.value(u[at - 1])
                    })
                    .collect()
            })
            .collect()
    }

    /// Predicted lateral forces, N.
    pub fn predict(&self, members: &[Member], u: &[f64]) -> DVector<f64> {
        self.predict_at(members, u, &self.passes)
    }

    /// Predicted lateral forces at other conditions, N.
    pub fn predict_at(&self, members: &[Member], u: &[f64], passes: &[Condition]) -> DVector<f64> {
        let baseline = self.baseline(u);
        let thetas = Self::thetas(members, u);
        // Effects act in the library's order, whatever the order of the hypothesis.
        let mut order: Vec<usize> = (0..members.len()).collect();
        order.sort_by_key(|&k| members[k]);
        let active: Vec<Active<'_>> = order
            .into_iter()
            .map(|k| Active { effect: known()[members[k].effect], law: members[k].law, theta: &thetas[k] })
            .collect();
        DVector::from_iterator(
            passes.len(),
            passes.iter().map(|p| effects::lateral_force(&baseline, &active, p, &self.design)),
        )
    }

    /// Derivatives of the predictions by the coordinates, by differences into the feasible side.
    pub fn jacobian(&self, members: &[Member], u: &[f64], at: &DVector<f64>) -> DMatrix<f64> {
        let bounds = self.bounds(members);
        let mut jacobian = DMatrix::zeros(self.len(), u.len());
        let mut moved = u.to_vec();
        for k in 0..u.len() {
            let size = if k < NUISANCES { 1e-3 } else { 2e-3 };
            let step = if u[k] + size > bounds[k].1 { -size } else { size };
            moved[k] = u[k] + step;
            let there = self.predict(members, &moved);
            moved[k] = u[k];
            jacobian.set_column(k, &((there - at) / step));
        }
        jacobian
    }
}

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
pub fn minimise(
    problem: &Problem,
    members: &[Member],
    start: &[f64],
    variance: &[f64],
    rounds: usize,
) -> Fit {
    let bounds = problem.bounds(members);
    let precision = problem.prior_precision(members);
    let n = problem.len();
    let cost_of = |u: &[f64], m: &DVector<f64>| -> f64 {
        let misfit: f64 = (0..n).map(|i| (problem.lateral[i] - m[i]).powi(2) / variance[i]).sum();
        misfit + u.iter().zip(&precision).map(|(x, p)| p * x * x).sum::<f64>()
    };
    let mut u: Vec<f64> = start.iter().zip(&bounds).map(|(x, b)| x.clamp(b.0, b.1)).collect();
    let mut m = problem.predict(members, &u);
    let mut cost = cost_of(&u, &m);
    let mut damping = 1e-2;
    for _ in 0..rounds {
        let jacobian = problem.jacobian(members, &u, &m);
        let (hessian, gradient) = normal_equations(problem, &jacobian, &m, variance, &precision, &u);
        let mut improved = false;
        for _ in 0..6 {
            let Some(next) = bounded_step(&hessian, &gradient, damping, &u, &bounds) else { break };
            let there = problem.predict(members, &next);
            let value = cost_of(&next, &there);
            if value < cost {
                let gain = cost - value;
                (u, m, cost) = (next, there, value);
                damping = (damping * 0.2).max(1e-9);
                improved = gain > 1e-3 * (1.0 + 1e-4 * cost);
                break;
            }
            damping *= 6.0;
        }
        if !improved {
            break;
        }
    }
    Fit { u, prediction: m, cost }
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

/// A damped Gauss-Newton step that stays within the bounds; coordinates pushed against a bound are held.
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
        for i in 0..f {
            h[(i, i)] += damping * h[(i, i)].max(1e-6) + 1e-10;
        }
        let g = DVector::from_fn(f, |i, _| -gradient[free[i]]);
        let step = h.cholesky()?.solve(&g);
        let mut next = u.to_vec();
        let mut blocked = None;
        for (i, &k) in free.iter().enumerate() {
            let target = u[k] + step[i].clamp(-3.0, 3.0);
            if target < bounds[k].0 || target > bounds[k].1 {
                blocked.get_or_insert(i);
            }
            next[k] = target.clamp(bounds[k].0, bounds[k].1);
        }
        match blocked {
            // A coordinate already at its bound is held and the others take a step of their own.
            Some(i) if u[free[i]] <= bounds[free[i]].0 || u[free[i]] >= bounds[free[i]].1 => {
                free.remove(i);
            }
            _ => return Some(next),
        }
    }
    None
}
