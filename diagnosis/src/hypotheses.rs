//! The hypotheses and the order of their fits. docs/diagnosis/model.md, section 4.
//!
//! [`fit_all`] fits once with the scatter as it is judged, and once more with independent scatter where
//! lasting scatter may be a cause in disguise. [`fit_believing`] is one such fit, in this order:
//!
//! ```text
//! scatter (noise, scatter) -> no gap -> singles -> lapsed certificates
//!   -> passes judged about the baseline, then about the leader: begin again?
//!   -> unlisted causes -> pairs, their members again -> structure and shapes -> Fitted
//! ```
//!
//! `Candidate` is a hypothesis with its evidence, `Posterior` the mode of one law, `Fitted` all of them with
//! the table as it was believed. `Belief` says which passes belong; `Search` is what every search shares.
//! Nothing here decides: that is [`crate::verdict`].

pub mod fitted;
pub mod pairs;
pub mod singles;
pub mod structure;

pub use fitted::{Candidate, Fitted};
pub use pairs::pairs;
pub(crate) use singles::{SINGLES_END, Search, lapsed, singles, sort, unlisted};
pub use structure::{Structure, structure};

use crate::base_law::BaseLaw;
use crate::constants::Constants;
use crate::data::{RigFile, Table};
use crate::progress::Progress;
use crate::regression::{
    Basis, Kernels, Layout, NUISANCES, Posterior, Problem, averaged_over_form, log_sum_exp, minimise,
    tempered,
};
use crate::scatter::{Belief, settle};
use effects::{Effect, library, one_cause};
use models::Condition;
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::sync::Arc;
use structure::shapes;

/// Choices of a diagnosis.
#[derive(Debug, Clone)]
pub struct Options {
    /// Tunable constants; a study changes them.
    pub constants: Arc<Constants>,
    /// Whether pairs are tried.
    pub pairs: bool,
    /// Effects that are left out of the library (for leave-one-effect-out tests).
    pub without: Vec<String>,
    /// Effects of the user's own that are tried beside the library, by their numbers ([`effects::own()`]).
    pub own: Vec<usize>,
    /// Receives the progress of the diagnosis.
    pub progress: Progress,
    /// The base law; none: the spring-slider.
    pub law: Option<Arc<BaseLaw>>,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            constants: Arc::default(),
            pairs: true,
            without: Vec::new(),
            own: Vec::new(),
            progress: Progress::default(),
            law: None,
        }
    }
}

/// Rounds of the baseline's fit, and of its fit to what the gap looks like at large.
const ROUNDS: [usize; 2] = [15, 10];

/// Fits every hypothesis to a table.
pub fn fit_all(table: &Table, rig: &RigFile, options: &Options) -> Fitted {
    let k = &options.constants;
    let lasting = fit_believing(table, rig, options, &Belief::ByResidual);
    let ahead = lasting.best_evidence() - lasting.no_gap_evidence;
    if lasting.scatter.slow[0] == 0.0 || ahead < k.pairs_from_nats {
        return lasting;
    }
    // A cause that no surface follows leaves what looks like scatter that lasts. Whether it is shows in the best hypothesis.
    let mut alone = options.clone();
    Arc::make_mut(&mut alone.constants).slow_nats = f64::INFINITY;
    let mut independent = fit_believing(table, rig, &alone, &Belief::ByResidual);
    independent.problem.constants = options.constants.clone();
    let better = independent.best_evidence() + lasting.scatter.slow_cost > lasting.best_evidence();
    if better { independent } else { lasting }
}

