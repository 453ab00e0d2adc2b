//! The hypotheses: no gap, each effect, pairs, and the open set; fitted, with their probabilities.

use crate::constants::Constants;
use crate::data::{RigFile, Table};
use crate::discrepancy::Discrepancy;
use crate::evidence::{Posterior, averaged_over_form};
use crate::fit::Problem;
use crate::gaussian::log_sum_exp;
use crate::kernel::{Coordinates, Kernel, Lengths};
use crate::layout::NUISANCES;
use crate::least_squares::minimise;
use crate::noise::{PureError, settle, variance};
use crate::pairs::pairs;
use crate::progress::Progress;
use crate::scatter::{Belief, Scatter};
use crate::singles::{Search, lapsed, singles, sort, unlisted};
use crate::starts::{nuisances_of, tempered};
use crate::structure::{Structure, structure};
use effects::{Effect, known, library};
use nalgebra::DMatrix;
use std::sync::Arc;

/// Choices of a diagnosis.
#[derive(Debug, Clone)]
pub struct Options {
    /// Tunable constants; a study changes them.
    pub constants: Arc<Constants>,
    /// Whether pairs are tried.
    pub pairs: bool,
    /// Effects that are left out of the library (for leave-one-effect-out tests).
    pub without: Vec<String>,
    /// Who is told how far it is.
    pub progress: Progress,
}

