//! From probabilities to a [`Verdict`] and its alias class; the report of it is in `report.rs`.
//! docs/diagnosis/model.md, section 9.
//!
//! [`decide`] takes the steps in the order of that page:
//!
//! 1. `fold_pairs` (`pairs.rs`): a pair that says little more than a member gives its weight to it.
//! 2. `score_leader`: the leader predicts regions that it has not seen (`left_out.rs`); of its laws that
//!    the evidence does not tell apart, the one that predicts best becomes its best law in [`Fitted`].
//! 3. `law_survival`, and what survives of the probabilities; the rest goes to the open set.
//! 4. `alias.rs`: what the table does not separate from the leader.
//! 5. `doubted`: the share of the chance that the method errs.
//! 6. `Grounds::verdict`: the rule, from probabilities and yes or no alone.
//!
//! The leader is the most probable cause or pair after step 1; its class begins with it. Evidence is never
//! changed here.

mod alias;
pub mod left_out;
mod pairs;

use crate::constants::Constants;
use crate::hypotheses::Fitted;
use crate::regression::{Bends, Posterior};
use crate::verdict::left_out::{LeftOutRegion, RegionScore, left_out_regions, score_of};
use effects::{Input, imitated};

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
    pub no_gap: f64,
    /// Probability of the open set, after the regions have spoken.
    pub open_set: f64,
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
    pub regions: Vec<LeftOutRegion>,
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

/// What the verdict rests on when probabilities and class are settled.
struct Grounds {
    /// No gap was improbable before the regions spoke.
    claimed: bool,
    /// Probabilities of no gap, of the open set and of the class.
    no_gap: f64,
    open_set: f64,
    in_class: f64,
    /// No rival says the same by another name, another form or other forces.
    distinct: bool,
    /// The leader closes enough of the gap, and holds enough of its class.
    leads: bool,
    /// No pair that leaves a misfit: two causes imitate nearly any gap, and are then seldom the true ones.
    whole: bool,
}

impl Grounds {
    /// Whether all but a misfit speaks for a name.
    fn nameable(&self, k: &Constants) -> bool {
        self.distinct && self.leads && self.in_class >= k.name_probability
    }

    /// The rule.
    fn verdict(&self, k: &Constants) -> Verdict {
        if !self.claimed || self.no_gap >= self.in_class.max(self.open_set) {
            Verdict::NoGap
        } else if self.open_set >= self.in_class {
            Verdict::Unknown
        } else if self.nameable(k) && self.whole {
            Verdict::Named
        } else {
            Verdict::Ambiguous
        }
    }
}

