//! The hypotheses: no gap, each effect, pairs, and the open set; fitted, with their probabilities.

use crate::data::{Rig, Table};
use crate::evidence::{Explained, FORMS, explain, over_forms};
use crate::explore::{held_nuisances, nuisance_starts, optima, tempered};
use crate::fit::{Fit, Member, Problem, minimise};
use crate::linear::log_sum_exp;
use crate::noise::{PureError, settle};
use crate::pairs::pairs;
use crate::smooth::{Coordinates, Kernel, Lengths};
use crate::wildcard::Wildcard;
use effects::{known, library};
use nalgebra::DMatrix;
use rayon::prelude::*;

/// Prior probabilities of no gap, of one effect, of two, and of none in the library.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Priors {
    /// No gap.
    pub none: f64,
    /// One effect of the library.
    pub single: f64,
    /// Two effects of the library.
    pub pair: f64,
    /// Something else.
    pub unknown: f64,
}

impl Default for Priors {
    /// A gap is as likely as none.
    fn default() -> Self {
        Priors { none: 0.5, single: 0.36, pair: 0.07, unknown: 0.07 }
    }
}

/// What a diagnosis may be told.
#[derive(Debug, Clone)]
pub struct Options {
    /// Prior probabilities.
    pub priors: Priors,
    /// Whether pairs are tried.
    pub pairs: bool,
    /// Effects that are left out of the library (for leave-one-effect-out tests).
    pub without: Vec<String>,
}

impl Default for Options {
    fn default() -> Self {
        Options { priors: Priors::default(), pairs: true, without: Vec::new() }
    }
}

/// One hypothesis with effects: its evidence over laws and shares, and its best law.
#[derive(Clone)]
pub struct Candidate {
    /// Indices in the library, ascending; one or two.
    pub effects: Vec<usize>,
    /// Log evidence averaged over laws and shares.
    pub log_evidence: f64,
    /// The best law and share.
    pub best: Explained,
    /// Each law's own log evidence and solution.
    pub laws: Vec<(f64, Explained)>,
    /// Probability given the data.
    pub probability: f64,
    /// Its logarithm: it orders hypotheses whose probabilities are too small for a number.
    pub log_probability: f64,
}

impl Candidate {
    /// A hypothesis whose probability is not known yet.
    pub(crate) fn new(
        effects: Vec<usize>,
        log_evidence: f64,
        best: Explained,
        laws: Vec<(f64, Explained)>,
    ) -> Self {
        Candidate { effects, log_evidence, best, laws, probability: 0.0, log_probability: f64::NEG_INFINITY }
    }

    /// Names in the library's order.
    pub fn names(&self) -> Vec<&'static str> {
        self.effects.iter().map(|&e| known()[e].name()).collect()
    }
}

