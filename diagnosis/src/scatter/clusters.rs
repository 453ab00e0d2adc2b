//! Whether values at passes cluster somewhere in the operating space: a permutation test over cells of each
//! covariate and of each two.
//!
//! Scatter falls anywhere. A departure that no smooth surface follows (an edge, a spot, a step) has a mean of
//! its own in some cell. The strongest of all covariates is compared with that of passes shuffled and turned
//! either way, so the level is that of the whole family.

use crate::data::range;
use crate::random::split_mix;
use crate::regression::{Problem, kernel};
use models::covariate::{COVARIATES, CovariateRole};

/// Shuffles against which a table is held; fewer for long ones.
const SHUFFLES: usize = 400;
const MOST_WORK: usize = 400_000;
/// Levels of a covariate are parted by gaps of so many deviations; if there are more levels than these, by
/// quantiles.
const GAP: f64 = 0.12;
const MOST_LEVELS: usize = 10;
const QUANTILES: usize = 6;
/// Finer quantiles of time and place, where a departure may be short.
const FINE: usize = 24;
/// Fewest passes of a fine cell, and share of the passes by which small cells count for less.
const FEWEST: usize = 3;
const SMALL: f64 = 0.05;

/// The cells of one covariate, or of two.
struct Cells {
    name: String,
    /// Cell of each pass.
    of: Vec<usize>,
    counts: Vec<usize>,
}

impl Cells {
    fn new(name: String, of: Vec<usize>) -> Self {
        let mut counts = vec![0; of.iter().max().map_or(0, |m| m + 1)];
        of.iter().for_each(|&c| counts[c] += 1);
        Cells { name, of, counts }
    }

    /// Squared sums of values over cells, small cells counting for less: the score of a mean of its own in
    /// each cell.
    fn score(&self, values: impl Iterator<Item = f64>, sums: &mut Vec<f64>) -> f64 {
        sums.clear();
        sums.resize(self.counts.len(), 0.0);
        self.of.iter().zip(values).for_each(|(cell, v)| sums[*cell] += v);
        let few = SMALL * self.of.len() as f64;
        self.counts.iter().zip(sums.iter()).map(|(n, s)| s * s / (*n as f64 + few)).sum()
    }
}

/// The covariates of a table, cut into cells.
pub struct Space(Vec<Cells>);

/// Where values cluster, and how probable as much is of values that do not.
#[derive(Debug, Clone, PartialEq)]
pub struct Cluster {
    /// Covariate, or two of them.
    pub place: String,
    /// Rows of the cell that does most.
    pub rows: Vec<usize>,
    /// Family-wise p-value.
    pub p: f64,
}

impl Space {
    /// The operating space of a problem's passes.
    pub fn of(problem: &Problem) -> Self {
        let largest = problem.design.largest_amplitude_m;
        let mut single: Vec<Cells> = Vec::new();
        let mut fine: Vec<Cells> = Vec::new();
        for c in COVARIATES {
            let Some(values) = kernel::scaled(c, &problem.passes, largest) else { continue };
            let Some(cells) = levels(&values, c.least_spread) else { continue };
            single.push(Cells::new(c.words.to_string(), cells));
            if matches!(c.role, CovariateRole::Time | CovariateRole::Place) && values.len() >= FINE * FEWEST {
                fine.push(Cells::new(c.words.to_string(), quantiles(&values, FINE)));
            }
        }
        let mut all: Vec<Cells> = Vec::new();
        for (k, a) in single.iter().enumerate() {
            for b in &single[k + 1..] {
                let of = a.of.iter().zip(&b.of).map(|(x, y)| x * b.counts.len() + y).collect();
                all.push(Cells::new(format!("{} and {}", a.name, b.name), of));
            }
        }
        single.extend(fine);
        single.extend(all);
        single.push(Cells::new("on one side".to_string(), vec![0; problem.len()]));
        Space(single)
    }

    /// Where signals cluster most: values that scatter either way, and magnitudes. Constant ones say nothing.
    pub fn cluster(&self, either_way: &[Vec<f64>], magnitudes: &[Vec<f64>]) -> Cluster {
        let signals: Vec<(bool, Vec<f64>)> = either_way
            .iter()
            .filter_map(|s| Some((true, scaled(s, 0.0)?)))
            .chain(magnitudes.iter().filter_map(|s| Some((false, scaled(s, mean(s))?))))
            .collect();
        let n = signals.first().map_or(0, |s| s.1.len());
        let mut sums = Vec::new();
        let scores = shuffled(n, |order, signs| {
            let mut row = Vec::with_capacity(self.0.len() * signals.len());
            for cells in &self.0 {
                for (turns, values) in &signals {
                    let value = |&i: &usize| values[i] * if *turns { signs[i] } else { 1.0 };
                    row.push(cells.score(order.iter().map(value), &mut sums));
                }
            }
            row
        });
        let (largest, which) = strongest(&scores);
        let beyond = largest[1..].iter().filter(|other| **other >= largest[0]).count();
        let (Some(cells), Some((_, values))) =
            (self.0.get(which / signals.len().max(1)), signals.get(which % signals.len().max(1)))
        else {
            return Cluster { place: String::new(), rows: Vec::new(), p: 1.0 };
        };
        cells.score(values.iter().copied(), &mut sums);
        let part = |cell: usize| sums[cell].powi(2) / (cells.counts[cell] as f64 + SMALL * n as f64);
        let cell = (0..sums.len()).max_by(|&a, &b| part(a).total_cmp(&part(b)));
        let rows = (0..n).filter(|&i| Some(cells.of[i]) == cell).collect();
        Cluster { place: cells.name.clone(), rows, p: (1 + beyond) as f64 / largest.len() as f64 }
    }
}

