//! How much the verdict depends on each constant: halved, and doubled, on the same sealed sets.
//!
//! Constants of the verdict rule are tried on finished fits; those of the fits need a diagnosis of their own
//! each. What is reported beside the verdict does not enter the score and is left out.

use diagnosis::Verdict;
use diagnosis::constants::{Constants, EntersAt};
use diagnosis::data::{RigFile, Table};
use diagnosis::hypotheses::{Fitted, Options, fit_all};
use diagnosis::verdict::decide;
use rayon::prelude::*;
use sim::sealed::Set;
use std::sync::Arc;
use studies::validation::blind::sets;

/// Factors by which each constant is changed.
const FACTORS: [f64; 2] = [0.5, 2.0];

/// The verdict on one set.
#[derive(Clone, PartialEq)]
struct Answer {
    verdict: Verdict,
    leader: Vec<&'static str>,
    right: bool,
    probability: f64,
}

fn answer(set: &Set, fitted: &mut Fitted) -> Answer {
    let decision = decide(fitted);
    let mut truth: Vec<&str> = set.label.causes.iter().map(|c| c.name.as_str()).collect();
    truth.sort_unstable();
    let outside = set.label.causes.iter().any(|c| !c.in_library);
    let names = |i: usize| {
        let mut names = fitted.candidates[i].names();
        names.sort_unstable();
        names
    };
    let leader = decision.leader().map(names).unwrap_or_default();
    let true_place = (0..fitted.candidates.len()).find(|&i| names(i) == truth);
    let (right, probability) = if truth.is_empty() {
        (decision.verdict == Verdict::NoGap, decision.no_gap)
    } else if outside {
        (decision.verdict == Verdict::Unknown, decision.open_set)
    } else {
        let named = decision.verdict == Verdict::Named && leader == truth;
        (named, true_place.map_or(0.0, |i| decision.probabilities[i]))
    };
    Answer { verdict: decision.verdict, leader, right, probability }
}

fn fitted(set: &Set, constants: Constants) -> Fitted {
    let rig = RigFile::parse(&set.rig_toml).expect("rig.toml of a sealed set");
    let table = Table::measured(&set.passes).expect("a sealed table");
    fit_all(&table, &rig, &Options { constants: Arc::new(constants), ..Options::default() })
}

/// The answers of one set under every change, in the order of the changes, the unchanged constants first.
fn tried(set: &Set, base: &Constants, changes: &[(EntersAt, Constants)]) -> Vec<Answer> {
    let mut own = fitted(set, base.clone());
    // A decision settles the leader's law: each begins with what was fitted.
    let as_fitted = own.candidates.clone();
    let mut list = vec![answer(set, &mut own)];
    for (stage, constants) in changes {
        list.push(if *stage == EntersAt::Decision {
            own.problem.constants = Arc::new(constants.clone());
            own.candidates.clone_from(&as_fitted);
            answer(set, &mut own)
        } else {
            answer(set, &mut fitted(set, constants.clone()))
        });
    }
    list
}

/// Tries the constants of a stage, `fit` or `decision`, the one of a name, or all, on `count` sets.
pub fn run(seed: u64, count: usize, choice: &str) {
    let base = Constants::default();
    let mut labels = vec![("as it is", 1.0)];
    let mut changes = Vec::new();
    for row in base.rows().iter().filter(|row| match choice {
        "all" => row.stage != EntersAt::Report,
        "fit" => row.stage == EntersAt::Fit,
        "decision" => row.stage == EntersAt::Decision,
        name => row.name == name,
    }) {
        for factor in FACTORS {
            let mut constants = base.clone();
            constants.scale(row.name, factor).expect("a constant that can be scaled");
            labels.push((row.name, factor));
            changes.push((row.stage, constants));
        }
    }
    assert!(!changes.is_empty(), "{choice}: fit, decision, the name of a constant, or nothing is needed");
    let all: Vec<Set> = sets(seed, count, None).collect();
    let all: Vec<Vec<Answer>> = all.par_iter().map(|set| tried(set, &base, &changes)).collect();
    println!("| constant | factor | right | misnamed | changed | probability on the truth | n |");
    println!("|---|---|---|---|---|---|---|");
    for (i, (constant, factor)) in labels.iter().enumerate() {
        let of = |test: &dyn Fn(&Answer, &Answer) -> bool| all.iter().filter(|s| test(&s[i], &s[0])).count();
        let probability = all.iter().map(|s| s[i].probability).sum::<f64>() / all.len().max(1) as f64;
        println!(
            "| `{constant}` | {factor} | {} | {} | {} | {probability:.3} | {count} |",
            of(&|s, _| s.right),
            of(&|s, _| s.verdict == Verdict::Named && !s.right),
            of(&|s, base| s.verdict != base.verdict
                || s.verdict == Verdict::Named && s.leader != base.leader),
        );
    }
}