/// Everything that was fitted to a table.
pub struct Fitted {
    /// The problem with its settled variances.
    pub problem: Problem,
    /// What the replicates said.
    pub pure: PureError,
    /// Recalibrated baseline.
    pub none: Explained,
    /// Probability of no gap.
    pub none_probability: f64,
    /// The open set's smooth departure of any kind.
    pub wildcard: Wildcard,
    /// Causes of known form that the library does not name, best first: part of the open set.
    pub strangers: Vec<Candidate>,
    /// Its probability.
    pub unknown_probability: f64,
    /// Single effects and pairs, most probable first.
    pub candidates: Vec<Candidate>,
    /// Effects that this table cannot show, with what is missing.
    pub not_testable: Vec<(&'static str, String)>,
    /// Covariates of the form uncertainty.
    pub coordinates: Coordinates,
    /// Kernel of the form uncertainty.
    pub kernel: Kernel,
    /// Its values at the table's passes.
    pub basis: DMatrix<f64>,
    /// The priors that were used.
    pub priors: Priors,
    /// Number of single effects that were tried.
    pub singles_tried: usize,
}

/// Lengths of the form uncertainty in standard deviations of each covariate.
pub const FORM_LENGTHS: Lengths = Lengths { condition: 1.5, time: 1.5, position: f64::INFINITY };
const FORM_RANK: usize = 40;
/// Share of the smooth gap below which starts do not look.
const START_SHARE: f64 = 0.15;
/// Laws this many nats behind the best single keep the middle share only.
pub(crate) const PRUNE: f64 = 15.0;
/// A law whose tempered cost is beyond this factor of the best, plus this, is not refined.
const HOPELESS: (f64, f64) = (1.5, 60.0);
/// Share of certificates that no longer hold when a table is taken: the instrument was knocked, or changed.
const OUTLIVED: f64 = 0.02;
/// Share of the open set's weight for causes of known form.
const KNOWN: f64 = 0.1;
/// Deviations of chi2 above its expectation from which the best single is taken to leave something.
const ENOUGH: f64 = 2.5;

/// Fits every hypothesis to a table.
pub fn fit_all(table: &Table, rig: &Rig, options: &Options) -> Fitted {
    let mut problem = Problem::new(table, rig);
    let (wildcard, pure) = settle(table, rig, &mut problem);
    let coordinates = Coordinates::of(table);
    let places: Vec<_> = problem
        .passes
        .iter()
        .map(|p| coordinates.place(p, problem.design.largest_amplitude_m, &FORM_LENGTHS))
        .collect();
    let kernel = Kernel::new(&places, FORM_RANK, 0.02);
    let basis = kernel.matrix(&places);

    let baseline = minimise(&problem, &[], &[0.0; 3], &problem.variance, 15);
    let (none_evidence, none) = over_forms(&problem, &baseline, &[], &basis);
    let gap = &wildcard.smooth - &none.prediction;
    let loose = tempered(&problem, &gap, START_SHARE);
    let held = held_nuisances(&minimise(&problem, &[], &none.u, &loose, 10));

    let mut not_testable = Vec::new();
    let mut members = Vec::new();
    let mut tried = Vec::new();
    for (index, effect) in library().iter().enumerate() {
        if options.without.iter().any(|n| n == effect.name()) {
            continue;
        }
        if let Some(because) = table.lacks(effect.needs()) {
            not_testable.push((effect.name(), because));
            continue;
        }
        tried.push(index);
        for law in 0..effect.laws().len() {
            if usable(index, law, table) {
                members.push(Member { effect: index, law });
            }
        }
    }

    let search = Search { held: &held, loose: &loose, basis: &basis };
    let laws = singles(&problem, &members, &search);
    let mut candidates: Vec<Candidate> = tried
        .iter()
        .filter_map(|&effect| candidate(vec![effect], of_effect(effect, &members, &laws)))
        .collect();
    // What a certificate says holds unless the table speaks against it by more than such an accident is rare: then the
    // effect has its own prior again, here and in all that follows.
    let bounded: Vec<Member> = members
        .iter()
        .copied()
        .filter(|m| problem.certified.iter().any(|(c, _)| c.effect == m.effect))
        .collect();
    let mut outlived = Vec::new();
    if !bounded.is_empty() {
        let free = Problem { certified: Vec::new(), ..problem.clone() };
        let laws = singles(&free, &bounded, &search);
        for own in &mut candidates {
            let effect = own.effects[0];
            let Some(mut other) = candidate(vec![effect], of_effect(effect, &bounded, &laws)) else {
                continue;
            };
            other.log_evidence += OUTLIVED.ln();
            if other.log_evidence > own.log_evidence {
                problem.certified.retain(|(m, _)| m.effect != effect);
                outlived.push(effect);
                *own = other;
            }
        }
    }
    sort(&mut candidates);
    let strangers = strangers(&problem, table, &search);

    if options.pairs && candidates.first().is_some_and(|c| c.log_evidence > none_evidence + 3.0) {
        // A single that leaves nothing needs no second cause, unless it is the stiffnesses that took it up.
        let best = &candidates[0].best;
        let misfit: f64 = (0..problem.len())
            .map(|i| (problem.lateral[i] - best.prediction[i]).powi(2) / problem.variance[i])
            .sum::<f64>()
            + best.pull();
        let n = problem.len() as f64;
        if misfit > n + ENOUGH * (2.0 * n).sqrt() {
            let mut grown = pairs(&problem, &candidates, &loose, &basis);
            for pair in &mut grown {
                // A pair pays for the certificates that it frees as its members do alone.
                let freed = pair.effects.iter().filter(|e| outlived.contains(e)).count();
                pair.log_evidence += freed as f64 * OUTLIVED.ln();
            }
            candidates.extend(grown);
        }
    }

    let priors = options.priors;
    let count = tried.len().max(1) as f64;
    let pair_count = (count * (count - 1.0) / 2.0).max(1.0);
    let prior_of = |c: &Candidate| {
        if c.effects.len() == 1 { priors.single / count } else { priors.pair / pair_count }
    };
    let mut all: Vec<f64> = candidates.iter().map(|c| c.log_evidence + prior_of(c).ln()).collect();
    all.push(none_evidence + priors.none.ln());
    let open = open_evidence(&wildcard, &strangers);
    all.push(open + priors.unknown.ln());
    let total = log_sum_exp(&all);
    let k = candidates.len();
    // The rest of each hypothesis' weight is no gap's: see `told`.
    let mut none_probability = 1.0;
    for (c, v) in candidates.iter_mut().zip(&all) {
        c.log_probability = v - total + told(c.log_evidence, none_evidence);
        c.probability = c.log_probability.exp();
        none_probability -= c.probability;
    }
    let unknown_probability = (all[k + 1] - total + told(open, none_evidence)).exp();
    // Where hypotheses take all but rounding, no gap's own weight is the better number.
    let none_probability = (none_probability - unknown_probability).max((all[k] - total).exp());
    candidates
        .sort_by(|a, b| b.log_probability.total_cmp(&a.log_probability).then(a.effects.cmp(&b.effects)));
    Fitted {
        problem,
        pure,
        none,
        none_probability,
        wildcard,
        strangers,
        unknown_probability,
        candidates,
        not_testable,
        coordinates,
        kernel,
        basis,
        priors,
        singles_tried: tried.len(),
    }
}

/// Logarithm of the share of a hypothesis' weight that speaks for a gap which the table can tell.
///
/// Causes have sizes from nothing upwards. Those too small to tell fit as well as no gap does, and give a cause at most the
/// evidence of no gap; that part of its weight says that there is nothing to be seen, and counts for no gap. Without, tables
/// without a gap were given 0.75 to 0.93 for none where that was right in 99 of 100.
fn told(evidence: f64, none: f64) -> f64 {
    let behind = none - evidence;
    // The logarithm of one and an exponential, which must not overflow.
    -(behind.max(0.0) + (-behind.abs()).exp().ln_1p())
}

/// Causes of known form that the library does not name, best first.
fn strangers(problem: &Problem, table: &Table, search: &Search<'_>) -> Vec<Candidate> {
    let testable = |&e: &usize| table.lacks(known()[e].needs()).is_none();
    let effects: Vec<usize> = (library().len()..known().len()).filter(testable).collect();
    let laws = |&effect: &usize| (0..known()[effect].laws().len()).map(move |law| Member { effect, law });
    let members: Vec<Member> = effects.iter().flat_map(laws).collect();
    let found = singles(problem, &members, search);
    let mut list: Vec<Candidate> =
        effects.iter().filter_map(|&e| candidate(vec![e], of_effect(e, &members, &found))).collect();
    sort(&mut list);
    list
}

/// Evidence of the open set: a smooth departure of any kind, or a cause of known form that the library does not name.
fn open_evidence(wildcard: &Wildcard, strangers: &[Candidate]) -> f64 {
    let each = (KNOWN / strangers.len().max(1) as f64).ln();
    let mut parts = vec![wildcard.log_evidence + (1.0 - KNOWN).ln()];
    parts.extend(strangers.iter().map(|c| c.log_evidence + each));
    log_sum_exp(&parts)
}

/// What the searches for singles share: where the nuisances start, tempered variances, and the form's basis.
struct Search<'a> {
    held: &'a [f64],
    loose: &'a [f64],
    basis: &'a DMatrix<f64>,
}