/// Decides; the leading cause gets the law that stands for it.
pub fn decide(fitted: &mut Fitted) -> Decision {
    fitted.weigh();
    let mut probabilities: Vec<f64> = fitted.candidates.iter().map(|c| c.probability).collect();
    let (no_gap, mut open_set) = (fitted.no_gap_probability, fitted.open_set_probability);
    pairs::fold_pairs(fitted, &mut probabilities);
    let claimed = no_gap < fitted.problem.constants.claim_probability;
    // Candidates come in the order of their own probability, which decides where all are too small for a number.
    let leading = (0..probabilities.len())
        .max_by(|&a, &b| probabilities[a].total_cmp(&probabilities[b]).then(b.cmp(&a)));
    let Some(leader) = leading else {
        // No effect could be tried: there is a gap of an unknown cause, or none.
        let verdict = if claimed { Verdict::Unknown } else { Verdict::NoGap };
        let (unweighed, class, regions) = (Vec::new(), Vec::new(), Vec::new());
        let (score, misfit) = (score_of(&fitted.problem.constants, &[]), None);
        return Decision {
            verdict,
            no_gap,
            open_set,
            probabilities,
            unweighed,
            class,
            misfit,
            score,
            regions,
        };
    };
    let (regions, score, survival) = score_leader(fitted, leader, claimed);
    let fitted = &*fitted;
    let survival = survival * law_survival(fitted, leader);
    if claimed {
        // An effect that cannot predict what it has not seen is no cause: its weight goes to the open set.
        for p in &mut probabilities {
            open_set += *p * (1.0 - survival);
            *p *= survival;
        }
    }
    let (k, own) = (&*fitted.problem.constants, &fitted.candidates[leader]);
    let mut class = alias::alias_class(fitted, leader);
    let departed = alias::departed_singles(fitted, leader);
    let renamed = alias::renamed(fitted, leader, &class);
    // Priors alone make no name: a rival whose forces are the same must differ in the data.
    let distinct = imitated(&own.names()).is_none()
        && class[1..].iter().all(|&i| !alias::same_forces(fitted, leader, i))
        && departed.is_empty()
        && renamed.is_empty();
    class.extend(departed);
    class.extend(alias::with_companions(fitted, leader));
    let of_class = |class: &[usize], p: &[f64]| class.iter().map(|&i| p[i]).sum::<f64>();
    let alone = k.alone_share[usize::from(own.effects.len() > 1)];
    // Half of the gap at least, whatever the evidence says.
    let closes = score.pooled >= k.region_closed;
    let leads = closes && probabilities[leader] >= alone * of_class(&class, &probabilities);
    let residual = residual_sd(fitted, &own.best);
    let whole = own.effects.len() < 2 || residual < k.pair_leaves_sd;
    let (no_gap, open_set, unweighed) = doubted(fitted, no_gap, open_set, &mut probabilities);
    let in_class = of_class(&class, &probabilities);
    let grounds = Grounds { claimed, no_gap, open_set, in_class, distinct, leads, whole };
    let verdict = grounds.verdict(k);
    class.extend(renamed.into_iter().filter(|_| verdict == Verdict::Ambiguous));
    let misfit = (verdict == Verdict::Ambiguous && grounds.nameable(k)).then_some(residual);
    Decision { verdict, no_gap, open_set, probabilities, unweighed, class, misfit, score, regions }
}

/// Probabilities with the chance that the method errs and does not see it: none is then surer than verdicts
/// on labelled sets have been right, and none is 1e-40, nor nothing for a pair that was not weighed. What no
/// hypothesis explains may be a cause of the library all the same, in a form that neither its laws nor a
/// function beside them reach: a share of the open set goes to the causes.
fn doubted(fitted: &Fitted, no_gap: f64, open_set: f64, probabilities: &mut [f64]) -> (f64, f64, Vec<f64>) {
    let k = &fitted.problem.constants;
    let coarse = fitted.coarse();
    let mixed = |p: f64, coarse: f64| (1.0 - k.doubt) * p + k.doubt * coarse;
    let (no_gap, open_set) = (mixed(no_gap, coarse.no_gap), mixed(open_set, coarse.open_set));
    let causes = coarse.each.iter().chain(&coarse.unweighed).sum::<f64>().max(f64::MIN_POSITIVE);
    let foreign = if probabilities.is_empty() { 0.0 } else { k.foreign_form * open_set };
    let stated = |p: f64, coarse: f64| mixed(p, coarse) + foreign * coarse / causes;
    probabilities.iter_mut().zip(&coarse.each).for_each(|(p, &coarse)| *p = stated(*p, coarse));
    (no_gap, open_set - foreign, coarse.unweighed.iter().map(|&coarse| stated(0.0, coarse)).collect())
}

