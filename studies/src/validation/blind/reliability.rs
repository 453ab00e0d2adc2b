//! Whether probabilities are what they say: every entry of every list of hypotheses, `unknown` and no gap among them.

use super::{ABOVE_FLOOR, Scored};
use serde::{Deserialize, Serialize};
use sim::sealed::{DETECTABLE, PAIR_LEAVES, Stratum};

/// One entry of a list.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct StatedChance {
    /// Stated probability.
    pub probability: f64,
    /// Whether it is the truth.
    pub right: bool,
}

/// Entries of like probability.
#[derive(Debug, Clone, Serialize)]
pub struct Bin {
    /// Least and largest probability.
    pub from_to: [f64; 2],
    /// Number of entries.
    pub entries: usize,
    /// Mean of the stated probabilities.
    pub stated: f64,
    /// Share that is right.
    pub observed: f64,
    /// Wilson's 95 % interval of the share.
    pub ci95: [f64; 2],
}

/// Bounds of the bins: entries gather at both ends.
const BOUNDS: [f64; 10] = [0.001, 0.01, 0.05, 0.15, 0.3, 0.5, 0.7, 0.85, 0.95, 0.99];

/// Whether the truth of a set is identifiable: no cause, or one whose gap the data show; two where no single
/// one all but explains both. For any other set no gap, or another cause, may be as good a word.
pub fn identifiable(s: &Scored) -> bool {
    let shown = s.chi2_gain >= DETECTABLE && s.gap_over_floor >= ABOVE_FLOOR;
    let both = s.stratum != Stratum::Pair || s.best_single_leaves.is_some_and(|x| x >= PAIR_LEAVES);
    s.stratum == Stratum::None || (shown && both)
}

/// The diagram over some sets.
pub fn diagram<'a>(sets: impl Iterator<Item = &'a Scored>) -> Vec<Bin> {
    let mut bins: Vec<Vec<StatedChance>> = vec![Vec::new(); BOUNDS.len() + 1];
    for entry in sets.flat_map(|s| &s.entries) {
        bins[BOUNDS.partition_point(|b| *b <= entry.probability)].push(*entry);
    }
    let bound = |i: usize| if i == 0 { 0.0 } else { BOUNDS.get(i - 1).copied().unwrap_or(1.0) };
    let filled = bins.into_iter().enumerate().filter(|(_, b)| !b.is_empty());
    filled
        .map(|(i, bin)| {
            let n = bin.len() as f64;
            let share = super::share("", "", bin.iter().map(|e| e.right).collect());
            Bin {
                from_to: [bound(i), BOUNDS.get(i).copied().unwrap_or(1.0)],
                entries: bin.len(),
                stated: bin.iter().map(|e| e.probability).sum::<f64>() / n,
                observed: share.value.unwrap_or(f64::NAN),
                ci95: share.ci95.unwrap_or([f64::NAN; 2]),
            }
        })
        .collect()
}