/// Every law alone: its log evidence over the shares of form uncertainty, and its best solution.
fn singles(problem: &Problem, members: &[Member], search: &Search<'_>) -> Vec<Option<(f64, Explained)>> {
    // Middle share first, for every law; the other shares where they could matter. Laws cost from one millisecond to two
    // hundred: each is a task of its own.
    let starts: Vec<Vec<Fit>> = members
        .par_iter()
        .with_max_len(1)
        .map(|member| {
            let mut fits: Vec<Fit> = nuisance_starts(search.held)
                .iter()
                .flat_map(|held| optima(problem, &[*member], held, search.loose))
                .collect();
            fits.sort_by(|a, b| a.cost.total_cmp(&b.cost));
            fits
        })
        .collect();
    let cheapest = starts.iter().flatten().map(|f| f.cost).fold(f64::INFINITY, f64::min);
    let middle: Vec<Option<Explained>> = members
        .par_iter()
        .zip(&starts)
        .with_max_len(1)
        .map(|(member, fits)| {
            let own = fits.first()?.cost;
            // What lies far behind even on the tempered scale gets one look, not a search.
            let rounds = if own > HOPELESS.0 * cheapest + HOPELESS.1 { 0 } else { 6 };
            fits.iter()
                .filter(|f| rounds > 0 || f.cost == own)
                .filter(|f| f.cost < 1.2 * own + 10.0)
                .map(|f| explain(problem, &[*member], &f.u, search.basis, FORMS[1].0, rounds))
                .max_by(|a, b| a.log_evidence.total_cmp(&b.log_evidence))
        })
        .collect();
    let top = middle.iter().flatten().map(|e| e.log_evidence).fold(f64::NEG_INFINITY, f64::max);
    middle
        .into_par_iter()
        .with_max_len(1)
        .map(|found| {
            found.map(|e| {
                if e.log_evidence > top - PRUNE {
                    let fit = Fit { u: e.u.clone(), prediction: e.prediction.clone(), cost: 0.0 };
                    over_forms(problem, &fit, &e.members, search.basis)
                } else {
                    (e.log_evidence + FORMS[1].1.ln(), e)
                }
            })
        })
        .collect()
}

