//! The edges in a run's record: steps of the amplitude while the finger slides, and turns of the stage
//! under load.

use crate::input::parse_toml;
use crate::job::{REPLAYABLE, Replayable};
use crate::plan::PlanFile;
use crate::run_dir::{open_record, records_in};
use diagnosis::Diagnosis;
use diagnosis::report::timing::{Against, Edge, RecordPart, judge};
use miette::IntoDiagnostic;
use models::{Condition, Finger, PeakToPeak, RigFile, SpringSlider};
use realtime::Row;
use realtime::ports::{Nanos, Quality};
use realtime::recorder::{self, Entry};
use std::collections::VecDeque;
use std::path::Path;

/// Time before an edge over which nothing else may change: samples that are stamped late by up to 0.1 s
/// show the level before it.
const BEFORE: Nanos = Nanos(160_000_000);
/// The part of it that is compared, s.
const LEAD_S: f64 = 0.06;
/// The longest and the shortest time that is looked at behind an edge.
const BEHIND: Nanos = Nanos(500_000_000);
const LEAST: Nanos = Nanos(100_000_000);

#[derive(Clone, Copy, PartialEq)]
struct Commanded {
    amplitude_pp_m: f64,
    velocity_m_s: f64,
    load_n: f64,
}

/// Takes rows in the order of their cycles, and yields edges.
#[derive(Default)]
pub struct Collector {
    /// Edges until now.
    pub edges: Vec<Edge>,
    recent: VecDeque<Row>,
    last: Option<Commanded>,
    open: Option<(Against, Nanos, Vec<Row>)>,
}

impl Collector {
    /// Takes a row.
    pub fn row(&mut self, row: &Row) {
        let now =
            Commanded { amplitude_pp_m: row.drive_pp_m, velocity_m_s: row.velocity_m_s, load_n: row.load_n };
        let before = self.last.replace(now).unwrap_or(now);
        if now != before {
            self.close();
            let steady = self.recent.front().is_some_and(|first| row.now.since(first.now) >= BEFORE);
            let kind = if before.velocity_m_s == now.velocity_m_s {
                Some(Against::Amplitude)
            } else if before.amplitude_pp_m == now.amplitude_pp_m && before.velocity_m_s == -now.velocity_m_s
            {
                Some(Against::Position)
            } else {
                None
            };
            let slides = now.load_n > 0.0 && now.load_n == before.load_n && before.velocity_m_s != 0.0;
            let rows = self.recent.drain(..).collect();
            self.open = kind.filter(|_| steady && slides).map(|kind| (kind, row.now, rows));
        }
        match &mut self.open {
            Some((_, since, rows)) if row.now.since(*since) < BEHIND => rows.push(*row),
            _ => self.close(),
        }
        self.recent.push_back(*row);
        while self.recent.front().is_some_and(|first| row.now.since(first.now) > BEFORE) {
            self.recent.pop_front();
        }
    }

    /// Ends the edge that is open.
    pub fn close(&mut self) {
        let Some((against, since, rows)) = self.open.take() else { return };
        if rows.last().is_some_and(|last| last.now.since(since) >= LEAST) {
            self.edges.extend(edge(against, since, &rows));
        }
    }
}

fn edge(against: Against, since: Nanos, rows: &[Row]) -> Option<Edge> {
    let time = |taken: Nanos| taken.seconds() - since.seconds();
    let before = rows.iter().rfind(|row| row.now < since)?;
    let side = before.velocity_m_s.signum();
    let (mut lateral, mut amplitude, mut velocity) = (Vec::new(), Vec::new(), Vec::new());
    let (mut load, mut frequency_hz, mut seen) = (0.0, 0.0f64, [None; 3]);
    for row in rows {
        let inputs = &row.inputs.seen;
        frequency_hz = frequency_hz.max(row.drive_hz);
        if let (Ok(force), Ok(normal)) = (inputs.forces.lateral, inputs.forces.normal)
            && force.quality != Quality::Saturated
            && seen[0].replace(force.sequence) != Some(force.sequence)
            && time(force.taken_at) >= -LEAD_S
        {
            lateral.push((time(force.taken_at), side * force.value));
            load += normal.value;
        }
        if let Some(w) = inputs.amplifier.ok().and_then(|a| a.amplitude.ok())
            && seen[1].replace(w.sequence) != Some(w.sequence)
        {
            amplitude.push((time(w.taken_at), w.value));
        }
        if let Ok(stage) = inputs.stage
            && seen[2].replace(stage.sequence) != Some(stage.sequence)
        {
            velocity.push((time(stage.taken_at), side * stage.velocity_m_s));
        }
    }
    let condition = Condition {
        amplitude: PeakToPeak::ZERO,
        frequency_hz: if frequency_hz > 0.0 { frequency_hz } else { Condition::paper().frequency_hz },
        speed_m_s: before.velocity_m_s.abs(),
        normal_force_n: load / lateral.len().max(1) as f64,
        ..Condition::paper()
    };
    // An amplifier that reads no amplitude back shows no instant of a step.
    let shown = against == Against::Position || !amplitude.is_empty();
    let complete = shown && !velocity.is_empty() && condition.normal_force_n > 0.0;
    complete.then_some(Edge { against, condition, lateral, amplitude, velocity })
}

/// Whether a plan's text asks for no edge.
fn without_edges(plan: &[u8]) -> bool {
    let plan = std::str::from_utf8(plan).ok().and_then(|text| parse_toml::<PlanFile>("plan.toml", text).ok());
    plan.is_some_and(|plan| plan.series.iter().all(|series| series.edges == 0))
}

/// Adds what a run's record says of time to a verdict on its passes; a folder without a record adds nothing.
///
/// # Errors
/// A record that cannot be opened.
pub fn add_record(result: &mut Diagnosis, run: &Path, rig: &RigFile) -> miette::Result<()> {
    if !records_in(run)?.is_empty() {
        result.add_record(of_run(run, rig.finger)?);
    }
    Ok(())
}

/// Reads and judges the records of a run's folder.
///
/// # Errors
/// A record that cannot be opened; what is damaged is left out. A finger that no model holds for.
pub fn of_run(folder: &Path, finger: Finger) -> miette::Result<RecordPart> {
    let mut found = Collector::default();
    let mut stated = None;
    for path in records_in(folder)? {
        for entry in open_record(&path, recorder::CYCLES)? {
            match entry {
                Entry::Message { text, .. } => {
                    serde_json::from_slice::<Row>(&text).iter().for_each(|row| found.row(row));
                }
                // A plan that makes none need not be looked through, which takes seconds for minutes of
                // cycles.
                Entry::File { name, bytes, .. } if name == "plan.toml" && without_edges(&bytes) => break,
                Entry::File { name, bytes, .. } if name == REPLAYABLE => {
                    let built = serde_json::from_slice::<Replayable>(&bytes).ok();
                    stated = built.and_then(|built| built.lateral_passband_hz).or(stated);
                }
                _ => {}
            }
        }
        found.close();
        found = Collector { edges: found.edges, ..Collector::default() };
    }
    let law = SpringSlider::new(finger).into_diagnostic()?;
    Ok(judge(&found.edges, &law, stated))
}
