//! Snapshots of the loop for viewers: one cycle in a hundred milliseconds, and the extremes of all cycles, so
//! that a spike between two snapshots is seen.

use realtime::Row;
use realtime::ports::{Channel, Nanos};
use serde::{Deserialize, Serialize};

/// Time between two snapshots.
const EVERY: Nanos = Nanos(100_000_000);

/// Least and greatest value of a channel.
pub type ValueRange = Option<[f64; 2]>;

/// Extremes of all cycles since the last snapshot; `None` where a channel gave nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Extremes {
    /// Cycles that they are of.
    pub cycles: u32,
    /// Lateral force in N.
    pub lateral_force_n: ValueRange,
    /// Normal force in N.
    pub normal_force_n: ValueRange,
    /// Peak-to-peak amplitude in m.
    pub amplitude_pp_m: ValueRange,
    /// Running `mu'`.
    pub mu_relative: ValueRange,
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

fn widen(span: &mut ValueRange, value: Option<f64>) {
    let Some(value) = value else { return };
    *span = Some(span.map_or([value; 2], |[least, greatest]| [least.min(value), greatest.max(value)]));
}

/// Upper bounds of the classes of lateness in s; one more class has none.
pub const LATENESS_BOUNDS_S: [f64; 12] =
    [1e-5, 2e-5, 5e-5, 1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 1e-1, 1.0];

/// The deadlines of this session so far, and how late each was. A missed one counts with its own lateness, as
/// in the loop's report.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Deadlines {
    /// Cycles made.
    pub cycles: u64,
    /// Deadlines missed: no cycle began for them.
    pub missed: u64,
    /// Sum of the lateness of all deadlines in s.
    pub lateness_sum_s: f64,
    /// Deadlines in each class of [`LATENESS_BOUNDS_S`], the last one beyond them.
    pub lateness_classes: [u64; LATENESS_BOUNDS_S.len() + 1],
}

impl Deadlines {
    fn take(&mut self, late: Nanos, period: Nanos) {
        let missed = late.0 / period.0.max(1);
        self.cycles += 1;
        self.missed += missed;
        for k in 0..=missed {
            let late_s = late.since(Nanos(k * period.0)).seconds();
            self.lateness_sum_s += late_s;
            self.lateness_classes[LATENESS_BOUNDS_S.partition_point(|bound| *bound < late_s)] += 1;
        }
    }
}

/// A cycle, and what was since the snapshot before and since the beginning.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Snapshot {
    /// The cycle.
    pub row: Row,
    /// Its time in the record, in ns since 1970.
    pub unix_ns: u64,
    /// Of all cycles since the last snapshot, this one included.
    pub extremes: Extremes,
    /// Of all cycles of the session, this one included.
    pub deadlines: Deadlines,
    /// Time that the plate was driven in this session, and its dose in m2/s; none in virtual time.
    pub driven: Option<(Nanos, f64)>,
}

/// Picks the cycles that become snapshots.
#[derive(Debug, Default)]
pub struct Snapshots {
    start_unix_ns: u64,
    period: Nanos,
    last: Nanos,
    extremes: Extremes,
    deadlines: Deadlines,
}

impl Snapshots {
    /// Of a loop with such a period, whose record begins at `start_unix_ns`.
    pub fn of(start_unix_ns: u64, period: Nanos) -> Self {
        Snapshots { start_unix_ns, period, ..Snapshots::default() }
    }

    /// Takes a cycle; returns it where it is a snapshot.
    pub fn take(&mut self, row: &Row) -> Option<Snapshot> {
        self.extremes.take(row);
        self.deadlines.take(row.inputs.seen.lateness, self.period);
        if row.now.since(self.last) < EVERY {
            return None;
        }
        self.last = row.now;
        Some(Snapshot {
            row: *row,
            unix_ns: self.start_unix_ns + row.now.0,
            extremes: std::mem::take(&mut self.extremes),
            deadlines: self.deadlines,
            driven: None,
        })
    }
}
