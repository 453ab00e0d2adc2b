//! Two causes at once: pairs grown from the best singles, and sought again in every law where they look best.

use crate::evidence::{Explained, FORMS, explain, middle_share, over_forms};
use crate::explore::{glance, nuisance_starts, polish, survey};
use crate::fit::{Fit, Member, NUISANCES, Problem};
use crate::hypotheses::Candidate;
use crate::singles::PRUNE;
use effects::{library, one_cause};
use nalgebra::DMatrix;
use rayon::prelude::*;

/// Single effects from which pairs are grown.
const PAIR_SEEDS: usize = 6;
/// Cosine between two changes above which they are one.
const ONE_CHANGE: f64 = 0.98;
/// Pairs that are fitted in full.
const PAIRS_FITTED: usize = 20;
/// Of those, pairs that are sought again in each two laws, and how many of these are followed.
const PAIRS_SEARCHED: usize = 4;
const LAWS_POLISHED: usize = 16;

/// Whether two hypotheses change the forces alike: by name, or by the angle between their changes in deviations of a
/// pass.
fn one_change(problem: &Problem, a: &Explained, b: &Explained) -> bool {
    if one_cause(a.members[0].name(), b.members[0].name()) {
        return true;
    }
    let product = |x: &Explained, y: &Explained| -> f64 {
        x.change.iter().zip(y.change.iter()).zip(&problem.variance).map(|((p, q), v)| p * q / v).sum()
    };
    product(a, b) > ONE_CHANGE * (product(a, a) * product(b, b)).sqrt().max(1e-300)
}

/// The best pairs once more, in every law of both members: which law a cause follows, and where, shows in its pair and
/// not alone, and a pair in a local minimum loses to strangers.
fn searched_again(
    problem: &Problem,
    mut pairs: Vec<(Vec<usize>, Explained)>,
    singles: &[Candidate],
    loose: &[f64],
    basis: &DMatrix<f64>,
) -> Vec<(Vec<usize>, Explained)> {
    pairs.sort_by(|a, b| b.1.log_evidence.total_cmp(&a.1.log_evidence).then(a.0.cmp(&b.0)));
    let mut best: Vec<&Vec<usize>> = pairs.iter().map(|(e, _)| e).collect();
    let mut seen = std::collections::BTreeSet::new();
    best.retain(|e| seen.insert((*e).clone()));
    best.truncate(PAIRS_SEARCHED);
    let again: Vec<Explained> = best
        .par_iter()
        .flat_map(|effects| {
            // Singles come best first: the stronger one holds still while the other is sought.
            let mut both = singles.iter().filter(|c| effects.contains(&c.effects[0]));
            let (Some(strong), Some(weak)) = (both.next(), both.next()) else { return Vec::new() };
            let alone = strong.laws.iter().map(|(_, a)| (a.members[0], a.u.clone()));
            // And each member where the pair has it, beside the other.
            let paired = pairs.iter().filter(|(e, _)| e == *effects).flat_map(|(_, x)| {
                let middle = NUISANCES + x.members[0].parameters().len();
                let second = [&x.u[..NUISANCES], &x.u[middle..]].concat();
                [(x.members[0], x.u[..middle].to_vec()), (x.members[1], second)]
            });
            let jobs: Vec<(Member, Vec<f64>, Member)> = alone
                .chain(paired)
                .flat_map(|(first, held)| {
                    let other = if first.effect == strong.effects[0] { weak } else { strong };
                    other.laws.iter().map(move |(_, b)| (first, held.clone(), b.members[0]))
                })
                .collect();
            let mut surveys: Vec<(f64, Vec<Member>, Vec<f64>)> = jobs
                .par_iter()
                .flat_map_iter(|(first, held, second)| {
                    let members = vec![*first, *second];
                    nuisance_starts(held).into_iter().filter_map(move |held| {
                        survey(problem, &members, &held, loose).map(|(cost, u)| (cost, members.clone(), u))
                    })
                })
                .collect();
            surveys.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            // Each two laws once: on the scale of the starts the better ones do not stand out.
            let mut seen = std::collections::BTreeSet::new();
            surveys.retain(|(_, members, _)| {
                let mut laws = members.clone();
                laws.sort_unstable();
                seen.insert(laws)
            });
            surveys.truncate(LAWS_POLISHED);
            surveys
                .into_par_iter()
                .filter_map(|(_, members, u)| {
                    let fit = polish(problem, &members, u, loose)?;
                    Some(explain(problem, &members, &fit.u, basis, middle_share(&members), 5))
                })
                .collect()
        })
        .collect();
    for found in again {
        let mut effects: Vec<usize> = found.members.iter().map(|m| m.effect).collect();
        effects.sort_unstable();
        let better =
            |(e, x): &&mut (Vec<usize>, Explained)| *e == effects && found.log_evidence > x.log_evidence;
        if let Some((_, own)) = pairs.iter_mut().find(better) {
            *own = found;
        }
    }
    pairs
}

