//! Two causes at once: pairs grown from the best singles. docs/diagnosis/model.md, section 7.

use crate::hypotheses::Candidate;
use crate::regression::{
    Basis, Freedom, Hunt, Layout, Member, NUISANCES, Posterior, Problem, averaged_over_form, laplace,
    middle_freedom, nuisance_starts, product,
};
use effects::one_cause;
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Laws of one pair that are fitted: the scan is coarse.
const LAWS_OF_A_PAIR: usize = 2;
/// Rounds of the search for a pair's mode, and of its twin's from there.
const ROUNDS: [usize; 2] = [5, 3];

/// Two members with a place of their coordinates, and what it costs on the scale of the starts.
#[derive(Clone)]
struct Start {
    cost: f64,
    members: Vec<Member>,
    u: Vec<f64>,
}

impl Start {
    /// Best first; equal costs in the order of the library.
    fn sort(list: &mut [Start]) {
        list.sort_by(|a, b| a.cost.total_cmp(&b.cost).then(a.members.cmp(&b.members)));
    }
}

/// The effects that members join, in the order of the library.
fn effects_of(members: &[Member]) -> Vec<usize> {
    let mut effects: Vec<usize> = members.iter().map(|m| m.effect).collect();
    effects.sort_unstable();
    effects
}

/// Whether two hypotheses change the forces alike: by name, or by the angle between their changes in
/// deviations of a pass.
fn one_change(problem: &Problem, a: &Posterior, b: &Posterior) -> bool {
    if one_cause(a.members[0].name(), b.members[0].name()) {
        return true;
    }
    let product = |x: &Posterior, y: &Posterior| product(problem, &x.change.net, &y.change.net);
    product(a, b) > problem.constants.one_change_cosine * (product(a, a) * product(b, b)).sqrt().max(1e-300)
}

/// The best pairs once more, in every law of both members: which law a cause follows, and where, shows in its
/// pair and not alone, and a pair in a local minimum loses to the open set.
fn with_every_law(
    problem: &Problem,
    mut pairs: Vec<Posterior>,
    singles: &[Candidate],
    tempered: &[f64],
    basis: &Basis,
) -> Vec<Posterior> {
    let effects = |p: &Posterior| effects_of(&p.members);
    pairs.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence).then_with(|| effects(a).cmp(&effects(b))));
    let mut best: Vec<Vec<usize>> = pairs.iter().map(effects).collect();
    let mut seen = BTreeSet::new();
    best.retain(|effects| seen.insert(effects.clone()));
    best.truncate(problem.constants.pairs_searched);
    let again: Vec<Posterior> = best
        .par_iter()
        .flat_map(|effects| {
            law_starts(problem, effects, &pairs, singles, tempered)
                .into_par_iter()
                .filter_map(|start| refined(problem, start, tempered, basis))
                .collect::<Vec<_>>()
        })
        .collect();
    for found in again {
        let better =
            |own: &&mut Posterior| effects(own) == effects(&found) && found.log_evidence > own.log_evidence;
        if let Some(own) = pairs.iter_mut().find(better) {
            *own = found;
        }
    }
    pairs
}