/// Scores of passes as they are, and after them of passes that are shuffled and turned either way.
pub fn shuffled(n: usize, mut score: impl FnMut(&[usize], &[f64]) -> Vec<f64>) -> Vec<Vec<f64>> {
    let shuffles = (MOST_WORK / n.max(1)).clamp(100, SHUFFLES);
    let (mut order, mut signs): (Vec<usize>, Vec<f64>) = ((0..n).collect(), vec![1.0; n]);
    let mut state = 0x5EED_u64;
    (0..=shuffles)
        .map(|_| {
            let row = score(&order, &signs);
            for i in (1..n).rev() {
                order.swap(i, (split_mix(&mut state) % (i as u64 + 1)) as usize);
            }
            signs.iter_mut().for_each(|s| *s = if split_mix(&mut state) & 1 == 0 { 1.0 } else { -1.0 });
            row
        })
        .collect()
}

/// The largest score of each row in deviations of its test among the shuffles, and which test that is in the
/// first row.
pub fn strongest(scores: &[Vec<f64>]) -> (Vec<f64>, usize) {
    let centre: Vec<(f64, f64)> = (0..scores[0].len())
        .map(|t| moments(&scores[1..].iter().map(|row| row[t]).collect::<Vec<_>>()))
        .collect();
    let of = |row: &Vec<f64>| {
        let each = row.iter().zip(&centre).map(|(v, (m, sd))| (v - m) / sd.max(f64::MIN_POSITIVE));
        each.enumerate().fold((f64::NEG_INFINITY, 0), |a, (t, z)| if z > a.0 { (z, t) } else { a })
    };
    (scores.iter().map(|row| of(row).0).collect(), of(&scores[0]).1)
}

/// Mean and deviation.
pub fn moments(values: &[f64]) -> (f64, f64) {
    let m = mean(values);
    (m, mean(&values.iter().map(|v| (v - m).powi(2)).collect::<Vec<_>>()).sqrt())
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Values less a centre, of unit mean square.
fn scaled(values: &[f64], centre: f64) -> Option<Vec<f64>> {
    let rms = mean(&values.iter().map(|v| (v - centre).powi(2)).collect::<Vec<_>>()).sqrt();
    (rms > 1e-12 * centre.abs().max(1e-12)).then(|| values.iter().map(|v| (v - centre) / rms).collect())
}

/// Level of each value: parted by gaps where there are few, else by quantiles; `None` of a covariate that
/// does not vary.
fn levels(values: &[f64], least_spread: f64) -> Option<Vec<usize>> {
    let z = scaled(values, mean(values))?;
    let spread = |list: &[f64]| {
        let [low, high] = range(list.iter().copied());
        high - low
    };
    // In the covariate's own unit a deviation is its range over that of the scaled values.
    if spread(values) / spread(&z) <= least_spread {
        return None;
    }
    let mut sorted = z.clone();
    sorted.sort_by(f64::total_cmp);
    let cuts: Vec<_> = sorted.windows(2).filter(|w| w[1] - w[0] > GAP).map(|w| 0.5 * (w[0] + w[1])).collect();
    if (1..MOST_LEVELS).contains(&cuts.len()) {
        return Some(z.iter().map(|v| cuts.partition_point(|c| c < v)).collect());
    }
    Some(quantiles(values, QUANTILES))
}

fn quantiles(values: &[f64], count: usize) -> Vec<usize> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    values.iter().map(|v| sorted.partition_point(|s| s < v) * count / values.len()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{Deviates, rig, table};

    /// Scatter does not cluster; a step at the lightest load does, and is found there.
    #[test]
    fn a_departure_at_one_load_clusters_there_and_scatter_nowhere() {
        let mut draw = Deviates(4);
        let problem = Problem::new(&table(&mut draw, 0.0), &rig(), &Default::default());
        let space = Space::of(&problem);
        let scatter: Vec<Vec<f64>> =
            (0..20).map(|_| (0..problem.len()).map(|_| draw.normal()).collect()).collect();
        let p: Vec<f64> = scatter.iter().map(|s| space.cluster(std::slice::from_ref(s), &[]).p).collect();
        assert!(p.iter().filter(|p| **p < 0.05).count() <= 3, "{p:?}");
        let step = |i: usize| if problem.passes[i].normal_force_n < 0.2 { 2.0 } else { 0.0 };
        let stepped = (0..problem.len()).map(|i| scatter[0][i] + step(i)).collect();
        let found = space.cluster(&[stepped], &[]);
        assert!(found.p < 0.01 && found.place.contains("normal force"), "{found:?}");
    }
}
