//! From probabilities to a [`Verdict`] and its alias class; the report of it is in `report.rs`.
//! docs/diagnosis/model.md, section 9.
//!
//! [`decide`] takes the steps in the order of that page:
//!
//! 1. `fold_pairs`: a pair that says little more than a member gives its weight to it.
//! 2. `judged`: the leader predicts regions that it has not seen ([`crate::verdict::left_out`]).
//! 3. What survives of the probabilities; the rest goes to the open set.
//! 4. `alias_class`, `departed_singles`, `placed_singles`, `renamed`: what the table does not separate from
//!    the leader.
//! 5. `doubted`: the share of the chance that the method errs.
//! 6. The verdict.
//!
//! The leader is the most probable cause or pair after step 1; its class begins with it. Evidence is never
//! changed here.

pub mod left_out;

use crate::hypotheses::{Candidate, Fitted};
use crate::regression::{Bends, Freedom, Posterior, laplace};
use crate::verdict::left_out::{Region, RegionScore, left_out_regions, score_of};
use effects::{Input, imitated, one_cause};
use models::covariate::POSITION;
use rayon::prelude::*;

/// The four answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The recalibrated baseline explains the table.
    NoGap,
    /// One effect, or one pair, causes most of the gap.
    Named,
    /// The table cannot separate the leading hypotheses.
    Ambiguous,
    /// No effect of the library causes most of the gap.
    Unknown,
}

/// The decision and what it rests on.
pub struct Decision {
    /// The answer.
    pub verdict: Verdict,
    /// Probability of no gap, after the regions have spoken.
    pub none: f64,
    /// Probability of the open set, after the regions have spoken.
    pub unknown: f64,
    /// Probabilities of the candidates, in their order, after the regions have spoken.
    pub probabilities: Vec<f64>,
    /// Probabilities of the pairs that were not weighed, in their order.
    pub unweighed: Vec<f64>,
    /// Indices of the leader's alias class among the candidates, the leader first; empty where no effect could be tried.
    pub class: Vec<usize>,
    /// Deviations of chi2 that a leading pair leaves, where that alone keeps it from a name.
    pub misfit: Option<f64>,
    /// What the left-out regions say about the leader.
    pub score: RegionScore,
    /// Those regions.
    pub regions: Vec<Region>,
}

impl Decision {
    /// Index of the leading candidate; none where no effect could be tried.
    pub fn leader(&self) -> Option<usize> {
        self.class.first().copied()
    }

    /// Every cause and pair, weighed or not, with its probability.
    pub fn stated<'a>(&'a self, fitted: &'a Fitted) -> impl Iterator<Item = (&'a [usize], f64)> {
        let weighed = fitted.candidates.iter().map(|c| c.effects.as_slice()).zip(&self.probabilities);
        let others = fitted.unweighed.iter().map(|pair| pair.as_slice()).zip(&self.unweighed);
        weighed.chain(others).map(|(effects, p)| (effects, *p))
    }
}

/// Rounds of the search for a cause's mode with a form of its own.
const OWN_FORM_ROUNDS: usize = 6;
/// Probability below which a pair is not looked at.
const LEAST_PROBABILITY: f64 = 1e-6;