/// The same pair with the exact alias of one of its members in its place.
fn twins(pair: &Explained) -> Vec<(Vec<Member>, Vec<f64>)> {
    let member = |(effect, law): (usize, usize)| Member { effect, law };
    let both = effects::twins().into_iter().flat_map(|[a, b]| [(a, b), (b, a)]);
    let both = both.map(|(one, other)| (member(one), member(other)));
    both.filter_map(|(one, other)| {
        let place = pair.members.iter().position(|m| *m == one)?;
        if pair.members.iter().any(|m| m.effect == other.effect) {
            return None;
        }
        let (mut members, mut u) = (pair.members.clone(), pair.u.clone());
        let before: usize = members[..place].iter().map(|m| m.parameters().len()).sum();
        let value = one.parameters()[0].value(u[NUISANCES + before]);
        members[place] = other;
        u[NUISANCES + before] = other.parameters()[0].coordinate(value);
        Some((members, u))
    })
    .collect()
}

/// Pairs grown from the best singles, each with every other effect in each of its laws.
pub fn pairs(
    problem: &Problem,
    singles: &[Candidate],
    loose: &[f64],
    basis: &DMatrix<f64>,
) -> Vec<Candidate> {
    let seeds = &singles[..singles.len().min(PAIR_SEEDS)];
    let jobs: Vec<(usize, &Explained)> = (0..seeds.len())
        .flat_map(|s| singles.iter().flat_map(|c| &c.laws).map(move |(_, e)| (s, e)))
        .filter(|(s, e)| e.members[0].effect != seeds[*s].effects[0])
        // Two names for one change are not two causes.
        .filter(|(s, e)| !one_change(problem, &seeds[*s].best, e))
        .collect();
    let mut glances: Vec<(f64, Vec<Member>, Vec<f64>)> = jobs
        .par_iter()
        .filter_map(|(s, e)| {
            let seed = &seeds[*s].best;
            let pair = vec![seed.members[0], e.members[0]];
            let alone = &e.u[NUISANCES..];
            // A cause that acts as a gain of the stiffness, the amplitude or the speed hides in the stiffnesses that the
            // single drove to imitate it.
            nuisance_starts(&seed.u)
                .iter()
                .filter_map(|held| glance(problem, &pair, held, loose, alone))
                .min_by(|a, b| a.0.total_cmp(&b.0))
                .map(|(cost, u)| (cost, pair, u))
        })
        .collect();
    glances.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut chosen: Vec<(Vec<usize>, Vec<Member>, Vec<f64>)> = Vec::new();
    for (_, pair, u) in glances {
        let mut effects: Vec<usize> = pair.iter().map(|m| m.effect).collect();
        effects.sort_unstable();
        // Two laws of a pair may be looked at: the scan is coarse.
        if chosen.iter().filter(|(e, ..)| *e == effects).count() < 2 {
            chosen.push((effects, pair, u));
        }
        if chosen.len() == PAIRS_FITTED {
            break;
        }
    }
    let first: Vec<(Vec<usize>, Explained)> = chosen
        .into_par_iter()
        .filter_map(|(effects, pair, u)| {
            let best = nuisance_starts(&u)
                .into_iter()
                .filter_map(|u| polish(problem, &pair, u, loose))
                .map(|fit| explain(problem, &pair, &fit.u, basis, middle_share(&pair), 5))
                .max_by(|a, b| a.log_evidence.total_cmp(&b.log_evidence))?;
            Some((effects, best))
        })
        .collect();
    let mut first = searched_again(problem, first, singles, loose, basis);
    let twins: Vec<(Vec<usize>, Explained)> = first
        .par_iter()
        .flat_map_iter(|(_, e)| twins(e))
        .map(|(members, u)| {
            let mut effects: Vec<usize> = members.iter().map(|m| m.effect).collect();
            effects.sort_unstable();
            (effects, explain(problem, &members, &u, basis, middle_share(&members), 3))
        })
        .collect();
    first.extend(twins);
    let top = first.iter().map(|(_, e)| e.log_evidence).fold(f64::NEG_INFINITY, f64::max);
    let full: Vec<(Vec<usize>, f64, Explained)> = first
        .into_par_iter()
        .map(|(effects, e)| {
            if e.log_evidence > top - PRUNE {
                let fit = Fit { u: e.u.clone(), prediction: e.prediction.clone(), cost: 0.0 };
                let (evidence, best) = over_forms(problem, &fit, &e.members, basis);
                (effects, evidence, best)
            } else {
                (effects, e.log_evidence + FORMS[1].1.ln(), e)
            }
        })
        .collect();
    let mut list: Vec<Candidate> = Vec::new();
    for (effects, evidence, best) in full {
        let laws: f64 = best.members.iter().map(|m| library()[m.effect].laws().len() as f64).product();
        // Only the best pair of laws was fitted: the others are taken to add nothing.
        let log_evidence = evidence - laws.ln();
        match list.iter_mut().find(|c| c.effects == effects) {
            Some(c) if c.log_evidence >= log_evidence => {}
            Some(c) => *c = Candidate::new(effects, log_evidence, best, Vec::new()),
            None => list.push(Candidate::new(effects, log_evidence, best, Vec::new())),
        }
    }
    list.retain(|c| c.log_evidence.is_finite());
    list
}
