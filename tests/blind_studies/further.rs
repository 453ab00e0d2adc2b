//! Designed next experiments against random ones: how many further passes until the cause is named.
//!
//! A sealed set is thinned until it hardly tells its cause; then batches of passes are measured on the same sealed rig,
//! once as the diagnosis asks for them and once at conditions drawn evenly from the grid that designs choose from, until
//! the truth has a probability of 0.9 or the passes run out. Both sides meet the same stream of noise.

use diagnosis::data::{RigFile, Table};
use diagnosis::report::next;
use diagnosis::{Options, diagnose};
use models::covariate;
use models::{Condition, Pass};
use rayon::prelude::*;
use serde::Serialize;
use sim::noise::Noise;
use sim::sealed::{Ask, Stratum, generate_with_rig};
use studies::validation::blind::{Figure, median, share, statistic};

/// Passes that a thinned set keeps: the most of these at which its cause is open. A sixth with the plate
/// still. Most causes that the whole set identifies are plain from two dozen passes.
const SIZES: [usize; 5] = [48, 36, 24, 16, 12];
/// Passes of a batch, and batches. Causes are often found within six passes: larger batches would not show
/// who was sooner.
const BATCH: usize = 2;
const BATCHES: usize = 32;
/// Passes at which a race is broken off: who has not arrived counts with so many.
const LIMIT: usize = BATCH * BATCHES;
/// Probability at which a cause counts as found.
const FOUND: f64 = 0.9;
/// Probability below which a cause is open. Where it is likelier than not at the start, any further pass may end the race.
const OPEN: f64 = 0.5;
/// chi2 by which the whole set separates its cause from the recalibrated baseline: a set enters from 100 on.
const SEPARATED: f64 = 100.0;

/// The diagnosis after a batch.
#[derive(Debug, Clone, Serialize)]
struct Step {
    /// Further passes so far.
    passes: usize,
    /// Probability of the truth.
    truth: f64,
    /// Probability of the open set.
    unknown: f64,
    /// The likeliest hypothesis.
    leader: String,
    /// Share of the gap that it closed on left-out regions.
    closure: f64,
}

/// What it took to name the cause of one set.
#[derive(Debug, Clone, Serialize)]
struct Race {
    /// Seed of the set.
    seed: u64,
    /// The cause.
    truth: String,
    /// Number of passes in the thinned set.
    #[serde(rename = "kept")]
    passes: usize,
    /// Probability of the truth before any further pass.
    before: f64,
    /// Further passes as designed; none where they did not suffice.
    designed: Option<usize>,
    /// Further passes at random.
    random: Option<usize>,
    /// Batch by batch as designed.
    designed_steps: Vec<Step>,
    /// Batch by batch at random.
    random_steps: Vec<Step>,
}

/// Races over `count` sets; sets whose cause leads at first are left out.
pub fn run(seed: u64, count: u64) {
    let races: Vec<Race> = (0..count)
        .into_par_iter()
        .filter_map(|k| one(seed.wrapping_mul(1_000_003).wrapping_add(k)).inspect(super::line))
        .collect();
    println!("further passes to a probability of 0.9, {} sets whose cause is open at first:", races.len());
    for f in figures(&races) {
        let (value, [low, high]) = (f.value.unwrap_or(f64::NAN), f.ci95.unwrap_or([f64::NAN; 2]));
        println!("  {:46} {value:7.3} [{low:.3}, {high:.3}]  n {}  {}", f.name, f.n, f.target);
    }
    let count = |of: &dyn Fn(usize, usize) -> bool| {
        let passes = |n: Option<usize>| n.unwrap_or(usize::MAX);
        races.iter().filter(|r| of(passes(r.designed), passes(r.random))).count()
    };
    println!("  designed sooner in {}, later in {}", count(&|d, r| d < r), count(&|d, r| d > r));
}

fn one(seed: u64) -> Option<Race> {
    let set = generate_with_rig(seed, Stratum::Single, Ask::Imitators).0;
    if set.label.chi2_gain < SEPARATED || !set.label.decidable() {
        return None;
    }
    let truth = set.label.causes[0].name.clone();
    let rig = RigFile::parse(&set.rig_toml).expect("rig.toml of a sealed set");
    let (size, start, first) = thin(&set.passes, &rig, &truth)?;
    let grid = grid(&start);
    let race = |designed: bool| -> Vec<Step> {
        // Each side has the rig to itself: the same finger, the same stream of further noise.
        let mut sealed = generate_with_rig(seed, Stratum::Single, Ask::Gain).1;
        let mut chance = Noise::new(seed, "random experiments");
        let (mut passes, mut next) = (start.clone(), first.next.clone());
        let mut steps = Vec::new();
        for batch in 1..=BATCHES {
            let wanted = if designed && !next.is_empty() {
                std::mem::take(&mut next)
            } else {
                (0..BATCH).map(|_| grid[chance.below(grid.len())]).collect()
            };
            let mut further = sealed.measure(&wanted);
            for pass in &mut further {
                pass.run = Some(format!("further {batch}"));
            }
            passes.extend(further);
            let answer = says(&passes, &rig, &truth);
            next = answer.next;
            steps.push(Step { passes: batch * BATCH, ..answer.step });
            if answer.found >= FOUND {
                break;
            }
        }
        steps
    };
    let (designed_steps, random_steps) = (race(true), race(false));
    let arrived = |steps: &[Step]| steps.last().filter(|s| s.truth >= FOUND).map(|s| s.passes);
    Some(Race {
        seed,
        truth,
        passes: size,
        before: first.found,
        designed: arrived(&designed_steps),
        random: arrived(&random_steps),
        designed_steps,
        random_steps,
    })
}

