//! Which: from probabilities to a verdict, with what cannot be told apart said so.

use crate::hypotheses::Fitted;
use crate::shrink::{Gate, Region, gate, left_out_regions};
use effects::imitated;

/// The four answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The recalibrated baseline explains the table.
    NoGap,
    /// One effect, or one pair, causes most of the gap.
    Named,
    /// The leading hypotheses cannot be told apart on this table.
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
    /// Indices of the leader's alias class among the candidates, the leader first.
    pub class: Vec<usize>,
    /// What the left-out regions say about the leader.
    pub gate: Gate,
    /// Those regions.
    pub regions: Vec<Region>,
}

/// Nats within which the data does not tell two hypotheses apart (chi2 of 10).
const ALIAS_NATS: f64 = 5.0;
/// Probability that a name needs.
const NAME: f64 = 0.9;
/// Share of its class that a name needs beside others that the data all but equals, for one effect and for two: two
/// forms err by more nats than one, and pairs were wrong by up to 4.5 of them (the class reaches as far as 5). One
/// effect was never wrong between 0.93 and 0.98 on 190 sealed sets.
const ALONE: [f64; 2] = [0.93, 0.993];
/// chi2 between the forces of two hypotheses below which they say the same of this table. What the data tell of two with
/// as many parameters is then less than [`ALONE`] asks for, and priors alone may not make a name: a speed that is wrong
/// by half was called a lateral stiffness because such a stiffness is less of a surprise. Such a rival is of the class
/// until it is less likely than the leader by the nats after it.
const SAME_FORCES: f64 = 4.0;
const PRIOR_NATS: f64 = 10.0;
/// Probability of no gap above which none is claimed.
const NO_CLAIM: f64 = 0.1;
/// Share of the gap's chi2 that a second cause must add to the evidence before it is believed: single causes whose form
/// is not the library's gain up to 0.026 by a spurious companion (sealed sets of two generators).
const PAIR_GAIN: f64 = 0.03;
/// Or: the best single leaves a quarter of the gap (this share of its chi2) or nearly so, the second cause takes up
/// more than half of that, and the evidence grows by these nats. Spurious companions of such singles gained up to 34.
const PAIR_LEFT: f64 = 0.05;
const PAIR_NATS: f64 = 50.0;
/// Or: the single pulls the nuisances from their calibration by so much chi2 more than the pair. True single causes in
/// other forms pull them by up to 30 (sealed sets); a gain that hides in a stiffness pulls it by hundreds.
const PAIR_PULL: f64 = 50.0;

/// Decides.
pub fn decide(fitted: &Fitted) -> Decision {
    let candidates = &fitted.candidates;
    let mut probabilities: Vec<f64> = candidates.iter().map(|c| c.probability).collect();
    let (none, mut unknown) = (fitted.none_probability, fitted.unknown_probability);
    fold_pairs(fitted, &mut probabilities);
    let leader = (0..candidates.len())
        // Candidates come in the order of their own probability, which decides where all are too small for a number.
        .max_by(|&a, &b| probabilities[a].total_cmp(&probabilities[b]).then(b.cmp(&a)))
        .expect("the library is not empty");
    let regions = left_out_regions(fitted, &candidates[leader].best);
    let judged = gate(&regions);
    let claimed = none < NO_CLAIM;
    if claimed {
        // An effect that cannot predict what it has not seen is no cause: its weight goes to the open set.
        let survival = judged.survival(candidates[leader].effects.len(), candidates[leader].best.share);
        for p in &mut probabilities {
            unknown += *p * (1.0 - survival);
            *p *= survival;
        }
    }
    let class = alias_class(fitted, leader);
    let alone = ALONE[usize::from(candidates[leader].effects.len() > 1)];
    let told = imitated(&candidates[leader].names()).is_none()
        && class[1..].iter().all(|&i| !same_said(fitted, leader, i));
    let in_class: f64 = class.iter().map(|&i| probabilities[i]).sum();
    let verdict = if !claimed || none >= in_class.max(unknown) {
        Verdict::NoGap
    } else if unknown >= in_class {
        Verdict::Unknown
    } else if told && in_class >= NAME && probabilities[leader] >= alone * in_class {
        Verdict::Named
    } else {
        Verdict::Ambiguous
    };
    Decision { verdict, none, unknown, probabilities, class, gate: judged, regions }
}

/// The leader and every hypothesis of its size that the data does not tell from it.
fn alias_class(fitted: &Fitted, leader: usize) -> Vec<usize> {
    let candidates = &fitted.candidates;
    let mut class = vec![leader];
    let own = &candidates[leader];
    class.extend((0..candidates.len()).filter(|&i| {
        let behind = own.log_evidence - candidates[i].log_evidence;
        i != leader
            && candidates[i].effects.len() == own.effects.len()
            && (behind < ALIAS_NATS || behind < PRIOR_NATS && same_said(fitted, leader, i))
    }));
    class
}

/// Whether a rival says the same as the leader with no more parameters.
fn same_said(fitted: &Fitted, leader: usize, rival: usize) -> bool {
    let [a, b] = [leader, rival].map(|i| &fitted.candidates[i].best);
    let forces = a.prediction.iter().zip(b.prediction.iter());
    let apart: f64 = forces.zip(&fitted.problem.variance).map(|((p, q), v)| (p - q).powi(2) / v).sum();
    b.u.len() <= a.u.len() && apart < SAME_FORCES
}

/// A pair that says little more than one of its members alone is that single with a form of its own: its weight goes
/// to such members, and to singles that do better than they, in proportion to their evidence.
fn fold_pairs(fitted: &Fitted, probabilities: &mut [f64]) {
    let problem = &fitted.problem;
    let left = |model: &nalgebra::DVector<f64>| -> f64 {
        (0..problem.len()).map(|i| (problem.lateral[i] - model[i]).powi(2) / problem.variance[i] - 1.0).sum()
    };
    let gap = left(&fitted.none.prediction);
    let candidates = &fitted.candidates;
    for pair in 0..candidates.len() {
        let own = &candidates[pair];
        if own.effects.len() < 2 || probabilities[pair] < 1e-6 {
            continue;
        }
        let own_left = left(&own.best.prediction);
        let alone: Vec<usize> = (0..candidates.len())
            .filter(|&i| {
                let c = &candidates[i];
                if c.effects.len() != 1 || !own.effects.contains(&c.effects[0]) {
                    return false;
                }
                let gain = own.log_evidence - c.log_evidence;
                let c_left = left(&c.best.prediction);
                let needed = c_left > PAIR_LEFT * gap && own_left < 0.5 * c_left && gain > PAIR_NATS;
                let pulled = c.best.pull() > own.best.pull() + PAIR_PULL;
                2.0 * gain < PAIR_GAIN * gap && !needed && !pulled
            })
            .collect();
        let Some(best) = alone.iter().map(|&i| candidates[i].log_evidence).reduce(f64::max) else { continue };
        // Another single that does better than these is the better short word for what the pair says.
        let mut heirs = alone;
        heirs.extend((0..candidates.len()).filter(|&i| {
            let c = &candidates[i];
            c.effects.len() == 1 && !own.effects.contains(&c.effects[0]) && c.log_evidence > best
        }));
        let evidence: Vec<f64> = heirs.iter().map(|&i| candidates[i].log_evidence).collect();
        let total = crate::linear::log_sum_exp(&evidence);
        let weight = std::mem::take(&mut probabilities[pair]);
        for (i, e) in heirs.iter().zip(&evidence) {
            probabilities[*i] += weight * (e - total).exp();
        }
    }
}