fn of_effect(effect: usize, members: &[Member], laws: &[Option<(f64, Explained)>]) -> Vec<(f64, Explained)> {
    members.iter().zip(laws).filter(|(m, _)| m.effect == effect).filter_map(|(_, l)| l.clone()).collect()
}

/// Laws whose covariate this table lacks are not tried.
fn usable(effect: usize, law: usize, table: &Table) -> bool {
    let form = &known()[effect].laws()[law];
    let temperatures: Vec<f64> = table.passes.iter().filter_map(|p| p.temperature_c).collect();
    let span = temperatures.iter().copied().fold(f64::NEG_INFINITY, f64::max)
        - temperatures.iter().copied().fold(f64::INFINITY, f64::min);
    match form.name {
        "warming (temperature)" | "warming about a tuning point" | "offset with temperature" => {
            temperatures.len() == table.len() && span > 0.3
        }
        "fixed resonance" | "standing wave, shorter at higher frequency" => {
            let first = table.passes[0].frequency_hz;
            table.passes.iter().any(|p| (p.frequency_hz / first - 1.0).abs() > 1e-3)
        }
        "exponential approach in each run" => table.run_count > 1,
        _ => true,
    }
}

fn candidate(effects: Vec<usize>, laws: Vec<(f64, Explained)>) -> Option<Candidate> {
    let best = laws.iter().max_by(|a, b| a.0.total_cmp(&b.0))?.1.clone();
    let evidences: Vec<f64> = laws.iter().map(|l| l.0).collect();
    let log_evidence = log_sum_exp(&evidences) - (laws.len() as f64).ln();
    log_evidence.is_finite().then(|| Candidate::new(effects, log_evidence, best, laws))
}

fn sort(candidates: &mut [Candidate]) {
    candidates.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence).then(a.effects.cmp(&b.effects)));
}