/// The leader on the left-out regions. Of its laws that the evidence does not tell apart the one that
/// predicts best what it has not seen stands for the cause: which of them is a tenth of a nat ahead is no
/// ground to doubt the cause. Where no gap is claimed there is nothing to choose for. The last number is the
/// share of the probability that survives.
fn score_leader(fitted: &mut Fitted, leader: usize, claimed: bool) -> (Vec<LeftOutRegion>, RegionScore, f64) {
    let k = fitted.problem.constants.clone();
    let own = &fitted.candidates[leader];
    let (effects, lead) = (own.effects.len(), fitted.lead(own));
    let top = own.laws.iter().map(|(e, _)| *e).fold(f64::NEG_INFINITY, f64::max);
    let near = own.laws.iter().filter(|(e, _)| claimed && *e > top - k.alias_nats);
    let mut laws: Vec<Posterior> = near.map(|(_, law)| law.clone()).collect();
    if laws.is_empty() {
        laws.push(own.best.clone());
    }
    let scored = |law: Posterior| {
        let regions = left_out_regions(fitted, &law);
        let score = score_of(&k, &regions);
        (score.survival(&k, effects, lead), law, regions, score)
    };
    let all = laws.into_iter().map(scored);
    let (survival, law, regions, score) =
        all.reduce(|a, b| if b.0 > a.0 { b } else { a }).expect("a candidate has a law");
    fitted.candidates[leader].best = law;
    (regions, score, survival)
}

/// The share of its probability that a bent leader keeps: the name is that of a law, and a function that may
/// be any fits what no law of the cause makes. All where the law takes up enough of the gap alone.
fn law_survival(fitted: &Fitted, leader: usize) -> f64 {
    let (best, gap) = (&fitted.candidates[leader].best, residual_chi2(fitted, &fitted.baseline));
    // What changes the friction coefficient alone may be any function.
    let elsewhere = |effect: usize| effects::at(effect).acts.is_none_or(|acts| acts.on != Input::Friction);
    if best.freedom.bends == Bends::Size && best.members.iter().any(|m| elsewhere(m.effect)) {
        return 1.0;
    }
    let Some(law) = best.plain.as_deref().filter(|_| gap > 0.0) else { return 1.0 };
    let taken = 1.0 - residual_chi2(fitted, law) / gap;
    (taken / fitted.problem.constants.bent_law_takes).clamp(0.0, 1.0)
}

/// chi2 that a model leaves beyond scatter.
fn residual_chi2(fitted: &Fitted, model: &Posterior) -> f64 {
    fitted.problem.misfit(&model.mechanism) - fitted.problem.len() as f64
}

/// The same in deviations of chi2.
fn residual_sd(fitted: &Fitted, model: &Posterior) -> f64 {
    residual_chi2(fitted, model) / (2.0 * fitted.problem.len() as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::{Grounds, Verdict};
    use crate::constants::Constants;
    use crate::tests::{Deviates, rig, table};
    use crate::{Options, diagnose};
    use models::PeakToPeak;

    fn no_effects() -> Options {
        let without = effects::library().iter().map(|e| e.name.to_string()).collect();
        Options { without, ..Options::default() }
    }

    /// Each ground alone takes the name away, in the order of docs/diagnosis/model.md, section 9, step 6.
    #[test]
    fn a_name_needs_every_ground() {
        type Change = fn(&mut Grounds);
        let rows: [(&str, Change, Verdict); 8] = [
            ("all", |_| (), Verdict::Named),
            ("no gap before the regions", |g| g.claimed = false, Verdict::NoGap),
            ("no gap leads", |g| (g.no_gap, g.in_class) = (0.5, 0.5), Verdict::NoGap),
            ("the open set leads", |g| (g.open_set, g.in_class) = (0.5, 0.5), Verdict::Unknown),
            ("a rival says the same", |g| g.distinct = false, Verdict::Ambiguous),
            ("too little is closed", |g| g.leads = false, Verdict::Ambiguous),
            ("a pair leaves a misfit", |g| g.whole = false, Verdict::Ambiguous),
            ("improbable", |g| (g.open_set, g.in_class) = (0.4, 0.55), Verdict::Ambiguous),
        ];
        for (what, change, wanted) in rows {
            let [claimed, distinct, leads, whole] = [true; 4];
            let (no_gap, open_set, in_class) = (0.01, 0.02, 0.97);
            let mut grounds = Grounds { claimed, no_gap, open_set, in_class, distinct, leads, whole };
            change(&mut grounds);
            assert_eq!(grounds.verdict(&Constants::default()), wanted, "{what}");
        }
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
