//! The messages of a run in progress.

use realtime::ports::Channel;
use realtime::{Phase, TripCause};
use runs::job::{Deadlines, Extremes, Job, Snapshot, unix_ns};
use runs::setup::Guards;
use runs::{Event, MeasuredPass, Outcome};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// A line for viewers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "about", content = "said", rename_all = "snake_case")]
pub enum Message {
    /// What the run is of; always first.
    Run(Box<Run>),
    /// The rig, ten times a second.
    State(Box<State>),
    /// A pass that is safe on the disk.
    Pass(Box<MeasuredPass>),
    /// Something worth a line.
    Event(TimedEvent),
    /// How far it is.
    Progress(Progress),
    /// The drive was not read back off: what to do, before the message of the run's end.
    Off(String),
    /// It is over; always last.
    Ended(Box<Ended>),
}

/// What a run is of.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// Its folder.
    pub folder: PathBuf,
    /// Name of the plan.
    pub plan: String,
    /// Name of the setup.
    pub setup: String,
    /// Name of the model that it is compared with.
    pub model: String,
    /// Who leads it.
    pub operator: Option<String>,
    /// What is measured.
    pub sample: Option<String>,
    /// When this session began, in s since 1970.
    pub started_unix_s: f64,
    /// In virtual time: nobody can pause it.
    pub fast: bool,
    /// The process that drives it.
    pub process: u32,
    /// Passes planned, those of earlier sessions too.
    pub planned: usize,
    /// Passes that earlier sessions have made.
    pub made_before: usize,
    /// What is to be known of the rig's guards.
    #[serde(default)]
    pub guards: Guards,
}

impl Run {
    /// Of a job that is about to begin.
    pub fn of(job: &Job, planned: usize, made_before: usize) -> Self {
        Run {
            folder: job.out.clone(),
            plan: job.plan.file.name.clone(),
            setup: job.setup.file.name.clone(),
            model: job.model.name().to_string(),
            operator: job.notes.operator.clone(),
            sample: job.notes.sample.clone(),
            started_unix_s: unix_ns() as f64 * 1e-9,
            fast: job.fast,
            process: std::process::id(),
            planned,
            made_before,
            guards: job.setup.guards(),
        }
    }
}

/// The rig in one cycle; `None` where there is nothing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// Loop time in s.
    pub time_s: f64,
    /// Whether the rig is armed.
    pub armed: bool,
    /// Point of the plan.
    pub point: u32,
    /// What the loop does.
    pub phase: Phase,
    /// Lateral force in N.
    pub lateral_force_n: Option<f64>,
    /// Normal force in N.
    pub normal_force_n: Option<f64>,
    /// Peak-to-peak amplitude in m.
    pub amplitude_pp_m: Option<f64>,
    /// Drive frequency that the amplifier shows, in Hz.
    pub frequency_hz: Option<f64>,
    /// Whether the amplifier shows its output on.
    pub output_on: Option<bool>,
    /// Temperature of the amplifier in degrees Celsius.
    pub temperature_c: Option<f64>,
    /// Position of the stage in m.
    pub position_m: Option<f64>,
    /// Velocity of the stage in m/s.
    pub velocity_m_s: Option<f64>,
    /// Running `mu'`.
    pub mu_relative: Option<f64>,
    /// Its standard uncertainty.
    pub mu_relative_sd: Option<f64>,
    /// Predicted `mu'`.
    pub predicted: Option<f64>,
    /// Its standard uncertainty.
    pub predicted_sd: Option<f64>,
    /// Measured less predicted.
    pub residual: Option<f64>,
    /// The same in standard deviations of the difference.
    pub z: Option<f64>,
    /// What stands in the way of arming; while armed, the first rule that is broken now.
    pub blocking: Option<TripCause>,
    /// Of all cycles since the last state.
    #[serde(default)]
    pub extremes: Extremes,
    /// Time of the cycle in the record, in ns since 1970.
    #[serde(default)]
    pub unix_ns: u64,
    /// The deadlines of this session so far.
    #[serde(default)]
    pub deadlines: Deadlines,
    /// Time in s that the plate was driven in this session; none in virtual time.
    #[serde(default)]
    pub driven_s: Option<f64>,
    /// The squared rms velocity summed over that, in m2/s.
    #[serde(default)]
    pub dose_m2_s: Option<f64>,
    /// The cycle as every topic of an export shows it, in the order of [`tables::export::topics::SIGNALS`].
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub signals: Vec<Option<f64>>,
}

