//! What the noise-free forces of a labelled set say: how far its cause is from the library, and what imitates it.
//!
//! A set is decidable if nothing else comes within a chi2 of 10 of the truth, by its law alone (the pull of
//! the nuisances counted) or with form uncertainty (twice the difference of the expected log likelihoods).
//! The truth's own law is granted no miss. Sizes, shapes and stiffnesses are those that the program finds on
//! noise-free forces, refitted with the stated deviations: an imitator that it does not find is not counted.

use diagnosis::data::{RigFile, Table};
use diagnosis::hypotheses::fitted::Fitted;
use diagnosis::hypotheses::{Options, fit_all};
use diagnosis::regression::evidence::Posterior;
use diagnosis::regression::layout::NUISANCES;
use diagnosis::regression::least_squares::minimise;
use models::Pass;
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;

/// chi2 within which two causes are not told apart (docs/contract.md, aliases).
const ALIKE: f64 = 10.0;
const ROUNDS: usize = 16;

/// The forces of one pass as they would be read without noise.
#[derive(Deserialize)]
pub struct NoiseFree {
    point: u64,
    lateral_force_n: f64,
    normal_force_n: f64,
}

/// A cause or pair, and how near it comes.
#[derive(Serialize)]
pub struct Imitator {
    names: Vec<String>,
    /// chi2 that the best of its laws leaves, with the pull of the nuisances.
    left: f64,
    /// The same where both may depart from their forms, against the truth.
    behind: f64,
}

/// What noise-free forces say.
#[derive(Serialize)]
pub struct Oracle {
    /// Root of the share of the gap's chi2 that the nearest law of the cause's name leaves, the pull of the
    /// nuisances counted.
    pub distance: f64,
    /// The nearest that lack one of the causes, nearest first.
    pub imitators: Vec<Imitator>,
}

impl Oracle {
    /// Whether nothing else comes within a chi2 of 10.
    pub fn decidable(&self) -> bool {
        self.imitators.iter().all(|i| i.left >= ALIKE && i.behind >= ALIKE)
    }
}

/// The set without noise, and what the library makes of it; none where the cause's name was not tried.
pub fn oracle(
    passes: &[Pass],
    clean: &[NoiseFree],
    rig: &RigFile,
    truth: &[String],
    base: &Options,
) -> Option<Oracle> {
    let forces: BTreeMap<u64, &NoiseFree> = clean.iter().map(|c| (c.point, c)).collect();
    let mut passes = passes.to_vec();
    for p in &mut passes {
        let own = forces.get(&p.point)?;
        p.lateral_force_n = Some(own.lateral_force_n);
        p.normal_force_n = own.normal_force_n;
    }
    let table = Table::measured(&passes).ok()?;
    let mut options = Options { pairs: truth.len() > 1, ..base.clone() };
    // A pair that leaves less than noise would is fitted too.
    Arc::make_mut(&mut options.constants).set("misfit_sd", "-1000").ok()?;
    let mut fitted = fit_all(&table, rig, &options);
    stated(&mut fitted, rig);
    let nothing = minimise(&fitted.problem, &[], &fitted.baseline.u, &fitted.problem.variance, ROUNDS);
    let gap = fitted.problem.misfit(&nothing.prediction);
    let mut all: BTreeMap<Vec<String>, (f64, f64, f64)> = BTreeMap::new();
    for candidate in &fitted.candidates {
        let mut names: Vec<String> = candidate.names().iter().map(|n| (*n).to_string()).collect();
        names.sort_unstable();
        let laws = candidate.laws.iter().map(|(_, law)| law).chain([&candidate.best]);
        for law in laws {
            let [left, pull, penalty, free] = nearest(&fitted, law.by_law());
            let own = all.entry(names.clone()).or_insert([f64::INFINITY; 3].into());
            *own = (own.0.min(left + pull), own.1.min(penalty), own.2.min(free));
        }
    }
    let (left, own_penalty, _) = *all.get(truth)?;
    let others = all.iter().filter(|(names, _)| !truth.iter().all(|t| names.contains(t)));
    let mut imitators: Vec<Imitator> = others
        .map(|(names, (left, _, free))| Imitator {
            names: names.clone(),
            left: *left,
            behind: free - own_penalty,
        })
        .collect();
    imitators.sort_by(|a, b| a.left.min(a.behind).total_cmp(&b.left.min(b.behind)));
    imitators.truncate(4);
    Some(Oracle { distance: (left / gap).sqrt(), imitators })
}

/// The deviations that rig.toml states, in the place of the scatter that a table without noise has.
fn stated(fitted: &mut Fitted, rig: &RigFile) {
    let problem = &mut fitted.problem;
    problem.common = DMatrix::zeros(problem.len(), 0);
    for (i, pass) in problem.passes.iter().enumerate() {
        let ratio = problem.lateral[i] / pass.normal_force_n;
        problem.variance[i] = (rig.noise.pass_relative_sd * problem.lateral[i]).powi(2)
            + rig.noise.force_sd_n.powi(2) * (1.0 + ratio * ratio);
    }
}

/// A law refitted to the noise-free forces: chi2 left, pull of the nuisances, what its freedom of form costs
/// where it is the truth, and chi2 with that freedom and its cost.
fn nearest(fitted: &Fitted, law: &Posterior) -> [f64; 4] {
    let problem = &fitted.problem;
    let fit = minimise(problem, &law.members, &law.u, &problem.variance, ROUNDS);
    let pull = fit.u[..NUISANCES].iter().map(|x| x * x).sum::<f64>();
    let residual = DVector::from_column_slice(&problem.lateral) - &fit.prediction;
    let bare = problem.covariance(&DMatrix::zeros(problem.len(), 0)).log_det;
    let shares = problem.constants.form_shares;
    let with = |share: f64| {
        let covariance = problem.covariance(&law.change.columns(&fitted.basis, share));
        let cost = covariance.log_det - bare;
        (cost, cost + covariance.quadratic(&residual) + pull)
    };
    let each: Vec<(f64, f64)> = shares.iter().map(|s| with(*s)).collect();
    let least = |f: fn(&(f64, f64)) -> f64| each.iter().map(f).fold(f64::INFINITY, f64::min);
    [problem.misfit(&fit.prediction), pull, least(|e| e.0), least(|e| e.1)]
}