/// Decides; the leading cause gets the law that stands for it.
pub fn decide(fitted: &mut Fitted) -> Decision {
    fitted.weigh();
    let mut probabilities: Vec<f64> = fitted.candidates.iter().map(|c| c.probability).collect();
    let (none, mut unknown) = (fitted.none_probability, fitted.unknown_probability);
    fold_pairs(fitted, &mut probabilities);
    // Candidates come in the order of their own probability, which decides where all are too small for a number.
    let leading = (0..probabilities.len())
        .max_by(|&a, &b| probabilities[a].total_cmp(&probabilities[b]).then(b.cmp(&a)));
    let Some(leader) = leading else {
        // No effect could be tried: there is a gap of an unknown cause, or none.
        let k = &fitted.problem.constants;
        let verdict = if none < k.claim_probability { Verdict::Unknown } else { Verdict::NoGap };
        let (unweighed, class, regions) = (Vec::new(), Vec::new(), Vec::new());
        let (score, misfit) = (score_of(k, &[]), None);
        return Decision { verdict, none, unknown, probabilities, unweighed, class, misfit, score, regions };
    };
    let claimed = none < fitted.problem.constants.claim_probability;
    let (regions, judged, survival) = judged(fitted, leader, claimed);
    let fitted = &*fitted;
    let survival = survival * by_its_law(fitted, leader);
    let (k, candidates) = (&*fitted.problem.constants, &fitted.candidates);
    if claimed {
        // An effect that cannot predict what it has not seen is no cause: its weight goes to the open set.
        for p in &mut probabilities {
            unknown += *p * (1.0 - survival);
            *p *= survival;
        }
    }
    let mut class = alias_class(fitted, leader);
    let departed = departed_singles(fitted, leader);
    let joined = joined(fitted, leader);
    let renamed = renamed(fitted, leader, &class);
    let alone = k.alone_share[usize::from(candidates[leader].effects.len() > 1)];
    // Priors alone make no name: a rival whose forces are the same must differ in the data.
    let distinct = imitated(&candidates[leader].names()).is_none()
        && class[1..].iter().all(|&i| !same_forces(fitted, leader, i))
        && departed.is_empty()
        && renamed.is_empty();
    class.extend(departed);
    class.extend(joined);
    let of = |class: &[usize], p: &[f64]| class.iter().map(|&i| p[i]).sum::<f64>();
    // Half of the gap at least, whatever the evidence says.
    let closes = judged.pooled >= k.region_closed;
    let leads = closes && probabilities[leader] >= alone * of(&class, &probabilities);
    let leaves = leaves_sd(fitted, &candidates[leader].best);
    // Two causes can imitate nearly any gap: where they leave a misfit, they are seldom the true ones.
    let whole = candidates[leader].effects.len() < 2 || leaves < k.pair_leaves_sd;
    let (none, unknown, unweighed) = doubted(fitted, none, unknown, &mut probabilities);
    let in_class = of(&class, &probabilities);
    let name = distinct && leads && in_class >= k.name_probability;
    let verdict = if !claimed || none >= in_class.max(unknown) {
        Verdict::NoGap
    } else if unknown >= in_class {
        Verdict::Unknown
    } else if name && whole {
        Verdict::Named
    } else {
        Verdict::Ambiguous
    };
    class.extend(renamed.into_iter().filter(|_| verdict == Verdict::Ambiguous));
    let misfit = (verdict == Verdict::Ambiguous && name).then_some(leaves);
    Decision { verdict, none, unknown, probabilities, unweighed, class, misfit, score: judged, regions }
}

/// Probabilities with the chance that the method errs and does not see it: none is then surer than verdicts
/// on labelled sets have been right, and none is 1e-40, nor nothing for a pair that was not weighed. What no
/// hypothesis explains may be a cause of the library all the same, in a form that neither its laws nor a
/// function beside them reach: a share of the open set goes to the causes.
fn doubted(fitted: &Fitted, none: f64, unknown: f64, probabilities: &mut [f64]) -> (f64, f64, Vec<f64>) {
    let k = &fitted.problem.constants;
    let coarse = fitted.coarse();
    let mixed = |p: f64, coarse: f64| (1.0 - k.doubt) * p + k.doubt * coarse;
    let (none, unknown) = (mixed(none, coarse.no_gap), mixed(unknown, coarse.open));
    let causes = coarse.each.iter().chain(&coarse.unweighed).sum::<f64>().max(f64::MIN_POSITIVE);
    let foreign = if probabilities.is_empty() { 0.0 } else { k.foreign_form * unknown };
    let stated = |p: f64, coarse: f64| mixed(p, coarse) + foreign * coarse / causes;
    probabilities.iter_mut().zip(&coarse.each).for_each(|(p, &coarse)| *p = stated(*p, coarse));
    (none, unknown - foreign, coarse.unweighed.iter().map(|&coarse| stated(0.0, coarse)).collect())
}

