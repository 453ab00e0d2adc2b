//! `[[step]]` of a plan: what a person does at the rig before the passes, between groups of them, and after.

use crate::input::Problems;
use serde::{Deserialize, Serialize};

/// One step of a plan's protocol.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Step {
    /// Before the first pass, between groups of passes at one level of the air, or after the last pass.
    pub when: When,
    /// What is done.
    pub action: Action,
    /// The instruction in words. Left out: the action's own.
    #[serde(default)]
    pub words: String,
    /// s to wait once it is done, with the drive off: 180 for a skin that equilibrates.
    #[serde(default)]
    pub wait_s: f64,
    /// Name, with its unit, of a number that is typed in answer, as in `skin_moisture_au`, which is the
    /// default of `measure_moisture`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub number: Option<String>,
    /// Usual value of that number: what a virtual rig answers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub usual: Option<f64>,
}

/// When a step comes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum When {
    /// Before the first pass of every session.
    Before,
    /// Whenever a level of the air changes, once it was set.
    Between,
    /// After the last pass.
    After,
}

/// What is done in a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Action {
    /// The plate is cleaned.
    Clean,
    /// The finger is washed.
    Wash,
    /// The finger is dried.
    Dry,
    /// Finger and plate come to the state of the room.
    Equilibrate,
    /// The skin's moisture is measured and typed.
    MeasureMoisture,
    /// The fingertip is changed.
    ChangeTip,
    /// The finger is held in contact.
    Contact,
    /// Anything else, in the step's own words.
    Confirm,
}

/// The quantity that a person types after a measurement of the skin's moisture.
pub(crate) const SKIN_MOISTURE: &str = "skin_moisture_au";

impl Step {
    /// The instruction.
    pub fn instruction(&self) -> &str {
        match self.action {
            _ if !self.words.is_empty() => &self.words,
            Action::Clean => "clean the plate",
            Action::Wash => "wash the finger",
            Action::Dry => "dry the finger",
            Action::Equilibrate => "wait until finger and plate have the temperature of the room",
            Action::MeasureMoisture => "measure the moisture of the skin",
            Action::ChangeTip => "change the fingertip",
            Action::Contact => "hold the finger in contact with the plate",
            Action::Confirm => "confirm that the rig is ready",
        }
    }

    /// Name of the number that is typed in answer.
    pub fn number_name(&self) -> Option<&str> {
        self.number.as_deref().or((self.action == Action::MeasureMoisture).then_some(SKIN_MOISTURE))
    }

    pub(super) fn check(&self, wrong: &mut Problems<'_>) {
        if !(self.wait_s.is_finite() && (0.0..=86_400.0).contains(&self.wait_s)) {
            let problem = format!("wait_s = {}: 0 to 86400 s are possible", self.wait_s);
            wrong.add(&["step"], problem, None);
        }
        if self.action == Action::Confirm && self.words.is_empty() {
            let remedy = "add words = \"what to do and confirm\"".to_string();
            wrong.add(&["step"], "a step 'confirm' says in `words` what is confirmed", remedy);
        }
        if self.number.is_some() && self.usual.is_none() {
            let remedy = "add usual = VALUE: what a virtual rig answers".to_string();
            wrong.add(&["step"], "a step with a `number` has its usual value", remedy);
        }
        if self.usual.is_some_and(|usual| !usual.is_finite()) {
            wrong.add(&["step"], "usual is a finite number", None);
        }
    }
}