/// The best places of a pair in each two laws of its members, by the whole scan of one beside the other.
fn law_starts(
    problem: &Problem,
    effects: &[usize],
    pairs: &[Posterior],
    singles: &[Candidate],
    tempered: &[f64],
) -> Vec<Start> {
    let k = &problem.constants;
    // Singles come best first: the stronger one stays while the other is sought.
    let mut both = singles.iter().filter(|c| effects.contains(&c.effects[0]));
    let (Some(strong), Some(weak)) = (both.next(), both.next()) else { return Vec::new() };
    let alone = strong.laws.iter().map(|(_, a)| (a.members[0], a.u.clone()));
    // And each member where the pair has it, beside the other.
    let paired = pairs.iter().filter(|x| effects_of(&x.members) == effects).flat_map(|x| {
        let layout = Layout::of(&x.members);
        [0, 1].map(|i| (x.members[i], [&x.u[..NUISANCES], &x.u[layout.member(i)]].concat()))
    });
    let jobs: Vec<(Member, Vec<f64>, Member)> = alone
        .chain(paired)
        .flat_map(|(first, fixed)| {
            let other = if first.effect == strong.effects[0] { weak } else { strong };
            other.laws.iter().map(move |(_, b)| (first, fixed.clone(), b.members[0]))
        })
        .collect();
    let mut scans: Vec<Start> = jobs
        .par_iter()
        .flat_map_iter(|(first, fixed, second)| {
            let members = vec![*first, *second];
            nuisance_starts(fixed, k.driven_sd).into_iter().filter_map(move |fixed| {
                let (cost, u) = Hunt { problem, members: &members, variance: tempered }.full_scan(&fixed)?;
                Some(Start { cost, members: members.clone(), u })
            })
        })
        .collect();
    Start::sort(&mut scans);
    // Each two laws once: on the scale of the starts the better ones do not stand out.
    let mut seen = BTreeSet::new();
    scans.retain(|scan| {
        let mut laws = scan.members.clone();
        laws.sort_unstable();
        seen.insert(laws)
    });
    scans.truncate(k.laws_refined);
    scans
}

/// The mode of a pair from one start.
fn refined(problem: &Problem, start: Start, tempered: &[f64], basis: &Basis) -> Option<Posterior> {
    let members = &start.members;
    let fit = Hunt { problem, members, variance: tempered }.refine_from(start.u)?;
    let freedom = middle_freedom(&problem.constants, members);
    Some(laplace(problem, members, &fit.u, basis, freedom, ROUNDS[0]))
}

/// The same pair with the exact alias of one of its members in its place, if that one is tried.
fn twins(problem: &Problem, singles: &[Candidate], pair: &Posterior) -> Vec<(Vec<Member>, Vec<f64>)> {
    let member = |(effect, law): (usize, usize)| Member { effect, law };
    let both = effects::twins().into_iter().flat_map(|[a, b]| [(a, b), (b, a)]);
    let both = both.map(|(one, other)| (member(one), member(other)));
    both.filter_map(|(one, other)| {
        let place = pair.members.iter().position(|m| *m == one)?;
        let tried = singles.iter().any(|c| c.effects == [other.effect]);
        if !tried || pair.members.iter().any(|m| m.effect == other.effect) {
            return None;
        }
        let (mut members, mut u) = (pair.members.clone(), pair.u.clone());
        let size = Layout::of(&members).size(place);
        let value = one.parameters(&problem.design)[0].value(u[size]);
        members[place] = other;
        u[size] = other.parameters(&problem.design)[0].coordinate(value);
        Some((members, u))
    })
    .collect()
}

/// Pairs of a bent leader: which second cause there is shows beside what the leader's function took up, and
/// not beside its law alone.
fn beside_a_function(
    problem: &Problem,
    singles: &[Candidate],
    tempered: &[f64],
    basis: &Basis,
) -> Vec<Posterior> {
    let k = &problem.constants;
    let leader = &singles[0].best;
    if leader.freedom.bend == 0.0 {
        return Vec::new();
    }
    let taken = leader.departure_n(basis);
    let lateral = problem.lateral.iter().zip(taken.iter()).map(|(all, taken)| all - taken).collect();
    let rest = Problem { lateral, ..problem.clone() };
    let mut starts = coarse_starts(&rest, &singles[..1], singles, tempered);
    starts.truncate(k.pairs_searched);
    let found = starts.into_par_iter().filter_map(|start| {
        let hunt = Hunt { problem: &rest, members: &start.members, variance: tempered };
        let fit = hunt.refine_from(start.u)?;
        let bent = Freedom { share: middle_freedom(k, &start.members).share, ..leader.freedom };
        Some(laplace(problem, &start.members, &fit.u, basis, bent, ROUNDS[0]))
    });
    found.collect()
}