/// Figures of races: who arrived, and the ratio of passes where at least one side did.
fn figures(races: &[Race]) -> Vec<Figure> {
    let passes = |n: Option<usize>| n.unwrap_or(LIMIT) as f64;
    let decided = races.iter().filter(|r| r.designed.is_some() || r.random.is_some());
    let both: Vec<[f64; 2]> = decided.map(|r| [passes(r.designed), passes(r.random)]).collect();
    let ratios: Vec<f64> = both.iter().map(|[designed, random]| designed / random).collect();
    // A ratio of two small numbers of passes is coarse; that of the medians is not.
    let of_medians = |sample: &mut [[f64; 2]]| {
        let side = |k: usize| median(&mut sample.iter().map(|r| r[k]).collect::<Vec<f64>>());
        side(0) / side(1)
    };
    let of = |name, side: fn(&Race) -> Option<usize>| {
        let list: Vec<f64> = races.iter().map(|r| passes(side(r))).collect();
        statistic(name, "", &list, median)
    };
    let geometric = |v: &mut [f64]| (v.iter().map(|x| x.ln()).sum::<f64>() / v.len() as f64).exp();
    vec![
        share("designed: arrived", "", races.iter().map(|r| r.designed.is_some()).collect()),
        share("random: arrived", "", races.iter().map(|r| r.random.is_some()).collect()),
        of("designed: median passes", |r| r.designed),
        of("random: median passes", |r| r.random),
        statistic("median of the designed over that of the random", "0.5", &both, of_medians),
        statistic("passes designed over random, race by race, median", "0.5", &ratios, median),
        statistic("passes designed over random, race by race, geometric mean", "", &ratios, geometric),
    ]
}

/// The largest thinned set that does not identify its cause, with its diagnosis.
fn thin(passes: &[Pass], rig: &RigFile, truth: &str) -> Option<(usize, Vec<Pass>, Answer)> {
    for size in SIZES {
        let start = thinned(passes, size);
        let answer = says(&start, rig, truth);
        if answer.found < OPEN {
            return Some((size, start, answer));
        }
    }
    None
}

/// Every so many passes of a set, as if the sweep had been broken off.
fn thinned(passes: &[Pass], keep: usize) -> Vec<Pass> {
    let (still, moving): (Vec<&Pass>, Vec<&Pass>) = passes.iter().partition(|p| p.amplitude.metres() == 0.0);
    let some = |list: &[&Pass], count: usize| -> Vec<Pass> {
        let step = list.len().div_ceil(count.max(1)).max(1);
        list.iter().step_by(step).map(|p| (*p).clone()).collect()
    };
    let mut thinned = some(&still, keep / 6);
    thinned.extend(some(&moving, keep - keep / 6));
    for pass in &mut thinned {
        pass.run = Some(pass.run.take().unwrap_or_else(|| "first".to_string()));
    }
    thinned
}

/// The diagnosis of some passes.
struct Answer {
    /// Probability of the truth.
    found: f64,
    step: Step,
    /// The batch of conditions to measure next.
    next: Vec<Condition>,
}

fn says(passes: &[Pass], rig: &RigFile, truth: &str) -> Answer {
    let options = Options { pairs: false, ..Options::default() };
    let report = diagnose(&table(passes), rig, &options, String::new()).report;
    let of = |name: &str| -> f64 {
        report.hypotheses.iter().filter(|h| h.effects == [name]).map(|h| h.probability).sum()
    };
    let next = report.next_experiment.iter().find(|e| !e.conditions.is_empty());
    let next = next.map_or_else(Vec::new, |e| e.conditions.iter().take(BATCH).map(settings).collect());
    let found = of(truth);
    let step = Step {
        passes: 0,
        truth: found,
        unknown: of("unknown"),
        leader: report.hypotheses[0].effects.join("+"),
        closure: report.left_out.pooled_closure,
    };
    Answer { found, step, next }
}

fn table(passes: &[Pass]) -> Table {
    Table::measured(passes).expect("a sealed table")
}

/// The conditions that a design of these passes may choose from.
fn grid(passes: &[Pass]) -> Vec<Condition> {
    next::grid::conditions(&table(passes)).iter().map(settings).collect()
}

/// What a plan sets of a condition, and nothing of its time and climate.
fn settings(c: &Condition) -> Condition {
    let mut set = Condition::paper();
    for covariate in covariate::planned() {
        if let Some(value) = covariate.of(c) {
            covariate.put(&mut set, value);
        }
    }
    set
}
