//! The hypotheses: no gap, each effect, pairs, and the open set; fitted, with their probabilities.

use crate::data::{RigFile, Table};
use crate::evidence::{Explained, over_forms};
use crate::explore::{held_nuisances, tempered};
use crate::fit::{Problem, minimise};
use crate::linear::log_sum_exp;
use crate::noise::{PureError, settle};
use crate::pairs::pairs;
use crate::singles::{OUTLIVED, Search, outlived, singles, sort, strangers};
use crate::smooth::{Coordinates, Kernel, Lengths};
use crate::wildcard::Wildcard;
use effects::{Effect, known, library};
use nalgebra::DMatrix;

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
    /// Probability of the open set.
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
pub const FORM_LENGTHS: Lengths =
    Lengths { condition: 1.5, time: 1.5, position: f64::INFINITY, climate: f64::INFINITY };
const FORM_RANK: usize = 40;
/// Share of the smooth gap below which starts do not look.
const START_SHARE: f64 = 0.15;
/// Share of the open set's weight for causes of known form.
const KNOWN: f64 = 0.1;
/// Deviations of chi2 above its expectation from which the best single is taken to leave something.
const ENOUGH: f64 = 2.5;

/// Fits every hypothesis to a table.
pub fn fit_all(table: &Table, rig: &RigFile, options: &Options) -> Fitted {
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
    let mut tried = Vec::new();
    for (index, effect) in library().iter().enumerate() {
        if options.without.iter().any(|n| n == effect.name()) {
            continue;
        }
        match table.lacks(effect.needs()) {
            Some(because) => not_testable.push((effect.name(), certified(*effect, rig).unwrap_or(because))),
            None => tried.push(index),
        }
    }

    let search = Search { held: &held, loose: &loose, basis: &basis };
    let mut candidates = singles(&problem, table, &tried, &search);
    let outlived = outlived(&mut problem, table, &mut candidates, &search);
    sort(&mut candidates);
    let strangers = strangers(&problem, table, &search);

    if options.pairs && candidates.first().is_some_and(|c| c.log_evidence > none_evidence + 3.0) {
        let companions = second_causes(&problem, &candidates, &outlived, &search);
        candidates.extend(companions);
    }

    let evidence = [none_evidence, open_evidence(&wildcard, &strangers)];
    let [none_probability, unknown_probability] =
        weigh(&mut candidates, evidence, tried.len(), &options.priors);
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
        priors: options.priors,
        singles_tried: tried.len(),
    }
}

/// Why an effect is not sought that only an outside standard shows, where rig.toml states that calibration.
fn certified(effect: &dyn Effect, rig: &RigFile) -> Option<String> {
    let standard = effect.needs().iter().any(|n| n.is_standard());
    let key = effect.laws().iter().filter(|_| standard).find_map(|law| law.certified_by)?;
    let sd = rig.calibration.sd(key)?;
    Some(format!(
        "an outside calibration leaves {sd:.1e} of the {} open, and that is part of the recalibrated baseline",
        key.words()
    ))
}

/// Pairs, where the best single leaves something: one that leaves nothing needs no second cause, unless it is the
/// stiffnesses that took it up.
fn second_causes(
    problem: &Problem,
    singles: &[Candidate],
    outlived: &[usize],
    search: &Search<'_>,
) -> Vec<Candidate> {
    let best = &singles[0].best;
    let misfit: f64 = (0..problem.len())
        .map(|i| (problem.lateral[i] - best.prediction[i]).powi(2) / problem.variance[i])
        .sum::<f64>()
        + best.pull();
    let n = problem.len() as f64;
    if misfit <= n + ENOUGH * (2.0 * n).sqrt() {
        return Vec::new();
    }
    let mut grown = pairs(problem, singles, search.loose, search.basis);
    for pair in &mut grown {
        // A pair pays for the certificates that it frees as its members do alone.
        let freed = pair.effects.iter().filter(|e| outlived.contains(e)).count();
        pair.log_evidence += freed as f64 * OUTLIVED.ln();
    }
    grown
}

/// Gives each candidate its probability beside no gap and the open set, whose log evidences are given; returns theirs.
fn weigh(
    candidates: &mut [Candidate],
    [none, open]: [f64; 2],
    singles_tried: usize,
    priors: &Priors,
) -> [f64; 2] {
    let count = singles_tried.max(1) as f64;
    let pair_count = (count * (count - 1.0) / 2.0).max(1.0);
    let prior_of = |c: &Candidate| {
        if c.effects.len() == 1 { priors.single / count } else { priors.pair / pair_count }
    };
    let mut all: Vec<f64> = candidates.iter().map(|c| c.log_evidence + prior_of(c).ln()).collect();
    let (no_gap, unknown) = (none + priors.none.ln(), open + priors.unknown.ln());
    all.extend([no_gap, unknown]);
    let total = log_sum_exp(&all);
    // The rest of each hypothesis' weight is no gap's: see `told`.
    let mut rest = 1.0;
    for (c, v) in candidates.iter_mut().zip(&all) {
        c.log_probability = v - total + told(c.log_evidence, none);
        c.probability = c.log_probability.exp();
        rest -= c.probability;
    }
    let unknown = (unknown - total + told(open, none)).exp();
    // Where hypotheses take all but rounding, no gap's own weight is the better number.
    [(rest - unknown).max((no_gap - total).exp()), unknown]
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

/// Evidence of the open set: a smooth departure of any kind, or a cause of known form that the library does not name.
fn open_evidence(wildcard: &Wildcard, strangers: &[Candidate]) -> f64 {
    let each = (KNOWN / strangers.len().max(1) as f64).ln();
    let mut parts = vec![wildcard.log_evidence + (1.0 - KNOWN).ln()];
    parts.extend(strangers.iter().map(|c| c.log_evidence + each));
    log_sum_exp(&parts)
}

#[cfg(test)]
mod tests {
    use super::told;

    /// `E / (E + E0)` in logarithms, at ratios where that fits a number and where it does not.
    #[test]
    fn what_is_too_small_to_tell_is_no_gap() {
        assert!((told(0.0, 0.0) - 0.5_f64.ln()).abs() < 1e-15);
        assert!((told(3.0_f64.ln(), 0.0) - 0.75_f64.ln()).abs() < 1e-15);
        assert!((told(-7.0, -7.0 + 9.0_f64.ln()) - 0.1_f64.ln()).abs() < 1e-14);
        assert_eq!(told(2e4, -2e4), 0.0);
        assert_eq!(told(-2e4, 2e4), -4e4);
    }
}
