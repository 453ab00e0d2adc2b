//! Pairs that say little more than a member of theirs. docs/diagnosis/model.md, section 9, step 1.

use super::{residual_chi2, residual_sd};
use crate::hypotheses::Fitted;

/// Probability below which a pair is not looked at.
const LEAST_PROBABILITY: f64 = 1e-6;

/// A pair that says little more than one of its members alone may be that single with a form of its own: a
/// share of its weight, a smaller one where it gains much, goes to such members, and to singles that do better
/// than they, in proportion to their evidence.
pub(super) fn fold_pairs(fitted: &Fitted, probabilities: &mut [f64]) {
    let k = &fitted.problem.constants;
    let candidates = &fitted.candidates;
    // What the stiffnesses took up is gap too.
    let gap = residual_chi2(fitted, &fitted.baseline) + fitted.baseline.pull();
    let weighty_pair = |&i: &usize| candidates[i].effects.len() > 1 && probabilities[i] >= LEAST_PROBABILITY;
    let pairs: Vec<(usize, Vec<usize>)> = (0..candidates.len())
        .filter(weighty_pair)
        .map(|pair| (pair, says_as_much(fitted, pair, gap)))
        .collect();
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
    let own_residual = residual_chi2(fitted, &own.best);
    let as_much = |i: &usize| {
        let c = &candidates[*i];
        if c.effects.len() != 1 || !own.effects.contains(&c.effects[0]) {
            return false;
        }
        let gain = own.log_evidence - c.log_evidence;
        let c_residual = residual_chi2(fitted, &c.best);
        let misfit = residual_sd(fitted, &c.best) > k.misfit_sd;
        let needed = misfit && own_residual < k.pair_halves * c_residual && gain > k.pair_nats;
        // Or the pair leaves nothing that the scatter does not, and the single cause does.
        let complete = misfit && residual_sd(fitted, &own.best) < k.pair_complete_sd;
        let large = 2.0 * gain >= k.pair_gain_share * gap;
        let pulled = c.best.pull() > own.best.pull() + k.pair_pull_chi2;
        !(pulled || needed || gain > k.pair_least_nats && (large || complete))
    };
    (0..candidates.len()).filter(as_much).collect()
}