/// The leader on the left-out regions. Of its laws that the evidence does not tell apart the one that
/// predicts best what it has not seen stands for the cause: which of them is a tenth of a nat ahead is no
/// ground to doubt the cause. Where no gap is claimed there is nothing to choose for. The last number is the
/// share of the probability that survives.
fn judged(fitted: &mut Fitted, leader: usize, claimed: bool) -> (Vec<Region>, RegionScore, f64) {
    let k = fitted.problem.constants.clone();
    let own = &fitted.candidates[leader];
    let (effects, lead) = (own.effects.len(), fitted.lead(own));
    let top = own.laws.iter().map(|(e, _)| *e).fold(f64::NEG_INFINITY, f64::max);
    let near = own.laws.iter().filter(|(e, _)| claimed && *e > top - k.alias_nats);
    let mut laws: Vec<Posterior> = near.map(|(_, law)| law.clone()).collect();
    if laws.is_empty() {
        laws.push(own.best.clone());
    }
    let judge = |law: Posterior| {
        let regions = left_out_regions(fitted, &law);
        let score = score_of(&k, &regions);
        (score.survival(&k, effects, lead), law, regions, score)
    };
    let all = laws.into_iter().map(judge);
    let (survival, law, regions, score) =
        all.reduce(|a, b| if b.0 > a.0 { b } else { a }).expect("a candidate has a law");
    fitted.candidates[leader].best = law;
    (regions, score, survival)
}

/// The share of its probability that a bent leader keeps: the name is that of a law, and a function that may
/// be any fits what no law of the cause makes. All where the law takes up enough of the gap alone.
fn by_its_law(fitted: &Fitted, leader: usize) -> f64 {
    let (best, gap) = (&fitted.candidates[leader].best, left(fitted, &fitted.none));
    // What changes the friction coefficient alone may be any function.
    let elsewhere = |effect: usize| effects::at(effect).acts.is_none_or(|acts| acts.on != Input::Friction);
    if best.freedom.bends == Bends::Size && best.members.iter().any(|m| elsewhere(m.effect)) {
        return 1.0;
    }
    let Some(law) = best.plain.as_deref().filter(|_| gap > 0.0) else { return 1.0 };
    let taken = 1.0 - left(fitted, law) / gap;
    (taken / fitted.problem.constants.bent_law_takes).clamp(0.0, 1.0)
}

