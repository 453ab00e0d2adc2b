//! How much the verdict depends on each constant: halved, and doubled, on the same sealed sets.
//!
//! Constants of the verdict rule are tried on finished fits; those of the fits need a diagnosis of their own
//! each. What is reported beside the verdict does not enter the score and is left out.

use diagnosis::Verdict;
use diagnosis::constants::{self, Constants, Stage};
use diagnosis::data::{RigFile, Table};
use diagnosis::decision::decide;
use diagnosis::hypotheses::{Fitted, Options, fit_all};
use rayon::prelude::*;
use serde::Serialize;
use sim::sealed::{Set, Stratum};
use std::sync::{Arc, Mutex, PoisonError};

/// Factors by which each constant is changed.
const FACTORS: [f64; 2] = [0.5, 2.0];

/// The verdicts under one change.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// Constant; `as it is` for none changed.
    pub constant: &'static str,
    /// Factor on it.
    pub factor: f64,
    /// Number of sets.
    pub sets: usize,
    /// Sets whose verdict is the truth: the cause named, `unknown` for one outside the library, `no_gap` for none.
    pub right: usize,
    /// Sets with a name that is not the truth.
    pub misnamed: usize,
    /// Sets whose verdict is another than with the constants as they are.
    pub changed: usize,
    /// Mean probability on the truth.
    pub probability: f64,
}

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
        (decision.verdict == Verdict::NoGap, decision.none)
    } else if outside {
        (decision.verdict == Verdict::Unknown, decision.unknown)
    } else {
        let named = decision.verdict == Verdict::Named && leader == truth;
        (named, true_place.map_or(0.0, |i| decision.probabilities[i]))
    };
    Answer { verdict: decision.verdict, leader, right, probability }
}

fn fitted(set: &Set, constants: Constants, pairs: bool) -> miette::Result<Fitted> {
    let rig = RigFile::parse(&set.rig_toml).map_err(|e| miette::miette!("rig.toml of a sealed set: {e}"))?;
    let table = Table::measured(&set.passes).map_err(|e| miette::miette!("table of a sealed set: {e}"))?;
    let options = Options { constants: Arc::new(constants), pairs, ..Options::default() };
    Ok(fit_all(&table, &rig, &options))
}

/// The answers of one set under every change, in the order of the changes, the unchanged constants first.
fn tried(
    set: &Set,
    base: &Constants,
    changes: &[(Stage, Constants)],
    pairs: bool,
) -> miette::Result<Vec<Answer>> {
    let mut own = fitted(set, base.clone(), pairs)?;
    // A decision settles the leader's law: each begins with what was fitted.
    let as_fitted = own.candidates.clone();
    let mut list = vec![answer(set, &mut own)];
    for (stage, constants) in changes {
        list.push(if *stage == Stage::Decision {
            own.problem.constants = Arc::new(constants.clone());
            own.candidates.clone_from(&as_fitted);
            answer(set, &mut own)
        } else {
            answer(set, &mut fitted(set, constants.clone(), pairs)?)
        });
    }
    Ok(list)
}

/// The study: the changes, and the answers so far.
pub struct Study {
    labels: Vec<(&'static str, f64)>,
    changes: Vec<(Stage, Constants)>,
    base: Constants,
    pairs: bool,
    answers: Mutex<Vec<Vec<Answer>>>,
}

impl Study {
    /// Of the constants that `picks` accepts.
    ///
    /// # Errors
    /// A constant that cannot be scaled.
    pub fn new(options: &Options, picks: &dyn Fn(&constants::Row) -> bool) -> miette::Result<Self> {
        let base = (*options.constants).clone();
        let mut labels = vec![("as it is", 1.0)];
        let mut changes = Vec::new();
        for row in base.rows().iter().filter(|r| r.stage != Stage::Report && picks(r)) {
            for factor in FACTORS {
                let mut constants = base.clone();
                constants.scale(row.name, factor).map_err(|e| miette::miette!("{e}"))?;
                labels.push((row.name, factor));
                changes.push((row.stage, constants));
            }
        }
        Ok(Study { labels, changes, base, pairs: options.pairs, answers: Mutex::default() })
    }

    /// Tries `count` sets from a seed; `each` is called after each.
    ///
    /// # Errors
    /// A set that the diagnosis refuses.
    pub fn run(
        &self,
        seed: u64,
        count: usize,
        stratum: Option<Stratum>,
        each: &(dyn Fn() + Sync),
    ) -> miette::Result<()> {
        let sets: Vec<Set> = super::sets(seed, count, stratum).collect();
        sets.par_iter().try_for_each(|set| {
            let answer = tried(set, &self.base, &self.changes, self.pairs)?;
            self.answers.lock().unwrap_or_else(PoisonError::into_inner).push(answer);
            each();
            Ok(())
        })
    }

    /// A row for each change, from the sets so far.
    #[must_use]
    pub fn rows(&self) -> Vec<Row> {
        let all = self.answers.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let row = |(i, &(constant, factor)): (usize, &(&'static str, f64))| {
            let of =
                |test: &dyn Fn(&Answer, &Answer) -> bool| all.iter().filter(|s| test(&s[i], &s[0])).count();
            // In the order of size: the sum does not depend on which set was done first.
            let mut probabilities: Vec<f64> = all.iter().map(|s| s[i].probability).collect();
            probabilities.sort_by(f64::total_cmp);
            Row {
                constant,
                factor,
                sets: all.len(),
                right: of(&|s, _| s.right),
                misnamed: of(&|s, _| s.verdict == Verdict::Named && !s.right),
                changed: of(&|s, base| {
                    s.verdict != base.verdict || s.verdict == Verdict::Named && s.leader != base.leader
                }),
                probability: probabilities.iter().fold(0.0, |sum, p| sum + p) / all.len().max(1) as f64,
            }
        };
        self.labels.iter().enumerate().map(row).collect()
    }
}
