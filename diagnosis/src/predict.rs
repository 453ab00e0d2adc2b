//! The verdict's model at any condition: what `--predict` writes and what held-out passes are judged by.

use crate::data::{RigFile, Table};
use crate::decision::Verdict;
use crate::departure::Freedom;
use crate::discrepancy::{Discrepancy, lengths};
use crate::evidence::{Posterior, laplace, recalibration};
use crate::fit::Problem;
use crate::fitted::Fitted;
use crate::layout::NUISANCES;
use crate::least_squares::minimise;
use models::condition::Condition;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// A prediction at one condition, N.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Forecast {
    /// Of the nominal baseline.
    pub baseline: f64,
    /// Of the recalibrated baseline.
    pub recalibrated: f64,
    /// Of the verdict's model.
    pub corrected: f64,
    /// Of the named effects in the library's form alone, without the smooth departure from it.
    pub form: f64,
    /// Predictive standard deviation of `corrected`: model and pass scatter.
    pub corrected_sd: f64,
    /// The pass scatter in it.
    pub scatter_sd: f64,
}

/// The model behind a verdict, fitted to some rows of a table.
pub enum Model {
    /// The recalibrated baseline.
    Baseline(Posterior),
    /// Effects with their smooth departure from form.
    Effects(Posterior),
    /// The open set.
    Open(Box<Discrepancy>),
}

/// The model of a verdict on some rows (all of them for predictions), starting from the fit to the whole.
pub fn model(
    fitted: &Fitted,
    table: &Table,
    verdict: Verdict,
    leader: Option<usize>,
    rows: Option<&[usize]>,
) -> (Model, Problem, Posterior) {
    let all: Vec<usize> = (0..fitted.problem.len()).collect();
    let rows = rows.unwrap_or(&all);
    let whole = rows.len() == fitted.problem.len();
    let problem = fitted.problem.select(rows);
    let basis = fitted.basis.select(rows);
    let baseline = if whole {
        fitted.none.clone()
    } else {
        let fit = minimise(&problem, &[], &fitted.none.u, &problem.variance, ROUNDS[0]);
        laplace(&problem, &[], &fit.u, &basis, Freedom::NONE, ROUNDS[1])
    };
    let model = match (verdict, leader) {
        (Verdict::NoGap, _) => Model::Baseline(baseline.clone()),
        (Verdict::Named | Verdict::Ambiguous, Some(leader)) => {
            let best = &fitted.candidates[leader].best;
            Model::Effects(if whole {
                best.clone()
            } else {
                let refit = |e: &Posterior| laplace(&problem, &e.members, &e.u, &basis, e.freedom, ROUNDS[2]);
                let plain = best.plain.as_deref().map(|plain| Box::new(refit(plain)));
                Posterior { plain, ..refit(best) }
            })
        }
        (Verdict::Unknown, _) | (_, None) => {
            let part = table.select(rows);
            let lengths = lengths(&problem.constants, &part);
            Model::Open(Box::new(Discrepancy::fit(&part, &problem, &baseline.u, &lengths)))
        }
    };
    (model, problem, baseline)
}

/// Rounds of a refit to some rows: of the baseline by least squares, of its mode, and of the effects' mode.
const ROUNDS: [usize; 3] = [6, 1, 3];
/// Conditions that are predicted at a time.
const PART: usize = 256;

/// Predicts conditions.
pub fn forecast(
    fitted: &Fitted,
    rig: &RigFile,
    model: &(Model, Problem, Posterior),
    passes: &[Condition],
) -> Vec<Forecast> {
    let (model, problem, baseline) = model;
    let ready = match model {
        Model::Baseline(e) => Ready::Baseline(e),
        Model::Effects(e) => Ready::Effects {
            best: e,
            shift: recalibration(problem, &e.u, &e.prediction).2,
            departure: departure_covariance(fitted, problem, e),
        },
        Model::Open(w) => Ready::Open(w),
    };
    passes
        .par_chunks(PART)
        .flat_map_iter(|part| forecast_part(fitted, rig, &ready, problem, baseline, part))
        .collect()
}

/// A model with what is the same for all conditions.
enum Ready<'a> {
    Baseline(&'a Posterior),
    /// With the recalibration that imitates the effect best, and the covariance of the departure's weights.
    Effects {
        best: &'a Posterior,
        shift: DVector<f64>,
        departure: DMatrix<f64>,
    },
    Open(&'a Discrepancy),
}

fn forecast_part(
    fitted: &Fitted,
    rig: &RigFile,
    model: &Ready<'_>,
    problem: &Problem,
    baseline: &Posterior,
    passes: &[Condition],
) -> Vec<Forecast> {
    let n = passes.len();
    let out = problem.at(passes);
    let nominal = out.predict(&[], &[0.0; NUISANCES]);
    let recalibrated = out.predict(&[], &baseline.u);
    let (form, corrected, spread): (DVector<f64>, DVector<f64>, Vec<f64>) = match model {
        Ready::Baseline(e) => {
            let spread = parameter_variance(&out, e, &recalibrated);
            (recalibrated.clone(), recalibrated.clone(), spread)
        }
        Ready::Effects { best: e, shift, departure } => {
            let plain = out.predict(&e.members, &e.u);
            let change = e.change.at(&out, &e.members, &e.u, &plain, shift);
            let columns = change.columns(&fitted.kernels.for_members(passes, &e.members), e.freedom.share);
            let mut spread = parameter_variance(&out, e, &plain);
            let open = &columns * departure;
            for i in 0..n {
                spread[i] += open.row(i).dot(&columns.row(i)).max(0.0);
            }
            let form = match &e.plain {
                Some(plain) => out.predict(&plain.members, &plain.u),
                None => plain.clone(),
            };
            (form, plain + columns * &e.departure, spread)
        }
        Ready::Open(w) => {
            let (mean, sd) = w.predict(problem, passes);
            let mean = DVector::from_vec(mean);
            (mean.clone(), mean, sd.iter().map(|s| s * s).collect())
        }
    };
    let level: Vec<f64> = corrected.iter().copied().collect();
    let scatter = fitted.scatter_of_a_pass(&out, rig, &baseline.u, &level);
    (0..n)
        .map(|i| Forecast {
            baseline: nominal[i],
            recalibrated: recalibrated[i],
            corrected: corrected[i],
            form: form[i],
            corrected_sd: (spread[i] + scatter[i] + out.law_variance(i)).sqrt(),
            scatter_sd: scatter[i].sqrt(),
        })
        .collect()
}

fn parameter_variance(out: &Problem, e: &Posterior, at: &DVector<f64>) -> Vec<f64> {
    let jacobian = out.jacobian(&e.members, &e.u, at);
    let spread = &jacobian * &e.covariance;
    (0..out.len()).map(|i| spread.row(i).dot(&jacobian.row(i)).max(0.0)).collect()
}

/// Posterior covariance of the departure's weights.
fn departure_covariance(fitted: &Fitted, problem: &Problem, e: &Posterior) -> DMatrix<f64> {
    let basis = fitted.kernels.for_members(&problem.passes, &e.members);
    let phi = e.change.columns(&basis, e.freedom.share);
    let r = phi.ncols();
    let gram =
        problem.covariance(&DMatrix::zeros(problem.len(), 0)).inner(&phi, &phi) + DMatrix::identity(r, r);
    gram.cholesky().map_or_else(|| DMatrix::identity(r, r), |c| c.inverse())
}