/// The same with a belief about which passes belong.
pub fn fit_believing(table: &Table, rig: &RigFile, options: &Options, belief: &Belief) -> Fitted {
    let (k, progress) = (&*options.constants, &options.progress);
    progress.at("the table's own scatter", 0.0);
    let mut problem = Problem::new(table, rig, &options.constants).on(options.law.as_ref());
    let (discrepancy, pure, scatter) = settle(table, rig, &mut problem, belief);

    let start = minimise(&problem, &[], &[0.0; NUISANCES], &problem.variance, ROUNDS[0]);
    let basis = Basis::none(problem.len());
    let (no_gap_evidence, baseline) = averaged_over_form(&problem, &start.u, &[], &basis);
    let gap = &discrepancy.smooth - &baseline.prediction;
    let tempered = tempered(&problem, &gap, k.start_share);
    let nuisances = minimise(&problem, &[], &baseline.u, &tempered, ROUNDS[1]).u;

    let (tried, not_testable) = testable(&problem, table, rig, options);
    problem.own = tried.iter().copied().filter(|e| options.own.contains(e)).collect();
    let known: Vec<usize> = tried.iter().copied().chain(library().len()..effects::known().len()).collect();
    let kernels = Kernels::on(&problem, table, &known);
    let basis = kernels.at(&problem.passes);
    let search = Search { nuisances: &nuisances, tempered: &tempered, basis: &basis, progress };
    let mut candidates = singles(&problem, table, &tried, &search);
    let lapsed = lapsed(&mut problem, table, &mut candidates, &search);
    sort(&mut candidates);
    let leading = |candidates: &[Candidate]| {
        let mut list: Vec<_> =
            candidates.iter().map(|c| (c.names(), c.log_evidence - no_gap_evidence)).collect();
        list.sort_by(|a, b| b.1.total_cmp(&a.1));
        list
    };
    progress.with("causes that the library does not name", SINGLES_END, || leading(&candidates));
    let worth_pairs = |log_evidence: f64| log_evidence > no_gap_evidence + k.pairs_from_nats;
    let leader = candidates.first().filter(|c| worth_pairs(c.log_evidence));
    let gap = leader.is_some() || worth_pairs(discrepancy.log_evidence);
    if let (Belief::ByResidual, true, Some(other)) =
        (belief, gap, scatter.about_baseline(&problem, &baseline.prediction))
    {
        // Where a few passes that lie apart are all that the baseline does not explain, they are no gap.
        let without = fit_believing(table, rig, options, &other);
        if without.no_gap_probability > 0.5 {
            return without;
        }
    }
    if let (Belief::ByResidual, Some(leader)) = (belief, leader) {
        let departure = leader.best.departure_n(&basis);
        if let Some(other) = scatter.about_mean(&problem, &(&leader.best.prediction + departure)) {
            return fit_believing(table, rig, options, &other);
        }
    }
    let unlisted = unlisted(&problem, table, &search);

    if options.pairs && candidates.first().is_some_and(|c| worth_pairs(c.log_evidence)) {
        progress.with("pairs of effects", 0.6, || leading(&candidates));
        let companions = second_causes(&problem, &candidates, &lapsed, &search, discrepancy.log_evidence);
        sought_again(&problem, &mut candidates, &companions, &search);
        candidates.extend(companions);
    }
    let unweighed = if options.pairs { unweighed(&candidates) } else { Vec::new() };

    progress.with("what the library cannot say", 0.7, || leading(&candidates));
    // The open set: a smooth departure of any kind, or a cause of known form that the library does not name.
    let each = (k.unlisted_share / unlisted.len().max(1) as f64).ln();
    let mut open = vec![discrepancy.log_evidence + (1.0 - k.unlisted_share).ln()];
    open.extend(unlisted.iter().map(|c| c.log_evidence + each));
    let smooth = log_sum_exp(&open);
    let top = candidates.iter().map(|c| c.log_evidence).fold(smooth, f64::max);
    let structure =
        if no_gap_evidence > top - k.structure_asked_nats { structure(&problem, &baseline) } else { None };
    let shapes = shapes::shapes(&problem, &baseline, &scatter);
    let mut fitted = Fitted {
        shapes,
        problem,
        pure,
        scatter,
        baseline,
        no_gap_probability: 0.0,
        discrepancy,
        unlisted,
        structure,
        open_set_probability: 0.0,
        no_gap_evidence,
        smooth_evidence: log_sum_exp(&open),
        tried: tried.len(),
        candidates,
        unweighed,
        not_testable,
        kernels,
        basis,
    };
    fitted.weigh();
    clear_explained(&mut fitted);
    fitted
}

