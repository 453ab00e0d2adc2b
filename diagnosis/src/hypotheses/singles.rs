//! One effect at a time: every law sought, then put together. docs/diagnosis/model.md, section 4.

use crate::data::Table;
use crate::hypotheses::Candidate;
use crate::progress::Progress;
use crate::regression::{
    Basis, Bends, Fit, Member, Posterior, Problem, REFINED_ROWS, Sought, averaged_over_form, laplace,
    log_sum_exp, middle_freedom, nuisance_starts, seek,
};
use effects::{known, library};
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Share of the work after which single effects are fitted.
pub(crate) const SINGLES_END: f64 = 0.5;
/// Rounds of the search for a mode at the middle share of form uncertainty.
const ROUNDS: usize = 6;
/// The same from a place that was refined on a part of a large table.
const ROUNDS_FROM_A_PART: usize = 3;
/// Factor on the best tempered cost of a law, and offset, within which its other optima are looked at.
const NEAR_OPTIMA: (f64, f64) = (1.2, 10.0);

/// Factor on what is hopeless beyond which the first rounds of a fit are its last.
const OUTRUN: f64 = 2.0;

/// What the searches share: where the nuisances start, tempered variances, and the form's basis.
pub(crate) struct Search<'a> {
    pub nuisances: &'a [f64],
    pub tempered: &'a [f64],
    pub basis: &'a Basis,
    /// Receives the progress of the search.
    pub progress: &'a Progress,
}

/// Each effect in all its laws, in the order given; without those that cannot be fitted.
pub(crate) fn singles(
    problem: &Problem,
    table: &Table,
    effects: &[usize],
    search: &Search<'_>,
) -> Vec<Candidate> {
    let usable = |&effect: &usize| {
        // Laws whose covariate this table lacks are not tried.
        let laws = effects::at(effect).laws.iter().enumerate();
        let shown = laws.filter(|(_, form)| table.lacks(form.needs).is_none());
        shown.map(move |(law, _)| Member { effect, law })
    };
    let members: Vec<Member> = effects.iter().flat_map(usable).collect();
    let laws = each_law(problem, &members, search);
    let of_effect = |effect: usize| -> Vec<(f64, Posterior)> {
        members.iter().zip(&laws).filter(|(m, _)| m.effect == effect).filter_map(|(_, l)| l.clone()).collect()
    };
    effects.iter().filter_map(|&effect| candidate(vec![effect], of_effect(effect))).collect()
}

/// Causes of known form that the library does not name, best first.
pub(crate) fn unlisted(problem: &Problem, table: &Table, search: &Search<'_>) -> Vec<Candidate> {
    let testable = |&e: &usize| table.lacks(effects::at(e).needs).is_none();
    let effects: Vec<usize> = (library().len()..known().len()).filter(testable).collect();
    let mut list = singles(problem, table, &effects, search);
    sort(&mut list);
    list
}

/// Effects whose certificate no longer holds: freed in the problem, and with the evidence of their own prior.
///
/// What a certificate says holds unless the table speaks against it by more than such an accident is rare:
/// then the effect has its own prior again, here and in all that follows.
pub(crate) fn lapsed(
    problem: &mut Problem,
    table: &Table,
    candidates: &mut [Candidate],
    search: &Search<'_>,
) -> Vec<usize> {
    let certified = |e: usize| problem.certified.iter().any(|(c, _)| c.effect == e);
    let bounded: Vec<usize> = candidates.iter().map(|c| c.effects[0]).filter(|&e| certified(e)).collect();
    if bounded.is_empty() {
        return Vec::new();
    }
    let free = Problem { certified: Vec::new(), ..problem.clone() };
    let mut list = Vec::new();
    for mut other in singles(&free, table, &bounded, search) {
        other.log_evidence += problem.constants.lapse_probability.ln();
        let effect = other.effects[0];
        let own = candidates.iter_mut().find(|c| c.effects[0] == effect);
        if let Some(own) = own.filter(|own| other.log_evidence > own.log_evidence) {
            problem.certified.retain(|(m, _)| m.effect != effect);
            list.push(effect);
            *own = other;
        }
    }
    list
}

