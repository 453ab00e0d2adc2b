//! The verdict's model at any condition: `--predict`, held-out passes. docs/diagnosis/model.md, section 10.

use crate::data::{RigFile, Table};
use crate::hypotheses::Fitted;
use crate::hypotheses::structure::fitted_shape::FittedShape;
use crate::regression::{
    Discrepancy, Freedom, NUISANCES, Posterior, Problem, Recalibration, laplace, lengths, minimise,
};
use crate::verdict::Verdict;
use models::Condition;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// A prediction at one condition, N.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Forecast {
    /// Of the nominal baseline.
    pub baseline: f64,
    /// Of the recalibrated baseline.
    pub recalibrated: f64,
    /// Of the verdict's model, whose runs have no shift.
    pub corrected: f64,
    /// Of the named effects in the library's form alone, without the smooth departure from it.
    pub form: f64,
    /// Predictive standard deviation of `corrected`: model and pass scatter.
    pub corrected_sd: f64,
    /// The pass scatter in it.
    pub scatter_sd: f64,
    /// What a sensor would read there: `corrected` with the shift of the condition's run, where the table has
    /// that run, and with what lasts of the passes about it.
    pub in_run: f64,
    /// Predictive standard deviation of `in_run`.
    pub in_run_sd: f64,
}

/// A hypothesis that predicts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Which {
    Baseline,
    Cause(usize),
    Open,
    Shape(usize),
}

/// By which hypotheses an answer predicts, with weights that sum to one.
#[derive(Debug, Clone)]
pub struct Predictor {
    parts: Vec<(f64, Which)>,
    /// The cause whose law alone is [`Forecast::form`]; none where the whole is.
    leader: Option<usize>,
}

/// Most hypotheses that a mean is of, and the least weight of one beside the largest.
const AVERAGED: usize = 3;
const LEAST_WEIGHT: f64 = 0.1;

impl Predictor {
    /// One cause or pair, by its place among the candidates.
    pub fn cause(candidate: usize) -> Self {
        Predictor { parts: vec![(1.0, Which::Cause(candidate))], leader: Some(candidate) }
    }

    /// The hypotheses that it predicts by.
    pub(crate) fn hypotheses(&self) -> impl Iterator<Item = Which> + '_ {
        self.parts.iter().map(|(_, which)| *which)
    }

    /// Of a verdict: `no_gap` predicts by the baseline and `named` by what is named. Under `ambiguous` and
    /// `unknown` the table does not say by which, and predictions are the mean over causes, the open set and
    /// shapes, by their tempered evidence.
    pub fn of(fitted: &Fitted, verdict: Verdict, leader: Option<usize>) -> Self {
        match (verdict, leader) {
            (Verdict::NoGap, _) => Predictor { parts: vec![(1.0, Which::Baseline)], leader: None },
            (Verdict::Named, Some(leader)) => Predictor::cause(leader),
            (Verdict::Unknown, _) => Predictor { parts: averaged(fitted), leader: None },
            (_, leader) => Predictor { parts: averaged(fitted), leader },
        }
    }
}

/// What an answer predicts by, in words.
impl std::fmt::Display for Predictor {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self.parts.as_slice() {
            [(_, Which::Baseline)] => "the recalibrated baseline",
            [(_, Which::Cause(i))] if self.leader == Some(*i) => "the leading cause",
            [(_, Which::Cause(_))] => "the likeliest model",
            [(_, Which::Open)] => "a smooth map",
            [(_, Which::Shape(_))] => "the first shape described",
            _ => "the average of the likeliest models",
        })
    }
}

fn averaged(fitted: &Fitted) -> Vec<(f64, Which)> {
    let none = fitted.baseline.log_evidence;
    let causes = fitted.candidates.iter().enumerate();
    let shapes = fitted.shapes.iter().enumerate();
    let mut all: Vec<(f64, Which)> = causes
        .map(|(i, c)| (c.log_evidence - none, Which::Cause(i)))
        .chain(shapes.map(|(i, s)| (s.nats, Which::Shape(i))))
        .chain([(fitted.discrepancy.log_evidence - none, Which::Open)])
        .collect();
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    all.truncate(AVERAGED);
    let best = all[0].0;
    all.iter_mut().for_each(|(nats, _)| *nats = ((*nats - best) / fitted.problem.constants.temper).exp());
    all.retain(|(weight, _)| *weight >= LEAST_WEIGHT);
    let total: f64 = all.iter().map(|(weight, _)| weight).sum();
    all.iter_mut().for_each(|(weight, _)| *weight /= total);
    all
}

/// The model behind an answer, fitted to some rows of a table.
pub struct Model {
    problem: Problem,
    baseline: Posterior,
    /// Weights and hypotheses.
    parts: Vec<(f64, Part)>,
    /// The law of the leader, where there is one.
    law: Option<Posterior>,
}

enum Part {
    Baseline,
    /// With the recalibration that imitates the effect best, and the covariance of the departure's weights.
    Effects {
        best: Box<Posterior>,
        shift: DVector<f64>,
        departure: DMatrix<f64>,
    },
    Open(Box<Discrepancy>),
    Shape(Box<FittedShape>),
}

