//! All that was fitted to a table; how probable each hypothesis is. docs/diagnosis/model.md, section 8.
//! The searches fill `Fitted`; `weigh` alone turns evidence into probabilities; `verdict` decides from them.

use crate::data::RigFile;
use crate::hypotheses::Structure;
use crate::hypotheses::structure::shapes::{self, Shape};
use crate::regression::{Basis, Discrepancy, Kernels, NUISANCES, Posterior, Problem, log_sum_exp};
use crate::scatter::{PureError, Scatter, variance};
use std::collections::BTreeMap;

/// One hypothesis with effects: its evidence over laws and shares, and its best law.
#[derive(Clone)]
pub struct Candidate {
    /// Indices in the library, ascending; one or two.
    pub effects: Vec<usize>,
    /// Log evidence averaged over laws and shares.
    pub log_evidence: f64,
    /// Its law and share: those with the most evidence; of the leader those that predict left-out regions best.
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
    pub fn new(effects: Vec<usize>, log_evidence: f64, best: Posterior, laws: Vec<(f64, Posterior)>) -> Self {
        Candidate { effects, log_evidence, best, laws, probability: 0.0, log_probability: f64::NEG_INFINITY }
    }

    /// Takes a better solution of one of its laws.
    pub(crate) fn law_found(&mut self, log_evidence: f64, found: Posterior) {
        let Some(at) = self.laws.iter().position(|(_, l)| l.members == found.members) else { return };
        if log_evidence <= self.laws[at].0 {
            return;
        }
        let sum = |laws: &[(f64, Posterior)]| log_sum_exp(&laws.iter().map(|l| l.0).collect::<Vec<_>>());
        let before = sum(&self.laws);
        self.laws[at] = (log_evidence, found);
        self.log_evidence += sum(&self.laws) - before;
        self.best = self.likeliest().clone();
    }

    /// The law with the most evidence, which predicts. `best` may be another one, within `alias_nats` of it.
    pub(crate) fn likeliest(&self) -> &Posterior {
        let most = self.laws.iter().max_by(|a, b| a.0.total_cmp(&b.0));
        most.map_or(&self.best, |(_, law)| law)
    }

    /// Names in the library's order.
    pub fn names(&self) -> Vec<&'static str> {
        self.effects.iter().map(|&e| effects::at(e).name).collect()
    }
}

/// Everything that was fitted to a table.
pub struct Fitted {
    /// The problem with its settled variances.
    pub problem: Problem,
    /// What the replicates show.
    pub pure: PureError,
    /// What the table says about its own scatter.
    pub scatter: Scatter,
    /// Recalibrated baseline.
    pub baseline: Posterior,
    /// Probability of no gap.
    pub no_gap_probability: f64,
    /// The open set's smooth departure of any kind.
    pub discrepancy: Discrepancy,
    /// Causes of known form that the library does not name, best first: part of the open set.
    pub unlisted: Vec<Candidate>,
    /// The strongest structure in what the recalibrated baseline leaves; none where no gap is out of the
    /// question.
    pub structure: Option<Structure>,
    /// Jumps, bumps and periods beside the recalibrated baseline, strongest first.
    pub shapes: Vec<Shape>,
    /// Probability of the open set.
    pub open_set_probability: f64,
    /// Log evidence of no gap.
    pub no_gap_evidence: f64,
    /// Log evidence of the open set's smooth part.
    pub smooth_evidence: f64,
    /// Number of single causes that were tried.
    pub tried: usize,
    /// Single effects and pairs, most probable first.
    pub candidates: Vec<Candidate>,
    /// Pairs of causes that were not weighed.
    pub unweighed: Vec<[usize; 2]>,
    /// Effects that this table cannot show, with what is missing.
    pub not_testable: Vec<(&'static str, String)>,
    /// Kernels of the departures from form.
    pub kernels: Kernels,
    /// Their values at the table's passes.
    pub basis: Basis,
}

/// Probabilities where the evidence counts for next to nothing.
pub(crate) struct Coarse {
    /// Of no gap.
    pub no_gap: f64,
    /// Of the open set.
    pub open_set: f64,
    /// Of the candidates, in their order.
    pub each: Vec<f64>,
    /// Of the pairs that were not weighed.
    pub unweighed: Vec<f64>,
}

impl Fitted {
    /// Gives every hypothesis its probability, and sorts the causes by it.
    ///
    /// Differences of log evidence count by the part 1 / `temper`: no law, no departure from it and no
    /// scatter is exactly that of the rig, and as often as the evidence is taken at its word it is too sure.
    pub fn weigh(&mut self) {
        let k = self.problem.constants.clone();
        let beside = |evidence: f64| (evidence - self.no_gap_evidence) / k.temper;
        // What the calibration says of the nuisances is a prior, and a prior is not tempered: a baseline that
        // needs a stiffness far from its certificate pays for that in full.
        let pull = |nuisances: &[f64]| 0.5 * nuisances.iter().map(|u| u * u).sum::<f64>();
        let own = pull(&self.baseline.u[..NUISANCES]);
        let spared = |nuisances: &[f64]| (1.0 - 1.0 / k.temper) * (own - pull(nuisances));
        let weight = |c: &Candidate| beside(c.log_evidence) + spared(&c.best.u[..NUISANCES]);
        let smooth = beside(self.smooth_evidence) + spared(self.discrepancy.nuisances());
        // A structure's nats are those of a p-value, which no law enters.
        let rough = self.structure.as_ref().map_or(f64::NEG_INFINITY, Structure::nats);
        let share = k.structure_share;
        let sudden = shapes::nats(&self.shapes) / k.temper;
        let parts = [(smooth, 1.0 - share), (rough, 0.5 * share), (sudden, 0.5 * share)];
        let open = log_sum_exp(&parts.map(|(nats, share)| nats + share.ln()));
        let mut all: Vec<f64> =
            self.candidates.iter().map(|c| weight(c) + self.log_prior(c.effects.len())).collect();
        let (no_gap, open_set) = (k.prior_no_gap.ln(), open + k.prior_open_set.ln());
        all.extend([no_gap, open_set]);
        let total = log_sum_exp(&all);
        // The rest of each hypothesis' weight is no gap's: see `log_shown_share`.
        let mut rest = 1.0;
        for (c, v) in self.candidates.iter_mut().zip(&all) {
            c.log_probability = v - total + log_shown_share(weight(c), 0.0);
            c.probability = c.log_probability.exp();
            rest -= c.probability;
        }
        self.open_set_probability = (open_set - total + log_shown_share(open, 0.0)).exp();
        // Where hypotheses take all but rounding, no gap's own weight is the better number.
        self.no_gap_probability = (rest - self.open_set_probability).max((no_gap - total).exp());
        self.candidates
            .sort_by(|a, b| b.log_probability.total_cmp(&a.log_probability).then(a.effects.cmp(&b.effects)));
    }