impl State {
    /// Of a snapshot of the loop.
    pub fn of(snapshot: &Snapshot) -> Self {
        let row = &snapshot.row;
        let seen = &row.inputs.seen;
        let value = |channel: Channel| channel.ok().map(|r| r.value);
        let (amplifier, stage) = (seen.amplifier.ok(), seen.stage.ok());
        State {
            time_s: row.now.seconds(),
            armed: row.armed,
            point: row.marker.point,
            phase: row.marker.phase,
            lateral_force_n: value(seen.forces.lateral),
            normal_force_n: value(seen.forces.normal),
            amplitude_pp_m: amplifier.and_then(|a| value(a.amplitude)),
            frequency_hz: amplifier.map(|a| a.echoed_frequency_hz),
            output_on: amplifier.map(|a| a.output_on),
            temperature_c: amplifier.and_then(|a| value(a.temperature_c)),
            position_m: stage.map(|s| s.position_m),
            velocity_m_s: stage.map(|s| s.velocity_m_s),
            mu_relative: row.mu_relative.ok().map(|mu| mu.value),
            mu_relative_sd: row.mu_relative.ok().map(|mu| mu.sd),
            predicted: row.online.map(|o| o.predicted),
            predicted_sd: row.online.map(|o| o.predicted_sd),
            residual: row.online.zip(row.mu_relative.ok()).map(|(o, mu)| mu.value - o.predicted),
            z: row.online.map(|o| o.z),
            blocking: row.waits_for,
            extremes: snapshot.extremes,
            unix_ns: snapshot.unix_ns,
            deadlines: snapshot.deadlines,
            driven_s: snapshot.driven.map(|(time, _)| time.seconds()),
            dose_m2_s: snapshot.driven.map(|(_, dose)| dose),
            signals: Vec::new(),
        }
    }
}

/// An event, and when.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TimedEvent {
    /// Loop time in s of the last state before it.
    pub at_s: f64,
    /// What happened.
    pub event: Event,
    /// The same in words, with the remedy of a trip.
    #[serde(default)]
    pub words: String,
}

impl TimedEvent {
    /// An event at a time.
    pub fn of(at_s: f64, event: Event) -> Self {
        let words = runs::report::events::describe(&event);
        TimedEvent { at_s, event, words }
    }
}

/// How far a run is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Progress {
    /// Passes made, in all sessions.
    pub made: usize,
    /// Passes planned.
    pub planned: usize,
    /// Time that the rest should take in s, by the plan.
    pub remaining_s: f64,
}

/// How a run ended.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Ended {
    /// Its outcome; `None` where it failed before or beside its sweep.
    pub outcome: Option<Outcome>,
    /// What to do about that.
    pub remedy: Option<String>,
    /// Why there is no outcome.
    pub error: Option<String>,
    /// The state of the output: read back off, or not.
    pub off: Option<String>,
    /// What the comparison of all passes says.
    pub agreement: Option<String>,
}

impl Ended {
    /// Of what a session returned.
    pub fn of(summary: &miette::Result<runs::job::Summary>) -> Self {
        match summary {
            Ok(summary) => Ended {
                outcome: Some(summary.outcome.clone()),
                remedy: summary.remedy.clone(),
                error: None,
                off: Some(summary.off.words()),
                agreement: Some(summary.agreement.to_string()),
            },
            Err(why) => Ended { error: Some(format!("{why:#}")), ..Ended::default() },
        }
    }
}