/// The model of an answer on some rows (all of them for predictions), starting from the fit to the whole.
pub fn model(fitted: &Fitted, table: &Table, answer: &Predictor, rows: Option<&[usize]>) -> Model {
    let all: Vec<usize> = (0..fitted.problem.len()).collect();
    let rows = rows.unwrap_or(&all);
    let whole = rows.len() == fitted.problem.len();
    let problem = fitted.problem.select(rows);
    let basis = fitted.basis.select(rows);
    let baseline = if whole {
        fitted.baseline.clone()
    } else {
        let fit = minimise(&problem, &[], &fitted.baseline.u, &problem.variance, ROUNDS[0]);
        laplace(&problem, &[], &fit.u, &basis, Freedom::NONE, ROUNDS[1])
    };
    let refit = |e: &Posterior| {
        if whole { e.clone() } else { laplace(&problem, &e.members, &e.u, &basis, e.freedom, ROUNDS[2]) }
    };
    let part = |which: Which| match which {
        Which::Baseline => Part::Baseline,
        Which::Cause(i) => {
            let best = Box::new(refit(fitted.candidates[i].likeliest()));
            let shift = Recalibration::of(&problem, &best.u, &best.prediction).shift;
            let departure = departure_covariance(fitted, &problem, &best);
            Part::Effects { best, shift, departure }
        }
        Which::Open => {
            let part = table.select(rows);
            let lengths = lengths(&problem.constants, &part);
            Part::Open(Box::new(Discrepancy::fit(&part, &problem, &baseline.u, &lengths)))
        }
        Which::Shape(i) => Part::Shape(Box::new(FittedShape::fit(&fitted.shapes[i], &problem, &baseline))),
    };
    let parts: Vec<_> = answer.parts.iter().map(|(weight, which)| (*weight, part(*which))).collect();
    let law = answer.leader.map(|leader| {
        let own = &fitted.candidates[leader].best;
        let at = answer.parts.iter().position(|(_, which)| *which == Which::Cause(leader));
        match at.filter(|_| own.plain.is_none()).map(|at| &parts[at].1) {
            Some(Part::Effects { best, .. }) if best.members == own.members => (**best).clone(),
            _ => refit(own.by_law()),
        }
    });
    Model { parts, law, problem, baseline }
}

/// Rounds of a refit to some rows: of the baseline by least squares, of its mode, and of the effects' mode.
const ROUNDS: [usize; 3] = [6, 1, 3];
/// Conditions that are predicted at a time.
const PART: usize = 256;

/// Predicts conditions.
pub fn forecast(fitted: &Fitted, rig: &RigFile, model: &Model, passes: &[Condition]) -> Vec<Forecast> {
    passes.par_chunks(PART).flat_map_iter(|part| forecast_part(fitted, rig, model, part)).collect()
}

impl Part {
    /// Forces and their variances without scatter, N and N^2.
    fn predict(
        &self,
        fitted: &Fitted,
        model: &Model,
        out: &Problem,
        recalibrated: &DVector<f64>,
    ) -> (DVector<f64>, Vec<f64>) {
        match self {
            Part::Baseline => (recalibrated.clone(), parameter_variance(out, &model.baseline, recalibrated)),
            Part::Effects { best: e, shift, departure } => {
                let plain = out.predict(&e.members, &e.u);
                let change = e.change.at(out, &e.members, &e.u, &plain, shift);
                let basis = fitted.kernels.for_members(&out.passes, &e.members);
                let columns = change.columns(&basis, e.freedom.share);
                let mut spread = parameter_variance(out, e, &plain);
                let open = &columns * departure;
                for (i, s) in spread.iter_mut().enumerate() {
                    *s += open.row(i).dot(&columns.row(i)).max(0.0);
                }
                (plain + columns * &e.departure, spread)
            }
            Part::Open(w) => {
                let (mean, sd) = w.predict(&model.problem, &out.passes);
                (DVector::from_vec(mean), sd.iter().map(|s| s * s).collect())
            }
            Part::Shape(laid) => laid.predict(out),
        }
    }
}

fn forecast_part(fitted: &Fitted, rig: &RigFile, model: &Model, passes: &[Condition]) -> Vec<Forecast> {
    let n = passes.len();
    let out = model.problem.at(passes);
    let nominal = out.predict(&[], &[0.0; NUISANCES]);
    let recalibrated = out.predict(&[], &model.baseline.u);
    let each: Vec<(f64, (DVector<f64>, Vec<f64>))> =
        model.parts.iter().map(|(w, part)| (*w, part.predict(fitted, model, &out, &recalibrated))).collect();
    // A mixture: its variance holds how far its parts lie from each other.
    let mut corrected = DVector::zeros(n);
    each.iter().for_each(|(w, (mean, _))| corrected += mean * *w);
    let spread = |i: usize| -> f64 {
        each.iter().map(|(w, (mean, variance))| w * (variance[i] + (mean[i] - corrected[i]).powi(2))).sum()
    };
    let form = model.law.as_ref().map_or_else(|| corrected.clone(), |e| out.predict(&e.members, &e.u));
    let level: Vec<f64> = corrected.iter().copied().collect();
    let scatter = fitted.scatter_of_a_pass(&out, rig, &model.baseline.u, &level);
    (0..n)
        .map(|i| {
            let sd = (spread(i) + scatter[i] + out.law_variance(i)).sqrt();
            Forecast {
                baseline: nominal[i],
                recalibrated: recalibrated[i],
                corrected: corrected[i],
                form: form[i],
                corrected_sd: sd,
                scatter_sd: scatter[i].sqrt(),
                in_run: corrected[i],
                in_run_sd: sd,
            }
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