/// Every law alone: its log evidence over the shares of form uncertainty, and its best solution.
fn each_law(problem: &Problem, members: &[Member], search: &Search<'_>) -> Vec<Option<(f64, Posterior)>> {
    // Middle share first, for every law; the other shares where they could matter. Laws cost from one
    // millisecond to two hundred: each is a task of its own.
    let k = &*problem.constants;
    let done = AtomicUsize::new(0);
    // The search for unlisted causes runs last; they count for the rest.
    let report = |of: f64| {
        let n = done.fetch_add(1, Ordering::Relaxed) + 1;
        search.progress.at("single effects", of * n as f64 / (2 * members.len()).max(1) as f64);
    };
    let sought: Vec<Vec<Sought>> = members
        .par_iter()
        .with_max_len(1)
        .map(|member| {
            let fixed = nuisance_starts(search.nuisances, k.driven_sd);
            let sought = fixed.iter().map(|fixed| seek(problem, *member, fixed, search.tempered)).collect();
            report(SINGLES_END);
            sought
        })
        .collect();
    let ahead = sought.iter().flatten().map(Sought::cost).fold(f64::INFINITY, f64::min);
    let outrun = |cost: f64| cost > OUTRUN * (k.hopeless[0] * ahead + k.hopeless[1]);
    let starts: Vec<Vec<Fit>> = members
        .par_iter()
        .zip(sought)
        .with_max_len(1)
        .map(|(member, sought)| {
            let finish = |s: Sought| {
                if outrun(s.cost()) {
                    s.as_it_is(problem, *member, search.tempered)
                } else {
                    s.finished(problem, *member, search.tempered)
                }
            };
            let mut fits: Vec<Fit> = sought.into_iter().flat_map(finish).collect();
            fits.sort_by(|a, b| a.cost.total_cmp(&b.cost));
            report(SINGLES_END);
            fits
        })
        .collect();
    let cheapest = starts.iter().flatten().map(|f| f.cost).fold(f64::INFINITY, f64::min);
    let most = if problem.len() > REFINED_ROWS { ROUNDS_FROM_A_PART } else { ROUNDS };
    let middle: Vec<Option<Posterior>> = members
        .par_iter()
        .zip(&starts)
        .with_max_len(1)
        .map(|(member, fits)| {
            let own = fits.first()?.cost;
            // What lies far behind even on the tempered scale gets one look, not a search.
            let rounds = if own > k.hopeless[0] * cheapest + k.hopeless[1] { 0 } else { most };
            fits.iter()
                .filter(|f| rounds > 0 || f.cost == own)
                .filter(|f| f.cost < NEAR_OPTIMA.0 * own + NEAR_OPTIMA.1)
                .map(|f| {
                    laplace(problem, &[*member], &f.u, search.basis, middle_freedom(k, &[*member]), rounds)
                })
                .max_by(|a, b| a.log_evidence.total_cmp(&b.log_evidence))
        })
        .collect();
    let top = middle.iter().flatten().map(|e| e.log_evidence).fold(f64::NEG_INFINITY, f64::max);
    let weighed = sized(problem, &middle, search.basis);
    middle
        .into_par_iter()
        .enumerate()
        .with_max_len(1)
        .map(|(i, found)| {
            found.map(|e| {
                if e.log_evidence > top - k.prune_nats || weighed.contains(&i) {
                    averaged_over_form(problem, &e.u, &e.members, search.basis)
                } else {
                    (e.log_evidence + k.form_weights[1].ln(), e)
                }
            })
        })
        .collect()
}

/// Laws that are weighed however far behind they are, for their size may be a function of the place or the
/// weather: the best law of each of the best causes.
fn sized(problem: &Problem, middle: &[Option<Posterior>], basis: &Basis) -> Vec<usize> {
    let mut best: Vec<_> = middle.iter().enumerate().filter_map(|(i, e)| Some((i, e.as_ref()?))).collect();
    best.retain(|(_, e)| basis.bends(&e.members, Bends::Size));
    best.sort_by(|a, b| b.1.log_evidence.total_cmp(&a.1.log_evidence));
    let mut seen = BTreeSet::new();
    best.retain(|(_, e)| seen.insert(e.members[0].effect));
    best.into_iter().take(problem.constants.pair_seeds).map(|(i, _)| i).collect()
}

fn candidate(effects: Vec<usize>, laws: Vec<(f64, Posterior)>) -> Option<Candidate> {
    let best = laws.iter().max_by(|a, b| a.0.total_cmp(&b.0))?.1.clone();
    let evidences: Vec<f64> = laws.iter().map(|l| l.0).collect();
    let log_evidence = log_sum_exp(&evidences) - (laws.len() as f64).ln();
    log_evidence.is_finite().then(|| Candidate::new(effects, log_evidence, best, laws))
}

/// Best first.
pub(crate) fn sort(candidates: &mut [Candidate]) {
    candidates.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence).then(a.effects.cmp(&b.effects)));
}