    /// Log evidence of the open set over no gap's: a smooth map, or a structure that is described.
    fn open_nats(&self) -> f64 {
        (self.smooth_evidence - self.no_gap_evidence).max(shapes::nats(&self.shapes))
    }

    /// Nats by which a candidate's evidence leads the open set's, and no gap's.
    pub(crate) fn lead(&self, candidate: &Candidate) -> f64 {
        candidate.log_evidence - self.no_gap_evidence - self.open_nats().max(0.0)
    }

    /// Probabilities as they would be if the evidence counted for next to nothing: all that stands where the
    /// method errs without seeing it. A pair that was not weighed predicts at least what its better member
    /// does, where the other's size is nothing: it has that evidence.
    pub(crate) fn coarse(&self) -> Coarse {
        let k = &self.problem.constants;
        let beside = |evidence: f64| (evidence - self.no_gap_evidence) / k.doubt_temper;
        let weight = |effects: usize, evidence: f64| self.log_prior(effects) + beside(evidence);
        let singles = self.candidates.iter().filter(|c| c.effects.len() == 1);
        let alone: BTreeMap<usize, f64> = singles.map(|c| (c.effects[0], c.log_evidence)).collect();
        let mut all = vec![k.prior_no_gap.ln(), k.prior_open_set.ln() + self.open_nats() / k.doubt_temper];
        all.extend(self.candidates.iter().map(|c| weight(c.effects.len(), c.log_evidence)));
        all.extend(self.unweighed.iter().map(|[a, b]| weight(2, alone[a].max(alone[b]))));
        let total = log_sum_exp(&all);
        let mut all = all.into_iter().map(|v| (v - total).exp());
        let (no_gap, open_set) = (all.next().unwrap_or(0.0), all.next().unwrap_or(0.0));
        let each = all.by_ref().take(self.candidates.len()).collect();
        Coarse { no_gap, open_set, each, unweighed: all.collect() }
    }

    /// Logarithm of the prior probability of one hypothesis with so many effects.
    fn log_prior(&self, effects: usize) -> f64 {
        let k = &self.problem.constants;
        let count = self.tried.max(1) as f64;
        let prior = match effects {
            1 => k.prior_single / count,
            _ => k.prior_pair / (count * (count - 1.0) / 2.0).max(1.0),
        };
        prior.ln()
    }

    /// Log evidence of the best hypothesis.
    pub(crate) fn best_evidence(&self) -> f64 {
        let own = self.candidates.iter().map(|c| c.log_evidence);
        own.chain([self.no_gap_evidence, self.smooth_evidence]).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Variances of single passes at conditions of a problem, given the level of friction there, N^2: of runs
    /// whose shift is not known.
    pub fn scatter_of_a_pass(&self, at: &Problem, rig: &RigFile, center: &[f64], level: &[f64]) -> Vec<f64> {
        let run = self.scatter.run_relative_sd.unwrap_or(0.0);
        let own = variance(at, rig, center, level, self.pure.used);
        // What lasts is a part of the scatter of a pass that has no neighbour.
        let lasting = 1.0 + self.scatter.slow[0].powi(2);
        own.iter().zip(level).map(|(v, l)| v * lasting + (run * l).powi(2)).collect()
    }
}

/// Logarithm of the share of a hypothesis' weight that speaks for a gap which the table can tell.
///
/// Causes have sizes from nothing upwards. Those too small to tell fit as well as no gap does, and give a
/// cause at most the evidence of no gap; that part of its weight says that there is nothing to be seen, and
/// counts for no gap. Without, tables without a gap were given 0.75 to 0.93 for none where that was right in
/// 99 of 100.
fn log_shown_share(evidence: f64, no_gap: f64) -> f64 {
    let behind = no_gap - evidence;
    // The logarithm of one and an exponential, which must not overflow.
    -(behind.max(0.0) + (-behind.abs()).exp().ln_1p())
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
