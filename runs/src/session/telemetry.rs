//! Snapshots of the loop for viewers: one cycle in a hundred milliseconds, and the extremes of all cycles, so that a spike
//! between two snapshots is seen.

use realtime::ports::{Channel, Nanos};
use realtime::turn::Row;
use serde::{Deserialize, Serialize};

/// Time between two snapshots.
const EVERY: Nanos = Nanos(100_000_000);

/// Least and greatest value of a channel.
pub type Span = Option<[f64; 2]>;

/// Extremes of all cycles since the last snapshot; `None` where a channel gave nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Extremes {
    /// Cycles that they are of.
    pub cycles: u32,
    /// Lateral force in N.
    pub lateral_force_n: Span,
    /// Normal force in N.
    pub normal_force_n: Span,
    /// Peak-to-peak amplitude in m.
    pub amplitude_pp_m: Span,
    /// Running `mu'`.
    pub mu_relative: Span,
    /// Latest beginning of a cycle in s.
    pub lateness_s: f64,
}

impl Extremes {
    fn take(&mut self, row: &Row) {
        let seen = &row.inputs.seen;
        let value = |channel: Channel| channel.ok().map(|r| r.value);
        self.cycles += 1;
        widen(&mut self.lateral_force_n, value(seen.forces.lateral));
        widen(&mut self.normal_force_n, value(seen.forces.normal));
        widen(&mut self.amplitude_pp_m, seen.amplifier.ok().and_then(|a| value(a.amplitude)));
        widen(&mut self.mu_relative, row.mu_relative.ok().map(|mu| mu.value));
        self.lateness_s = self.lateness_s.max(seen.lateness.seconds());
    }
}

fn widen(span: &mut Span, value: Option<f64>) {
    let Some(value) = value else { return };
    *span = Some(span.map_or([value; 2], |[least, greatest]| [least.min(value), greatest.max(value)]));
}

/// A cycle, and the extremes since the snapshot before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Snapshot {
    /// The cycle.
    pub row: Row,
    /// Of all cycles since the last snapshot, this one included.
    pub extremes: Extremes,
}

/// Picks the cycles that become snapshots.
#[derive(Debug, Default)]
pub struct Snapshots {
    last: Nanos,
    extremes: Extremes,
}

impl Snapshots {
    /// Takes a cycle; returns it where it is a snapshot.
    pub fn take(&mut self, row: &Row) -> Option<Snapshot> {
        self.extremes.take(row);
        if row.now.since(self.last) < EVERY {
            return None;
        }
        self.last = row.now;
        Some(Snapshot { row: *row, extremes: std::mem::take(&mut self.extremes) })
    }
}
