//! What a sweep reports: its passes, events and end, as the record and the report hold them.

use crate::ambient::{AIR, Level, Source, shown};
use crate::certificates::temperature::TemperatureFlag;
use crate::exposure_left::Left;
use crate::format::quantity;
use models::Pass;
use models::prediction::Regime;
use realtime::Nanos;
use realtime::compare::PassComparison;
use realtime::safety::{Remark, Trip, TripCause};
use serde::{Deserialize, Serialize};

/// A finished pass with its comparison: what the record and the report hold.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MeasuredPass {
    /// The row of the point table.
    pub pass: Pass,
    /// A reference without vibration.
    pub reference: bool,
    /// Compared with the model; `None` where the condition is outside the model's domain.
    pub comparison: Option<PassComparison>,
    /// Regime that the model predicts.
    pub regime: Option<Regime>,
    /// Psi of Eq. 17 at the measured condition; `None` without vibration or without `mu_0`.
    pub psi_eq17: Option<f64>,
    /// Certificates that do not hold at the temperature that the pass began with. Nothing was corrected for
    /// it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub temperature_flags: Vec<TemperatureFlag>,
    /// Load that was commanded, in N; `None` where the rig commands none (dead weights).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub commanded_normal_force_n: Option<f64>,
    /// What was found of the air and typed at the rig, by whom and how old.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub levels: Vec<Level>,
}

/// Force zeros of a session, lifted off: the mean of each axis in N, null where the axis sent nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Zeros {
    /// Before the sweep.
    pub before: Option<ZeroLevels>,
    /// After it; none where the sweep did not come to its end.
    pub after: Option<ZeroLevels>,
}

/// One of them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ZeroLevels {
    /// Lateral.
    pub lateral_n: Option<f64>,
    /// Normal.
    pub normal_n: Option<f64>,
}