/// Places of pairs by a coarse scan, best first: each seed with every other effect in each of its laws.
fn coarse_starts(
    problem: &Problem,
    seeds: &[Candidate],
    singles: &[Candidate],
    tempered: &[f64],
) -> Vec<Start> {
    let k = &problem.constants;
    let jobs: Vec<(usize, &Posterior)> = (0..seeds.len())
        .flat_map(|s| singles.iter().flat_map(|c| &c.laws).map(move |(_, e)| (s, e)))
        .filter(|(s, e)| e.members[0].effect != seeds[*s].effects[0])
        // Two names for one change are not two causes.
        .filter(|(s, e)| !one_change(problem, &seeds[*s].best, e))
        .collect();
    let mut scans: Vec<Start> = jobs
        .par_iter()
        .filter_map(|(s, e)| {
            let seed = &seeds[*s].best;
            let members = vec![seed.members[0], e.members[0]];
            let alone = &e.u[NUISANCES..];
            // A cause that acts as a gain of the stiffness, the amplitude or the speed hides in the
            // stiffnesses that the single drove to imitate it.
            let hunt = Hunt { problem, members: &members, variance: tempered };
            nuisance_starts(&seed.u, k.driven_sd)
                .iter()
                .filter_map(|fixed| hunt.coarse_scan(fixed, alone))
                .min_by(|a, b| a.0.total_cmp(&b.0))
                .map(|(cost, u)| Start { cost, members, u })
        })
        .collect();
    Start::sort(&mut scans);
    let mut chosen: Vec<Start> = Vec::new();
    for scan in scans {
        if chosen.iter().filter(|c| effects_of(&c.members) == effects_of(&scan.members)).count()
            < LAWS_OF_A_PAIR
        {
            chosen.push(scan);
        }
        if chosen.len() == k.pairs_fitted {
            break;
        }
    }
    chosen
}

/// Pairs grown from the best singles, each with every other effect in each of its laws.
pub fn pairs(problem: &Problem, singles: &[Candidate], tempered: &[f64], basis: &Basis) -> Vec<Candidate> {
    let k = &problem.constants;
    let seeds = &singles[..singles.len().min(k.pair_seeds)];
    let mut first: Vec<Posterior> = coarse_starts(problem, seeds, singles, tempered)
        .into_par_iter()
        .filter_map(|start| {
            nuisance_starts(&start.u, k.driven_sd)
                .into_iter()
                .filter_map(|u| refined(problem, Start { u, ..start.clone() }, tempered, basis))
                .max_by(|a, b| a.log_evidence.total_cmp(&b.log_evidence))
        })
        .collect();
    first.extend(beside_a_function(problem, singles, tempered, basis));
    let mut found = with_every_law(problem, first, singles, tempered, basis);
    let twins: Vec<Posterior> = found
        .par_iter()
        .flat_map_iter(|pair| twins(problem, singles, pair))
        .map(|(members, u)| {
            let freedom = middle_freedom(k, &members);
            laplace(problem, &members, &u, basis, freedom, ROUNDS[1])
        })
        .collect();
    found.extend(twins);
    weighed(problem, found, basis)
}

/// Each pair with its evidence over the shares of form uncertainty, in its best two laws.
fn weighed(problem: &Problem, pairs: Vec<Posterior>, basis: &Basis) -> Vec<Candidate> {
    let k = &problem.constants;
    let top = pairs.iter().map(|p| p.log_evidence).fold(f64::NEG_INFINITY, f64::max);
    // By their laws the best pairs may be far behind a bent one, and not where they are bent too.
    let mut by_law: Vec<_> = pairs.iter().filter(|p| p.freedom.bend == 0.0).map(|p| p.log_evidence).collect();
    by_law.sort_by(|a, b| b.total_cmp(a));
    let nth = by_law.get(k.pair_seeds).copied().unwrap_or(f64::NEG_INFINITY);
    let weighed: Vec<(f64, Posterior)> = pairs
        .into_par_iter()
        .map(|e| {
            if e.log_evidence > nth.min(top - k.prune_nats) {
                averaged_over_form(problem, &e.u, &e.members, basis)
            } else {
                (e.log_evidence + k.form_weights[1].ln(), e)
            }
        })
        .collect();
    let mut list: Vec<Candidate> = Vec::new();
    for (evidence, best) in weighed {
        let effects = effects_of(&best.members);
        let laws: f64 = best.members.iter().map(|m| effects::at(m.effect).laws.len() as f64).product();
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