/// The leader and every hypothesis of its size that the data does not tell from it.
fn alias_class(fitted: &Fitted, leader: usize) -> Vec<usize> {
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
fn departed_singles(fitted: &Fitted, leader: usize) -> Vec<usize> {
    let candidates = &fitted.candidates;
    let (k, own) = (&*fitted.problem.constants, &candidates[leader]);
    if own.effects.len() < 2 {
        return placed_singles(fitted, own);
    }
    let gap = left(fitted, &fitted.none);
    let might = |i: usize| {
        let best = &candidates[i].best;
        best.freedom.bend > 0.0 && best.freedom.bends == Bends::Size && leaves_sd(fitted, best) < k.misfit_sd
            || own.log_evidence - candidates[i].log_evidence < k.pair_own_form_nats
                && left_by_a_form_of_its_own(fitted, &candidates[i]) < k.pair_departure.powi(2) * gap
    };
    let member = |c: &Candidate| c.effects.len() == 1 && own.effects.contains(&c.effects[0]);
    (0..candidates.len()).filter(|&i| member(&candidates[i]) && might(i)).collect()
}

/// Pairs of a leading single cause and a second one that gains too much for a companion by chance, as far as
/// the table does not tell which.
fn joined(fitted: &Fitted, leader: usize) -> Vec<usize> {
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
fn left_by_a_form_of_its_own(fitted: &Fitted, cause: &Candidate) -> f64 {
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

/// chi2 that a model leaves beyond scatter.
fn left(fitted: &Fitted, model: &Posterior) -> f64 {
    fitted.problem.misfit(&model.mechanism) - fitted.problem.len() as f64
}

/// The same in deviations of chi2.
fn leaves_sd(fitted: &Fitted, model: &Posterior) -> f64 {
    left(fitted, model) / (2.0 * fitted.problem.len() as f64).sqrt()
}

/// The leader by another name, where the data hardly tell which: a tilt and a cross-talk differ in the second
/// order, where neither's form is known.
fn renamed(fitted: &Fitted, leader: usize, class: &[usize]) -> Vec<usize> {
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
fn same_forces(fitted: &Fitted, leader: usize, rival: usize) -> bool {
    let [a, b] = [leader, rival].map(|i| &fitted.candidates[i].best);
    let apart = fitted.problem.chi2(&(&a.mechanism - &b.mechanism));
    b.u.len() <= a.u.len() && apart < fitted.problem.constants.same_forces_chi2
}

/// A pair that says little more than one of its members alone may be that single with a form of its own: a
/// share of its weight, a smaller one where it gains much, goes to such members, and to singles that do better
/// than they, in proportion to their evidence.
fn fold_pairs(fitted: &Fitted, probabilities: &mut [f64]) {
    let k = &fitted.problem.constants;
    let candidates = &fitted.candidates;
    // What the stiffnesses took up is gap too.
    let gap = left(fitted, &fitted.none) + fitted.none.pull();
    let judged = |&i: &usize| candidates[i].effects.len() > 1 && probabilities[i] >= LEAST_PROBABILITY;
    let pairs: Vec<(usize, Vec<usize>)> =
        (0..candidates.len()).filter(judged).map(|pair| (pair, says_as_much(fitted, pair, gap))).collect();
    // Partners that the table does not tell apart stand or fall together.
    let stands = |pair: usize| {
        let alike = |other: &usize| {
            let [a, b] = [pair, *other].map(|i| &candidates[i]);
            a.effects.iter().any(|e| b.effects.contains(e))
                && (a.log_evidence - b.log_evidence).abs() < k.alias_nats
        };
        pairs.iter().filter(|(_, alone)| alone.is_empty()).any(|(other, _)| alike(other))
    };
    for (pair, alone) in pairs.iter().filter(|(pair, _)| !stands(*pair)) {
        let (pair, own) = (*pair, &candidates[*pair]);
        let Some(best) = alone.iter().map(|&i| candidates[i].log_evidence).reduce(f64::max) else { continue };
        // Another single that does better than these is the better short word for what the pair says.
        let mut heirs = alone.clone();
        heirs.extend((0..candidates.len()).filter(|&i| {
            let c = &candidates[i];
            c.effects.len() == 1 && !own.effects.contains(&c.effects[0]) && c.log_evidence > best
        }));
        let evidence: Vec<f64> = heirs.iter().map(|&i| candidates[i].log_evidence / k.temper).collect();
        let total = crate::regression::gaussian::log_sum_exp(&evidence);
        let weight =
            probabilities[pair] * k.pair_folded[usize::from(own.log_evidence - best > k.pair_folded_nats)];
        probabilities[pair] -= weight;
        for (i, e) in heirs.iter().zip(&evidence) {
            probabilities[*i] += weight * (e - total).exp();
        }
    }
}

/// The members of a pair that alone say nearly as much as it does, of a gap of this chi2.
fn says_as_much(fitted: &Fitted, pair: usize, gap: f64) -> Vec<usize> {
    let problem = &fitted.problem;
    let k = &problem.constants;
    let candidates = &fitted.candidates;
    let own = &candidates[pair];
    let own_left = left(fitted, &own.best);
    let as_much = |i: &usize| {
        let c = &candidates[*i];
        if c.effects.len() != 1 || !own.effects.contains(&c.effects[0]) {
            return false;
        }
        let gain = own.log_evidence - c.log_evidence;
        let c_left = left(fitted, &c.best);
        let misfit = leaves_sd(fitted, &c.best) > k.misfit_sd;
        let needed = misfit && own_left < k.pair_halves * c_left && gain > k.pair_nats;
        // Or the pair leaves nothing that the scatter does not, and the single cause does.
        let complete = misfit && leaves_sd(fitted, &own.best) < k.pair_complete_sd;
        let large = 2.0 * gain >= k.pair_gain_share * gap;
        let pulled = c.best.pull() > own.best.pull() + k.pair_pull_chi2;
        !(pulled || needed || gain > k.pair_least_nats && (large || complete))
    };
    (0..candidates.len()).filter(as_much).collect()
}

#[cfg(test)]
mod tests {
    use super::Verdict;
    use crate::tests::{Deviates, rig, table};
    use crate::{Options, diagnose};
    use models::PeakToPeak;

    fn no_effects() -> Options {
        let without = effects::library().iter().map(|e| e.name.to_string()).collect();
        Options { without, ..Options::default() }
    }

    /// With nothing to try the answer is `no_gap` or `unknown`, with a remark, and no model but the baseline's.
    #[test]
    fn a_library_without_effects_gives_an_answer() {
        for (exponent, wanted) in [(0.0, Verdict::NoGap), (0.6, Verdict::Unknown)] {
            let table = table(&mut Deviates(5), exponent);
            let result = diagnose(&table, &rig(), &no_effects(), String::new());
            assert_eq!(result.report.verdict, wanted, "exponent {exponent}: {}", result.report.text);
            assert!(result.report.remarks.iter().any(|r| r.contains("could be tried")));
            let sum: f64 = result.report.hypotheses.iter().map(|h| h.probability).sum();
            assert!((sum - 1.0).abs() < 1e-9, "{sum}");
            assert_eq!(result.saved_model().is_some(), wanted == Verdict::NoGap);
            assert!(
                result
                    .predict(&table)
                    .unwrap()
                    .iter()
                    .all(|f| f.corrected.is_finite() && f.corrected_sd > 0.0)
            );
        }
    }

    /// Of a gap of several hundred nats the true cause is named, at no more than the method's doubt leaves,
    /// and no cause is ruled out altogether.
    #[test]
    fn a_name_leaves_room_for_doubt() {
        let table = table(&mut Deviates(5), 0.6);
        let report = diagnose(&table, &rig(), &Options::default(), String::new()).report;
        let of = |name: &str| report.hypotheses.iter().find(|h| h.effects == [name]).unwrap().probability;
        assert_eq!(report.verdict, Verdict::Named, "{}", report.text);
        assert!((0.9..0.9999).contains(&of("rate_dependent_friction")), "{}", report.text);
        let least = report.hypotheses.iter().map(|h| h.probability).fold(1.0, f64::min);
        assert!(least > 1e-30, "{least:e}");
        let sum: f64 = report.hypotheses.iter().map(|h| h.probability).sum();
        assert!((sum - 1.0).abs() < 1e-9, "{sum}");
    }

    /// A second cause that gains more than chance does, but not enough for a name, keeps the first from being
    /// named alone: another form of the first would do the same.
    #[test]
    fn a_small_second_cause_is_in_the_class() {
        let mut table = table(&mut Deviates(5), 0.6);
        for (lateral, pass) in table.lateral.iter_mut().zip(&table.passes) {
            *lateral *= 1.0 - 0.07 * (pass.amplitude.metres() / 3e-6);
        }
        let report = diagnose(&table, &rig(), &Options::default(), String::new()).report;
        assert_eq!(report.verdict, Verdict::Ambiguous, "{}", report.text);
        assert!(report.text.contains("cannot separate rate dependent friction, "), "{}", report.text);
        assert_eq!(report.at_least, ["rate_dependent_friction"]);
        let first = &report.hypotheses[0];
        assert_eq!(first.effects, ["rate_dependent_friction"], "{}", report.text);
        assert!(first.alias_class.len() > 1, "{:?}", first.alias_class);
        assert!(first.alias_class[1..].iter().all(|name| name.contains('+')), "{:?}", first.alias_class);
    }

    /// Values at the ends of what a table may hold give an answer too.
    #[test]
    fn values_at_the_ends_of_their_range_give_an_answer() {
        type Change = fn(&mut models::condition::Condition, &mut f64);
        let changes: [(&str, Change); 5] = [
            ("lateral force", |_, l| *l = 500.0),
            ("normal force", |p, _| p.normal_force_n = 500.0),
            ("frequency", |p, _| p.frequency_hz = 1e7),
            ("amplitude", |p, _| p.amplitude = PeakToPeak::from_metres(1e-3)),
            ("speed", |p, _| p.speed_m_s = 100.0),
        ];
        for (what, change) in changes {
            let mut table = table(&mut Deviates(5), 0.0);
            change(&mut table.passes[3], &mut table.lateral[3]);
            let report =
                diagnose(&table, &rig(), &Options { pairs: false, ..Options::default() }, String::new())
                    .report;
            let sum: f64 = report.hypotheses.iter().map(|h| h.probability).sum();
            assert!((sum - 1.0).abs() < 1e-9, "{what}: {sum}");
        }
    }
}
