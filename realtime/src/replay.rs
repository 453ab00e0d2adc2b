//! Runs recorded cycles again: the same inputs through the same code must lead to the same decisions, bit for bit.

use crate::cycle::{self, Config, CycleState};
use crate::cycle_io::Row;
use models::FrictionModel;

/// What a replay found.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Replay {
    /// Cycles run again.
    pub cycles: u64,
    /// Cycles whose decision came out as recorded.
    pub equal: u64,
    /// The first cycle that came out otherwise.
    pub first_difference: Option<u64>,
    /// Cycles that the record lost: what follows them cannot be expected to be equal.
    pub missing: u64,
}

impl Replay {
    /// Whether every cycle was there and came out as recorded.
    pub const fn holds(&self) -> bool {
        self.cycles > 0 && self.equal == self.cycles && self.missing == 0
    }
}

/// Runs rows again, in the order of their cycles, from the state in which a loop starts.
pub fn replay(config: &Config, model: &dyn FrictionModel, rows: impl IntoIterator<Item = Row>) -> Replay {
    let mut state = CycleState::default();
    let mut found = Replay::default();
    let mut expected = 1;
    for row in rows {
        found.missing += row.cycle.saturating_sub(expected);
        expected = row.cycle + 1;
        let out = cycle::step(config, model, &mut state, &row.inputs, row.now);
        let again = Row::of(row.cycle, row.now, &row.inputs, &out);
        found.cycles += 1;
        // Equal bit for bit, where `NaN` equals itself: as the record writes them.
        if again == row || serde_json::to_string(&again).ok() == serde_json::to_string(&row).ok() {
            found.equal += 1;
        } else {
            found.first_difference = found.first_difference.or(Some(row.cycle));
        }
    }
    found
}
