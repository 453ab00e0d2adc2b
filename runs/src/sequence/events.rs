//! What a sweep tells: its passes, events and end, as the record, the catalogue and the report hold them.

use crate::certificates::temperature::TemperatureFlag;
use models::pass::Pass;
use models::prediction::Regime;
use models::reading_evidence::ReadingFinding;
use realtime::compare::{Agreement, PassComparison};
use realtime::ports::Nanos;
use realtime::safety::{Cause, Trip};
use serde::{Deserialize, Serialize};

/// A finished pass with its comparison: what the record, the catalogue and the report hold.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MeasuredPass {
    /// The row of the point table.
    pub pass: Pass,
    /// A reference without vibration.
    pub reference: bool,
    /// Held against the model; `None` where the condition is outside the model's domain.
    pub comparison: Option<PassComparison>,
    /// Regime that the model predicts.
    pub regime: Option<Regime>,
    /// Psi of Eq. 17 at the measured condition; `None` without vibration or without `mu_0`.
    pub psi_eq17: Option<f64>,
    /// What the passes so far say of the two readings of the paper's w; `None` without vibration or without `mu_0`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub psi_reading: Option<ReadingFinding>,
    /// Certificates that do not hold at the temperature that the pass began with. Nothing was corrected for it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub temperature_flags: Vec<TemperatureFlag>,
}

/// What the passes of a sweep say in the end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Findings {
    /// Of the model that they were compared with.
    pub agreement: Agreement,
    /// Of the two readings of the paper's w; `None` where none could tell.
    pub psi_reading: Option<ReadingFinding>,
}

/// Something worth a line in the record and on the terminal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Event {
    /// The rig was armed.
    Armed,
    /// It was armed without a second switch-off channel: what the amplifier refuses, nothing else switches off.
    NoSecondChannel,
    /// It was armed with an amplifier that has no watchdog of its own: if this program dies, the second channel is what
    /// switches off.
    NoWatchdog,
    /// Before the rig was armed, with nothing driven, this rule was broken for want of time; what it left behind (a cut supply, a proof
    /// broken off) is cleared by proving the second channel, from the beginning.
    ArmingDisturbed {
        /// The rule.
        cause: Cause,
        /// Longest lateness of a cycle of the loop before that; zero where only a link fell silent.
        held_up: Nanos,
    },
    /// Force zeros, lifted off, in N: mean of each axis. They are recorded, never taken off silently.
    Zeros {
        /// Lateral.
        lateral_n: Option<f64>,
        /// Normal.
        normal_n: Option<f64>,
        /// Before or after the sweep.
        after: bool,
    },
    /// Safety tripped.
    Tripped(Trip),
    /// The model has left the measurement, after so many passes.
    ModelDeparted {
        /// Point after which.
        point: u64,
        /// ln of the evidence.
        log_evidence: f64,
    },
    /// A stop was asked for (signal or operator).
    StopRequested,
    /// The sweep rests before a pass, as the operator asked: no drive, lifted off, armed.
    Paused {
        /// The pass that comes next.
        point: u32,
    },
    /// It goes on.
    Resumed,
    /// A pass was started again because contact was lost.
    PassRepeated {
        /// Which.
        point: u32,
    },
    /// From this pass on a certificate does not hold at the temperature that the amplifier reports, or that is not
    /// known: every pass until it holds again carries the flag.
    TemperatureBeyondCertificate {
        /// The first such pass.
        point: u32,
        /// What does not hold.
        flag: TemperatureFlag,
    },
    /// A certificate holds within a range of temperatures, and the amplifier reports none: only the setup's
    /// `temperature_c` was checked.
    TemperatureUnwatched {
        /// Which certificate.
        certificate: String,
    },
}

/// How a sweep ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "outcome", rename_all = "snake_case")]
pub enum Outcome {
    /// Every pass was made.
    Complete,
    /// Stopped on request; what was measured is kept.
    Stopped,
    /// A safety trip ended it.
    Tripped(Trip),
    /// The rig would not arm; the cause that stood in the way.
    WouldNotArm {
        /// What stood in the way.
        blocking: Option<Cause>,
    },
    /// No finger: normal force never came.
    NoContact {
        /// At which point.
        point: u32,
    },
    /// Nothing was heard of the loop.
    LoopLost,
    /// Record, passes, catalogue, summary or report could not be written: a measurement that is not kept is not made.
    RecordLost,
}

impl Outcome {
    /// What ended the sweep, or kept it from beginning, where a rule did.
    pub fn cause(&self) -> Option<Cause> {
        match self {
            Outcome::Tripped(trip) => Some(trip.cause),
            Outcome::WouldNotArm { blocking } => *blocking,
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use realtime::safety::Unit;

    /// One of every kind; a new one does not compile until it stands here.
    fn every_kind() -> Vec<Event> {
        let flag = TemperatureFlag {
            certificate: "c".into(),
            range_c: [20.0, 25.0],
            found_c: None,
            missing: Some(realtime::ports::NoData::NotFitted),
        };
        let (cause, at) = (Cause::Stopped, Nanos(1));
        let trip = Trip { cause, value: f64::INFINITY, bound: 1.0, unit: Unit::Newton, cycle: 1, at };
        let all = vec![
            Event::Armed,
            Event::NoSecondChannel,
            Event::NoWatchdog,
            Event::ArmingDisturbed { cause, held_up: at },
            Event::Zeros { lateral_n: None, normal_n: Some(0.0), after: true },
            Event::Tripped(trip),
            Event::ModelDeparted { point: 1, log_evidence: 7.0 },
            Event::StopRequested,
            Event::Paused { point: 1 },
            Event::Resumed,
            Event::PassRepeated { point: 1 },
            Event::TemperatureBeyondCertificate { point: 1, flag },
            Event::TemperatureUnwatched { certificate: "c".into() },
        ];
        for event in &all {
            match event {
                Event::Armed | Event::NoSecondChannel | Event::NoWatchdog | Event::StopRequested => {}
                Event::ArmingDisturbed { .. } | Event::Zeros { .. } | Event::Tripped(_) => {}
                Event::ModelDeparted { .. } | Event::Paused { .. } | Event::Resumed => {}
                Event::PassRepeated { .. } | Event::TemperatureBeyondCertificate { .. } => {}
                Event::TemperatureUnwatched { .. } => {}
            }
        }
        all
    }

    /// The schema that every record carries knows each key of each event.
    #[test]
    fn the_records_schema_describes_every_event() {
        let text = include_str!("../../../realtime/src/recorder/schemas/event.json");
        let schema: serde_json::Value = serde_json::from_str(text).unwrap();
        for event in every_kind() {
            let told = serde_json::to_value(&event).unwrap();
            for key in told.as_object().unwrap().keys() {
                assert!(schema["properties"].get(key).is_some(), "'{key}' of {told}");
            }
        }
    }
}