/// Something worth a line in the record and on the terminal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Event {
    /// The rig was armed.
    Armed,
    /// It was armed without a second switch-off channel: what the amplifier refuses, nothing else switches
    /// off.
    NoSecondChannel,
    /// It was armed with no watchdog at the amplifier and none at its supply: if this program dies, the
    /// output stays on.
    NoWatchdog,
    /// It was armed with a human finger, to which this much is left.
    ExposureLeft(Left),
    /// It was armed with the numbers of a human fingertip, and the setup says that nobody touches the plate.
    NobodyTouches,
    /// It was armed with contacts on the board that the setup declares to have no device: they are not
    /// watched.
    NotWired {
        /// Their names.
        contacts: Vec<String>,
    },
    /// Before the rig was armed, with nothing driven, this rule was broken for want of time; what it left
    /// behind (a cut supply, a proof broken off) is cleared by proving the second channel, from the
    /// beginning.
    ArmingDisturbed {
        /// The rule.
        cause: TripCause,
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
        /// Smallest load of the plan in N.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        smallest_load_n: Option<f64>,
    },
    /// Safety tripped.
    Tripped(Trip),
    /// The measurement disagrees with the model, after so many passes.
    ModelDeparted {
        /// Point after which.
        point: u64,
        /// ln of the evidence.
        log_evidence: f64,
    },
    /// A stop was requested (signal or operator).
    StopRequested,
    /// The sweep rests before a pass, on the operator's request: no drive, lifted off, not armed.
    Paused {
        /// The pass that comes next.
        point: u32,
    },
    /// The pause was longer than its limit, in s: the run ends.
    PauseTooLong {
        /// The limit.
        bound: f64,
    },
    /// In a pause the rig did not show itself off, at rest and lifted off: the run ends.
    PauseNotQuiet {
        /// The rule that says what was not so.
        cause: TripCause,
    },
    /// The pause is over: the rig is armed again, from the proof of the second channel on.
    Resumed,
    /// A pass does not count and is made again: there was no contact, or a force sensor stood still.
    PassRepeated {
        /// Which.
        point: u32,
        /// The rule of the sensor that stood still; none for lost contact.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        cause: Option<TripCause>,
    },
    /// In this pass something was not as it should be: it counts, and the record has each such cycle.
    Remarked {
        /// Which.
        point: u32,
        /// What.
        remark: Remark,
    },
    /// From this pass on a certificate does not hold at the temperature that the amplifier reports, or that
    /// is not known: every pass until it holds again carries the flag.
    TemperatureBeyondCertificate {
        /// The first such pass.
        point: u32,
        /// What does not hold.
        flag: TemperatureFlag,
    },
    /// The rig was disarmed for a person and read back off, at rest.
    Disarmed {
        /// The second channel was read back open; false where none is fitted.
        supply_open: bool,
    },
    /// The operator at the rig must do something.
    #[serde(rename = "asked")]
    OperatorStep {
        /// What is to be done.
        step: String,
        /// Column or name of the number that is to be typed; none where a confirmation will do.
        types: Option<String>,
    },
    /// It was answered.
    Answered {
        /// The step.
        step: String,
        /// The answer as it was given.
        answer: String,
        /// The number in it.
        number: Option<f64>,
        /// By whom.
        answered_by: Source,
        /// s after the question.
        after_s: f64,
        /// Why it was not taken.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        refused: Option<String>,
    },
    /// The timer of a step ran down.
    Waited {
        /// The step.
        step: String,
        /// Its length in s.
        waited_s: f64,
    },
    /// A quantity of the air was given a set-point.
    LevelSet {
        /// Its column in the point table.
        quantity: String,
        /// The set-point.
        wanted: f64,
    },
    /// It is within the plan's tolerance.
    LevelReached {
        /// Its column in the point table.
        quantity: String,
        /// The level that the plan asks for.
        wanted: f64,
        /// What was found.
        found: f64,
        /// By whom.
        source: Source,
        /// s after it was set.
        after_s: f64,
    },
    /// It did not come within the plan's tolerance in time.
    LevelNotReached {
        /// Its column in the point table.
        quantity: String,
        /// The level that the plan asks for.
        wanted: f64,
        /// What was found last.
        last: Option<f64>,
    },
    /// It left the plan's tolerance during a pass: the pass is stored, and marked.
    LevelLost {
        /// Which pass.
        point: u32,
        /// Its column in the point table.
        quantity: String,
        /// The level that the plan asks for.
        wanted: f64,
        /// Smallest and largest value during the pass.
        range: [f64; 2],
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
    /// Stopped on request; what was measured is stored.
    Stopped,
    /// A safety trip ended it.
    Tripped(Trip),
    /// The rig would not arm; the cause that stood in the way.
    WouldNotArm {
        /// What stood in the way.
        blocking: Option<TripCause>,
    },
    /// No finger: normal force never came.
    NoContact {
        /// At which point.
        point: u32,
        /// Mean normal force in N.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        normal_n: Option<f64>,
        /// Least that counts as contact, in N.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        least_n: Option<f64>,
    },
    /// A force sensor showed one raw value throughout a pass, again and again.
    Frozen {
        /// At which point.
        point: u32,
        /// The rule that says which.
        cause: TripCause,
    },
    /// The stage did not come to where a pass starts in time.
    StartNotReached {
        /// At which point.
        point: u32,
        /// The start in m.
        wanted_m: f64,
        /// The stage's position in m, read last.
        found_m: f64,
    },
    /// A level of the air that the plan asks for was not reached in time.
    LevelNotReached {
        /// Its column in the point table.
        quantity: String,
        /// The level.
        wanted: f64,
        /// What was found last.
        found: Option<f64>,
    },
    /// Nothing was heard of the loop.
    LoopLost,
    /// Record, passes, summary or report could not be written: a measurement that is not stored is not made.
    RecordLost,
    /// What the finger was exposed to could not be written in time: nothing is driven that is not counted.
    /// What was measured is stored.
    #[serde(rename = "exposure_not_kept")]
    ExposureNotSaved,
}

impl Outcome {
    /// The cause that ended the sweep or prevented it, where a rule did.
    pub fn cause(&self) -> Option<TripCause> {
        match self {
            Outcome::Tripped(Trip { cause, .. }) | Outcome::Frozen { cause, .. } => Some(*cause),
            Outcome::WouldNotArm { blocking } => *blocking,
            _ => None,
        }
    }

