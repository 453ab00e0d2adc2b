//! The verdict on scatter that is not what rig.toml states: bad passes, heavy tails, runs, a wrong statement.

use diagnosis::data::{RigFile, Table};
use diagnosis::{Options, Report, Verdict, diagnose};
use rayon::prelude::*;
use serde::Serialize;
use sim::defects::DefectKind;
use sim::sealed::rough::{RoughSet, Roughness, rough};

/// What a set may hold: nothing, or one of these causes.
pub const TRUTHS: [&str; 4] = ["none", "squeeze_film", "load_dependent_friction", "lateral_offset_drift"];

/// Answers on the sets of one kind of scatter and one truth.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct NoiseScore {
    /// Kind of scatter.
    pub noise: String,
    /// The cause, or `none`.
    pub truth: String,
    /// Sets.
    pub sets: usize,
    /// The cause named; of sets without one, no gap.
    pub right: usize,
    /// Another cause named.
    pub wrong: usize,
    /// Ambiguous.
    pub ambiguous: usize,
    /// Unknown.
    pub unknown: usize,
    /// No gap, where there is one.
    pub missed: usize,
    /// Bad passes that were made, and those of them called suspect.
    pub bad: usize,
    /// Suspect ones of them.
    pub found: usize,
    /// Passes that are not bad, and those of them called suspect.
    pub good: usize,
    /// Suspect ones of them.
    pub falsely: usize,
}

impl NoiseScore {
    /// The answer on one set.
    fn of(noise: &str, truth: &str, set: &RoughSet, report: &Report) -> Self {
        let leads = &report.hypotheses[0].effects;
        let bad = |point: &u64| set.bad.contains(point);
        let found = report.scatter.suspects.iter().filter(|s| bad(&s.point)).count();
        let mut one = NoiseScore {
            noise: noise.into(),
            truth: truth.into(),
            sets: 1,
            bad: set.bad.len(),
            found,
            good: set.passes.len() - set.bad.len(),
            falsely: report.scatter.suspects.len() - found,
            ..NoiseScore::default()
        };
        match report.verdict {
            Verdict::Named if *leads == [truth] => one.right = 1,
            Verdict::Named => one.wrong = 1,
            Verdict::Ambiguous => one.ambiguous = 1,
            Verdict::Unknown => one.unknown = 1,
            Verdict::NoGap if truth == "none" => one.right = 1,
            Verdict::NoGap => one.missed = 1,
        }
        one
    }

    /// With those on further sets of the same kind.
    fn with(mut self, more: &Self) -> Self {
        let sums = [
            (&mut self.sets, more.sets),
            (&mut self.right, more.right),
            (&mut self.wrong, more.wrong),
            (&mut self.ambiguous, more.ambiguous),
            (&mut self.unknown, more.unknown),
            (&mut self.missed, more.missed),
            (&mut self.bad, more.bad),
            (&mut self.found, more.found),
            (&mut self.good, more.good),
            (&mut self.falsely, more.falsely),
        ];
        sums.into_iter().for_each(|(sum, more)| *sum += more);
        self
    }

    /// Answers on single sets, added up by their kind and truth, in the order in which these come first.
    pub fn summed(all: &[Self]) -> Vec<Self> {
        let mut rows: Vec<Self> = Vec::new();
        for one in all {
            match rows.iter_mut().find(|row| (&row.noise, &row.truth) == (&one.noise, &one.truth)) {
                Some(row) => *row = row.clone().with(one),
                None => rows.push(one.clone()),
            }
        }
        rows
    }
}

/// Diagnoses `count` sets of each of some truths under one kind of scatter; `progress` gets each answer.
///
/// # Errors
/// A set that the diagnosis refuses, and a truth that is no cause.
pub fn run(
    seed: u64,
    count: usize,
    (name, roughness): (&str, Roughness),
    truths: &[&str],
    options: &Options,
    progress: impl Fn(u64, &RoughSet, &Report, &NoiseScore) + Sync,
) -> miette::Result<Vec<NoiseScore>> {
    let of_truth = |truth: &&str| {
        let named = || DefectKind::named(truth).ok_or_else(|| miette::miette!("no cause is named '{truth}'"));
        let kind = (*truth != "none").then(named).transpose()?;
        let one = |k: u64| {
            let own = seed.wrapping_mul(1_000_003).wrapping_add(k);
            let set = rough(own, kind, roughness);
            let report = answer(&set, options)?;
            let one = NoiseScore::of(name, truth, &set, &report);
            progress(own, &set, &report, &one);
            Ok(one)
        };
        let all = (0..count as u64).into_par_iter().map(one).collect::<miette::Result<Vec<NoiseScore>>>()?;
        let none = NoiseScore { noise: name.into(), truth: (*truth).into(), ..NoiseScore::default() };
        Ok(all.iter().fold(none, NoiseScore::with))
    };
    truths.iter().map(of_truth).collect()
}

/// The report on one set.
///
/// # Errors
/// A set that the diagnosis refuses.
pub fn answer(set: &RoughSet, options: &Options) -> miette::Result<Report> {
    let rig = RigFile::parse(&set.rig_toml).map_err(|e| miette::miette!("rig.toml: {e}"))?;
    let table = Table::measured(&set.passes).map_err(|e| miette::miette!("table: {e}"))?;
    Ok(diagnose(&table, &rig, options, String::new()).report)
}