impl Default for Options {
    fn default() -> Self {
        Options { constants: Arc::default(), pairs: true, without: Vec::new(), progress: Progress::default() }
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
    pub best: Posterior,
    /// Each law's own log evidence and solution.
    pub laws: Vec<(f64, Posterior)>,
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
        best: Posterior,
        laws: Vec<(f64, Posterior)>,
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
    /// What the table says about its own scatter.
    pub scatter: Scatter,
    /// Recalibrated baseline.
    pub none: Posterior,
    /// Probability of no gap.
    pub none_probability: f64,
    /// The open set's smooth departure of any kind.
    pub discrepancy: Discrepancy,
    /// Causes of known form that the library does not name, best first: part of the open set.
    pub unlisted: Vec<Candidate>,
    /// The strongest structure in what the recalibrated baseline leaves; none where no gap is out of the question.
    pub structure: Option<Structure>,
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
}

/// Lengths of the form uncertainty in standard deviations of each covariate; a form does not depend on the place.
pub fn form_lengths(k: &Constants) -> Lengths {
    Lengths { condition: k.form_length, time: k.form_length, position: f64::INFINITY, climate: f64::INFINITY }
}

/// Share of the work after which single effects are fitted.
pub(crate) const SINGLES_END: f64 = 0.5;

/// Rounds of the baseline's fit, and of its fit to what the gap looks like at large.
const ROUNDS: [usize; 2] = [15, 10];

impl Fitted {
    /// Variances of single passes at conditions of a problem, given the level of friction there, N^2: of runs whose shift is
    /// not known.
    pub fn scatter_of_a_pass(&self, at: &Problem, rig: &RigFile, center: &[f64], level: &[f64]) -> Vec<f64> {
        let run = self.scatter.run_relative_sd.unwrap_or(0.0);
        let own = variance(at, rig, center, level, self.pure.used);
        own.iter().zip(level).map(|(v, l)| v + (run * l).powi(2)).collect()
    }
}

/// Fits every hypothesis to a table.
pub fn fit_all(table: &Table, rig: &RigFile, options: &Options) -> Fitted {
    fit_believing(table, rig, options, &Belief::Judged)
}

/// The same with a belief about which passes belong.
pub fn fit_believing(table: &Table, rig: &RigFile, options: &Options, belief: &Belief) -> Fitted {
    let (k, progress) = (&*options.constants, &options.progress);
    progress.at("the table's own scatter", 0.0);
    let mut problem = Problem::new(table, rig, &options.constants);
    let (discrepancy, pure, mut scatter) = settle(table, rig, &mut problem, belief);
    let coordinates = Coordinates::of(table);
    let places: Vec<_> = problem
        .passes
        .iter()
        .map(|p| coordinates.place(p, problem.design.largest_amplitude_m, &form_lengths(k)))
        .collect();
    let kernel = Kernel::new(&places, k.form_rank, k.kernel_rest);
    let basis = kernel.matrix(&places);

    let baseline = minimise(&problem, &[], &[0.0; NUISANCES], &problem.variance, ROUNDS[0]);
    let (none_evidence, none) = averaged_over_form(&problem, &baseline, &[], &basis);
    let gap = &discrepancy.smooth - &none.prediction;
    let loose = tempered(&problem, &gap, k.start_share);
    let nuisances = nuisances_of(&minimise(&problem, &[], &none.u, &loose, ROUNDS[1]));

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

    let search = Search { nuisances: &nuisances, loose: &loose, basis: &basis, progress };
    let mut candidates = singles(&problem, table, &tried, &search);
    let lapsed = lapsed(&mut problem, table, &mut candidates, &search);
    sort(&mut candidates);
    let leading = |candidates: &[Candidate]| {
        let mut list: Vec<_> =
            candidates.iter().map(|c| (c.names(), c.log_evidence - none_evidence)).collect();
        list.sort_by(|a, b| b.1.total_cmp(&a.1));
        list
    };
    progress.with("causes that the library does not name", SINGLES_END, || leading(&candidates));
    let leader = candidates.first().filter(|c| c.log_evidence > none_evidence + k.pairs_from_nats);
    if let (Belief::Judged, Some(leader)) = (belief, leader) {
        let departed =
            leader.best.change.component_mul(&(&basis * &leader.best.departure)) * leader.best.share;
        if let Some(other) = scatter.about_cause(&problem, &(&leader.best.prediction + departed)) {
            return fit_believing(table, rig, options, &other);
        }
    }
    let unlisted = unlisted(&problem, table, &search);

    if options.pairs && candidates.first().is_some_and(|c| c.log_evidence > none_evidence + k.pairs_from_nats)
    {
        progress.with("pairs of effects", 0.6, || leading(&candidates));
        let companions = second_causes(&problem, &candidates, &lapsed, &search);
        candidates.extend(companions);
    }

    progress.with("what the library cannot say", 0.7, || leading(&candidates));
    let smooth = open_evidence(k, &discrepancy, &unlisted);
    let top = candidates.iter().map(|c| c.log_evidence).fold(smooth, f64::max);
    let structure =
        if none_evidence > top - k.structure_asked_nats { structure(&problem, &none) } else { None };
    let rough = structure.as_ref().map_or(f64::NEG_INFINITY, |s| none_evidence + s.nats());
    let share = k.structure_share;
    let evidence = [none_evidence, log_sum_exp(&[smooth + (1.0 - share).ln(), rough + share.ln()])];
    let [none_probability, unknown_probability] = weigh(&mut candidates, evidence, tried.len(), k);
    candidates
        .sort_by(|a, b| b.log_probability.total_cmp(&a.log_probability).then(a.effects.cmp(&b.effects)));
    // What the leading cause explains after all belongs; it counted for little, and is not called suspect.
    if let Some(c) = candidates.first().filter(|c| c.probability > none_probability.max(unknown_probability))
    {
        let belonging = explained_by(&problem, &scatter, &c.best);
        scatter.suspects.retain(|s| !belonging.contains(&s.row));
    }
    Fitted {
        problem,
        pure,
        scatter,
        none,
        none_probability,
        discrepancy,
        unlisted,
        structure,
        unknown_probability,
        candidates,
        not_testable,
        coordinates,
        kernel,
        basis,
    }
}

/// Rows of suspect passes that a cause explains.
fn explained_by(problem: &Problem, scatter: &Scatter, cause: &Posterior) -> Vec<usize> {
    let explains = |row: &usize| {
        let own = problem.whole_variance(*row) / scatter.inflation[*row];
        (problem.lateral[*row] - cause.prediction[*row]).powi(2)
            < problem.constants.explained_sd.powi(2) * own
    };
    scatter.suspects.iter().map(|s| s.row).filter(explains).collect()
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
    lapsed: &[usize],
    search: &Search<'_>,
) -> Vec<Candidate> {
    let best = &singles[0].best;
    let misfit = problem.misfit(&best.prediction) + best.pull();
    let n = problem.len() as f64;
    if misfit <= n + problem.constants.misfit_sd * (2.0 * n).sqrt() {
        return Vec::new();
    }
    let mut grown = pairs(problem, singles, search.loose, search.basis);
    for pair in &mut grown {
        // A pair pays for the certificates that it frees as its members do alone.
        let freed = pair.effects.iter().filter(|e| lapsed.contains(e)).count();
        pair.log_evidence += freed as f64 * problem.constants.lapse_probability.ln();
    }
    grown
}

/// Gives each candidate its probability beside no gap and the open set, whose log evidences are given; returns theirs.
fn weigh(
    candidates: &mut [Candidate],
    [none, open]: [f64; 2],
    singles_tried: usize,
    k: &Constants,
) -> [f64; 2] {
    let count = singles_tried.max(1) as f64;
    let pair_count = (count * (count - 1.0) / 2.0).max(1.0);
    let prior_of = |c: &Candidate| {
        if c.effects.len() == 1 { k.prior_single / count } else { k.prior_pair / pair_count }
    };
    let mut all: Vec<f64> = candidates.iter().map(|c| c.log_evidence + prior_of(c).ln()).collect();
    let (no_gap, unknown) = (none + k.prior_null.ln(), open + k.prior_open.ln());
    all.extend([no_gap, unknown]);
    let total = log_sum_exp(&all);
    // The rest of each hypothesis' weight is no gap's: see `log_shown_share`.
    let mut rest = 1.0;
    for (c, v) in candidates.iter_mut().zip(&all) {
        c.log_probability = v - total + log_shown_share(c.log_evidence, none);
        c.probability = c.log_probability.exp();
        rest -= c.probability;
    }
    let unknown = (unknown - total + log_shown_share(open, none)).exp();
    // Where hypotheses take all but rounding, no gap's own weight is the better number.
    [(rest - unknown).max((no_gap - total).exp()), unknown]
}

/// Logarithm of the share of a hypothesis' weight that speaks for a gap which the table can tell.
///
/// Causes have sizes from nothing upwards. Those too small to tell fit as well as no gap does, and give a cause at most the
/// evidence of no gap; that part of its weight says that there is nothing to be seen, and counts for no gap. Without, tables
/// without a gap were given 0.75 to 0.93 for none where that was right in 99 of 100.
fn log_shown_share(evidence: f64, none: f64) -> f64 {
    let behind = none - evidence;
    // The logarithm of one and an exponential, which must not overflow.
    -(behind.max(0.0) + (-behind.abs()).exp().ln_1p())
}

/// Evidence of the open set: a smooth departure of any kind, or a cause of known form that the library does not name.
fn open_evidence(k: &Constants, discrepancy: &Discrepancy, unlisted: &[Candidate]) -> f64 {
    let each = (k.unlisted_share / unlisted.len().max(1) as f64).ln();
    let mut parts = vec![discrepancy.log_evidence + (1.0 - k.unlisted_share).ln()];
    parts.extend(unlisted.iter().map(|c| c.log_evidence + each));
    log_sum_exp(&parts)
}

#[cfg(test)]
mod tests {
    use super::log_shown_share;

    /// `E / (E + E0)` in logarithms, at ratios where that fits a number and where it does not.
    #[test]
    fn what_is_too_small_to_tell_is_no_gap() {
        assert!((log_shown_share(0.0, 0.0) - 0.5_f64.ln()).abs() < 1e-15);
        assert!((log_shown_share(3.0_f64.ln(), 0.0) - 0.75_f64.ln()).abs() < 1e-15);
        assert!((log_shown_share(-7.0, -7.0 + 9.0_f64.ln()) - 0.1_f64.ln()).abs() < 1e-14);
        assert_eq!(log_shown_share(2e4, -2e4), 0.0);
        assert_eq!(log_shown_share(-2e4, 2e4), -4e4);
    }
}