    /// What to do about it, where that is known.
    pub fn remedy(&self) -> Option<&'static str> {
        match self {
            Outcome::NoContact { .. } => Some(
                "check that the finger is lowered, the load or `dead_weight_n`, that lateral and normal are not swapped, and the sign, unit and gain of normal",
            ),
            Outcome::StartNotReached { .. } => Some(
                "check unit, sign and resolution of the stage's position: a pass starts within 0.2 mm; a slower `approach_speed_m_s` may help",
            ),
            Outcome::LevelNotReached { .. } => Some(
                "check the chamber and its sensor, or give more time or a wider band in `[tolerances]` of the plan",
            ),
            Outcome::LoopLost => Some("'muprime doctor' tells what stalls the computer"),
            Outcome::RecordLost | Outcome::ExposureNotSaved => {
                Some("make room on the disk, and check that nothing else holds up its writing")
            }
            _ => self.cause().map(TripCause::remedy),
        }
    }

    /// How the sweep ended, in words.
    pub fn words(&self) -> String {
        match self {
            Outcome::Complete => "complete".into(),
            Outcome::Stopped => "stopped on request".into(),
            Outcome::Tripped(_) => "a safety rule tripped".into(),
            Outcome::WouldNotArm { blocking: Some(cause) } => {
                format!("the rig would not arm: {}", cause.words())
            }
            Outcome::WouldNotArm { blocking: None } => "the rig would not arm".into(),
            Outcome::NoContact { point, normal_n: Some(normal), least_n: Some(least) } => format!(
                "no contact at point {point}: the normal force is {normal:.4} N, and at least {least:.4} N is needed"
            ),
            Outcome::NoContact { point, .. } => format!("no contact at point {point}"),
            Outcome::StartNotReached { point, wanted_m, found_m } => format!(
                "the stage did not reach the start of point {point}: it is at {}, the start at {}",
                quantity(*found_m, "m"),
                quantity(*wanted_m, "m")
            ),
            Outcome::Frozen { point, cause } => format!("no data at point {point}: {}", cause.words()),
            Outcome::LevelNotReached { quantity, wanted, found } => {
                let at = AIR.iter().position(|(covariate, _)| covariate.name == quantity);
                let words = |v: f64| at.map_or_else(|| format!("{quantity} {v}"), |at| shown(at, v));
                let last = found.map_or("nothing was read".into(), |found| format!("last {}", words(found)));
                format!("{} was not reached: {last}", words(*wanted))
            }
            Outcome::LoopLost => "nothing was heard of the loop".into(),
            Outcome::RecordLost => "the record could not be saved".into(),
            Outcome::ExposureNotSaved => "the exposure of the finger could not be written in time".into(),
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
        let (cause, at) = (TripCause::Stopped, Nanos(1));
        let trip = Trip { cause, value: f64::INFINITY, bound: 1.0, unit: Unit::Newton, cycle: 1, at };
        let all = vec![
            Event::Armed,
            Event::NoSecondChannel,
            Event::NoWatchdog,
            Event::NobodyTouches,
            Event::ExposureLeft(Left { hour_s: 1.0, dose_m2_s: 1.0, in_one_go_s: 1.0 }),
            Event::NotWired { contacts: vec!["interlock".into()] },
            Event::PauseTooLong { bound: 600.0 },
            Event::PauseNotQuiet { cause },
            Event::ArmingDisturbed { cause, held_up: at },
            Event::Zeros { lateral_n: None, normal_n: Some(0.0), after: true, smallest_load_n: Some(0.1) },
            Event::Tripped(trip),
            Event::ModelDeparted { point: 1, log_evidence: 7.0 },
            Event::StopRequested,
            Event::Paused { point: 1 },
            Event::Resumed,
            Event::PassRepeated { point: 1, cause: Some(cause) },
            Event::Remarked { point: 1, remark: Remark::AmplitudeSags },
            Event::TemperatureBeyondCertificate { point: 1, flag },
            Event::TemperatureUnwatched { certificate: "c".into() },
            Event::Disarmed { supply_open: true },
            Event::OperatorStep { step: "s".into(), types: Some("t".into()) },
            Event::Answered {
                step: "s".into(),
                answer: "a".into(),
                number: Some(1.0),
                answered_by: Source::Operator,
                after_s: 1.0,
                refused: Some("r".into()),
            },
            Event::Waited { step: "s".into(), waited_s: 1.0 },
            Event::LevelSet { quantity: "q".into(), wanted: 1.0 },
            Event::LevelReached {
                quantity: "q".into(),
                wanted: 1.0,
                found: 1.0,
                source: Source::Instrument,
                after_s: 1.0,
            },
            Event::LevelNotReached { quantity: "q".into(), wanted: 1.0, last: None },
            Event::LevelLost { point: 1, quantity: "q".into(), wanted: 1.0, range: [1.0, 2.0] },
        ];
        for event in &all {
            match event {
                Event::Armed | Event::NoSecondChannel | Event::NoWatchdog | Event::StopRequested => {}
                Event::NobodyTouches | Event::NotWired { .. } | Event::ExposureLeft(_) => {}
                Event::PauseTooLong { .. } | Event::PauseNotQuiet { .. } => {}
                Event::ArmingDisturbed { .. } | Event::Zeros { .. } | Event::Tripped(_) => {}
                Event::ModelDeparted { .. } | Event::Paused { .. } | Event::Resumed => {}
                Event::PassRepeated { .. } | Event::Remarked { .. } => {}
                Event::TemperatureBeyondCertificate { .. } => {}
                Event::TemperatureUnwatched { .. } | Event::Disarmed { .. } | Event::OperatorStep { .. } => {}
                Event::Answered { .. } | Event::Waited { .. } | Event::LevelSet { .. } => {}
                Event::LevelReached { .. } | Event::LevelNotReached { .. } | Event::LevelLost { .. } => {}
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
            let document = serde_json::to_value(&event).unwrap();
            for key in document.as_object().unwrap().keys() {
                assert!(schema["properties"].get(key).is_some(), "'{key}' of {document}");
            }
        }
    }
}
