//! The alias class: what the table does not tell from the leader. docs/diagnosis/model.md, section 9, step 4.

use super::{residual_chi2, residual_sd};
use crate::hypotheses::{Candidate, Fitted};
use crate::regression::{Bends, Freedom, laplace};
use effects::one_cause;
use models::covariate::POSITION;
use rayon::prelude::*;

/// Rounds of the search for a cause's mode with a form of its own.
const OWN_FORM_ROUNDS: usize = 6;

/// The leader and every hypothesis of its size that the data does not tell from it.
pub(super) fn alias_class(fitted: &Fitted, leader: usize) -> Vec<usize> {
    let k = &fitted.problem.constants;
    let candidates = &fitted.candidates;
    let mut class = vec![leader];
    let own = &candidates[leader];
    class.extend((0..candidates.len()).filter(|&i| {
        let behind = own.log_evidence - candidates[i].log_evidence;
        i != leader
            && candidates[i].effects.len() == own.effects.len()
            && (behind < k.alias_nats || behind < k.prior_nats && same_forces(fitted, leader, i))
    }));
    class
}

/// Members of a leading pair that may be the only cause, with a form of their own: alone one leaves no misfit
/// where its size is a function of place or weather; or the evidence for the second is small, and a smooth
/// departure from the library's form, as large as known forms depart, leaves little of the gap. Such a second
/// cause cannot be separated from another form of the first.
pub(super) fn departed_singles(fitted: &Fitted, leader: usize) -> Vec<usize> {
    let candidates = &fitted.candidates;
    let (k, own) = (&*fitted.problem.constants, &candidates[leader]);
    if own.effects.len() < 2 {
        return placed_singles(fitted, own);
    }
    let gap = residual_chi2(fitted, &fitted.baseline);
    let might = |i: usize| {
        let best = &candidates[i].best;
        best.freedom.bend > 0.0
            && best.freedom.bends == Bends::Size
            && residual_sd(fitted, best) < k.misfit_sd
            || own.log_evidence - candidates[i].log_evidence < k.pair_own_form_nats
                && residual_with_own_form(fitted, &candidates[i]) < k.pair_departure.powi(2) * gap
    };
    let member = |c: &Candidate| c.effects.len() == 1 && own.effects.contains(&c.effects[0]);
    (0..candidates.len()).filter(|&i| member(&candidates[i]) && might(i)).collect()
}

/// Pairs of a leading single cause and a second one that gains too much for a companion by chance, as far as
/// the table does not tell which.
pub(super) fn with_companions(fitted: &Fitted, leader: usize) -> Vec<usize> {
    let (k, own) = (&fitted.problem.constants, &fitted.candidates[leader]);
    let with_it =
        |c: &Candidate| own.effects.len() == 1 && c.effects.len() > 1 && c.effects.contains(&own.effects[0]);
    let pairs: Vec<(usize, f64)> = (0..)
        .zip(&fitted.candidates)
        .filter(|(_, c)| with_it(c))
        .map(|(i, c)| (i, c.log_evidence - own.log_evidence))
        .collect();
    let most = pairs.iter().map(|(_, gain)| *gain).fold(f64::NEG_INFINITY, f64::max);
    let least = k.pair_folded_nats.max(most - k.alias_nats);
    pairs.into_iter().filter(|(_, gain)| *gain > least).map(|(i, _)| i).collect()
}

/// Of a leader whose size is a function of the place: the causes that go with the place by their mechanism,
/// where the evidence for the function is small.
fn placed_singles(fitted: &Fitted, own: &Candidate) -> Vec<usize> {
    let sized = own.best.freedom.bends == Bends::Size && own.best.change.bends_over(&POSITION);
    let by_mechanism = |c: &Candidate| {
        let over = effects::at(c.effects[0]).acts.map_or(&[][..], |acts| acts.over);
        c.effects.len() == 1 && c.effects != own.effects && over.iter().any(|c| c.name == POSITION.name)
    };
    let near =
        |c: &Candidate| own.log_evidence - c.log_evidence < fitted.problem.constants.pair_own_form_nats;
    let all = fitted.candidates.iter().enumerate();
    all.filter(|(_, c)| sized && by_mechanism(c) && near(c)).map(|(i, _)| i).collect()
}

/// chi2 beyond scatter that the best of a cause's laws leaves with a smooth departure of the largest share.
fn residual_with_own_form(fitted: &Fitted, cause: &Candidate) -> f64 {
    let problem = &fitted.problem;
    let freedom = Freedom::share(problem.constants.form_shares[2]);
    let laws = cause
        .laws
        .par_iter()
        .map(|(_, law)| laplace(problem, &law.members, &law.u, &fitted.basis, freedom, OWN_FORM_ROUNDS));
    let Some(best) = laws.max_by(|a, b| a.log_evidence.total_cmp(&b.log_evidence)) else {
        return f64::INFINITY;
    };
    problem.misfit(&(&best.prediction + best.departure_n(&fitted.basis))) - problem.len() as f64
}

/// The leader by another name, where the data hardly tell which: a tilt and a cross-talk differ in the second
/// order, where neither's form is known.
pub(super) fn renamed(fitted: &Fitted, leader: usize, class: &[usize]) -> Vec<usize> {
    let own = &fitted.candidates[leader];
    let alike = |c: &Candidate| {
        let same = |a: &str| c.names().iter().any(|b| a == *b || one_cause(a, b));
        c.effects.len() == own.effects.len() && own.names().iter().all(|a| same(a))
    };
    let near = |c: &Candidate| own.log_evidence - c.log_evidence < fitted.problem.constants.prior_nats;
    let all = fitted.candidates.iter().enumerate();
    all.filter(|(i, c)| !class.contains(i) && near(c) && alike(c)).map(|(i, _)| i).collect()
}

/// Whether a rival says the same as the leader with no more parameters.
pub(super) fn same_forces(fitted: &Fitted, leader: usize, rival: usize) -> bool {
    let [a, b] = [leader, rival].map(|i| &fitted.candidates[i].best);
    let apart = fitted.problem.chi2(&(&a.mechanism - &b.mechanism));
    b.u.len() <= a.u.len() && apart < fitted.problem.constants.same_forces_chi2
}