/// The causes that the table can show, and those that it cannot, each with the reason.
fn testable(
    problem: &Problem,
    table: &Table,
    rig: &RigFile,
    options: &Options,
) -> (Vec<usize>, Vec<(&'static str, String)>) {
    let (mut tried, mut not_testable) = (Vec::new(), Vec::new());
    for index in (0..library().len()).chain(options.own.iter().copied()) {
        let effect = effects::at(index);
        if options.without.iter().any(|n| n == effect.name) {
            continue;
        }
        let lacks = table.lacks(effect.needs).map(|because| certified(effect, rig).unwrap_or(because));
        match lacks.or_else(|| beyond(problem, table, effect)) {
            Some(because) => not_testable.push((effect.name, because)),
            None => tried.push(index),
        }
    }
    (tried, not_testable)
}

/// What the leading cause explains after all belongs; it counted for little, and is not called suspect.
fn clear_explained(fitted: &mut Fitted) {
    let surest = fitted.no_gap_probability.max(fitted.open_set_probability);
    let Some(c) = fitted.candidates.first().filter(|c| c.probability > surest) else { return };
    let (problem, inflation) = (&fitted.problem, &fitted.scatter.inflation);
    let explains = |row: usize| {
        let own = problem.whole_variance(row) / inflation[row];
        let left = problem.lateral[row] - c.best.mechanism[row];
        left.powi(2) < problem.constants.explained_sd.powi(2) * own
    };
    fitted.scatter.suspects.retain(|s| !explains(s.row));
}

/// Pairs of the single causes that are not among the candidates: all but those of one cause by two names.
fn unweighed(candidates: &[Candidate]) -> Vec<[usize; 2]> {
    let mut alone: Vec<usize> =
        candidates.iter().filter(|c| c.effects.len() == 1).map(|c| c.effects[0]).collect();
    alone.sort_unstable();
    let weighed: BTreeSet<&[usize]> = candidates.iter().map(|c| c.effects.as_slice()).collect();
    let name = |e: usize| effects::at(e).name;
    let pairs = alone.iter().enumerate().flat_map(|(i, &a)| alone[i + 1..].iter().map(move |&b| [a, b]));
    pairs.filter(|p| !weighed.contains(p.as_slice()) && !one_cause(name(p[0]), name(p[1]))).collect()
}

/// Why an effect of the user's own is not sought: its table ends before a pass, or changes all passes alike.
fn beyond(problem: &Problem, table: &Table, effect: &Effect) -> Option<String> {
    let own = effect.own?;
    let mu0 = problem.nominal.mu0;
    let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
    for (pass, point) in problem.passes.iter().zip(&table.points) {
        match own.factor(1.0, &Condition { mu0, ..*pass }) {
            Ok(factor) => (least, most) = (least.min(factor), most.max(factor)),
            Err(why) => {
                let (name, known) = (why.name, Some(why.value).filter(|value| !value.is_nan()));
                let value = known.map_or("not measured".into(), |value| format!("{value:.4e}"));
                return Some(format!("its table does not reach point {point}, where {name} is {value}"));
            }
        }
    }
    let alike = most - least < 1e-9;
    alike.then(|| format!("it changes friction by {:.3} at every pass, which mu_0 says as well", least - 1.0))
}

/// Why an effect is not sought that only an outside standard shows, where rig.toml states that calibration.
fn certified(effect: &Effect, rig: &RigFile) -> Option<String> {
    let standard = effect.needs.iter().any(|n| n.is_standard());
    let key = effect.laws.iter().filter(|_| standard).find_map(|law| law.certified_by)?;
    let sd = rig.calibration.sd(key)?;
    Some(format!(
        "an outside calibration leaves {sd:.1e} of the {} open, and that is part of the recalibrated baseline",
        key.words()
    ))
}

/// The members of the best pairs once more, each from where the pair has it: a single cause that was sought
/// in vain must not lose to a pair of which the second member does nothing.
fn sought_again(problem: &Problem, singles: &mut [Candidate], pairs: &[Candidate], search: &Search<'_>) {
    let mut ahead: Vec<_> = pairs.iter().filter(|p| p.log_evidence > singles[0].log_evidence).collect();
    ahead.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence).then(a.effects.cmp(&b.effects)));
    ahead.truncate(problem.constants.pairs_searched);
    let again: Vec<(f64, Posterior)> = ahead
        .par_iter()
        .flat_map_iter(|pair| {
            let layout = Layout::of(&pair.best.members);
            let u = &pair.best.u;
            (0..pair.best.members.len())
                .map(move |i| (pair.best.members[i], [&u[..NUISANCES], &u[layout.member(i)]].concat()))
        })
        .map(|(member, u)| {
            let fit = minimise(problem, &[member], &u, search.tempered, ROUNDS[1]);
            averaged_over_form(problem, &fit.u, &[member], search.basis)
        })
        .collect();
    for (evidence, found) in again {
        if let Some(own) = singles.iter_mut().find(|c| c.effects == [found.members[0].effect]) {
            own.law_found(evidence, found);
        }
    }
}

/// Pairs, where the best single leaves something by its law: one that leaves nothing needs no second cause,
/// unless it is the stiffnesses that took it up, or the open set is ahead of it: what it leaves may be less
/// than runs shift by. What a function that may be any took up beside the law may be a second cause.
fn second_causes(
    problem: &Problem,
    singles: &[Candidate],
    lapsed: &[usize],
    search: &Search<'_>,
    open: f64,
) -> Vec<Candidate> {
    let best = singles[0].best.by_law();
    let behind = open - singles[0].log_evidence;
    let misfit = problem.misfit(&best.mechanism) + best.pull();
    let n = problem.len() as f64;
    let k = &problem.constants;
    if misfit <= n + k.misfit_sd * (2.0 * n).sqrt() && behind < k.pairs_from_nats {
        return Vec::new();
    }
    let mut grown = pairs(problem, singles, search.tempered, search.basis);
    for pair in &mut grown {
        // A pair pays for the certificates that it frees as its members do alone.
        let freed = pair.effects.iter().filter(|e| lapsed.contains(e)).count();
        pair.log_evidence += freed as f64 * problem.constants.lapse_probability.ln();
    }
    grown
}
