//! `[profile]`: who made the instrument, what it can be, and how far the profile was tried.

use schemars::JsonSchema;
use serde::Deserialize;

/// `[profile]`: identity and provenance.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Header {
    /// Version of this schema: 1.
    pub schema: u32,
    /// The name that setups use.
    pub id: String,
    /// Maker.
    pub maker: String,
    /// Models that the profile fits.
    pub models: Vec<String>,
    /// What the instrument can be in a rig.
    pub roles: Vec<Role>,
    /// Firmware that it was written for.
    pub firmware: Option<String>,
    /// Manuals and sources of the facts.
    pub provenance: String,
    /// How far the profile was tried.
    pub verified: ProfileEvidence,
    /// What a user should know before choosing it.
    #[serde(default)]
    pub notes: String,
}

/// What an instrument can be in a rig.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
pub enum Role {
    /// Force along the sliding direction.
    #[serde(rename = "force.lateral")]
    ForceLateral,
    /// Force into the plate.
    #[serde(rename = "force.normal")]
    ForceNormal,
    /// The ultrasonic drive.
    #[serde(rename = "drive.ultrasonic")]
    DriveUltrasonic,
    /// The sliding stage.
    #[serde(rename = "motion.slide")]
    MotionSlide,
    /// Loading of the contact.
    #[serde(rename = "motion.load")]
    MotionLoad,
    /// A switch in the amplifier's supply: the second way to switch off.
    #[serde(rename = "safety.supply")]
    SafetySupply,
    /// Safety contacts: emergency stop, interlock, dead-man.
    #[serde(rename = "safety.contacts")]
    SafetyContacts,
    /// A chamber around the rig, or gauges of the air: pressure, temperature, humidity; beside the loop.
    #[serde(rename = "ambient.chamber")]
    AmbientChamber,
    /// A vibrometer's controller, whose settings are read back for a calibration; it takes no part in a run.
    #[serde(rename = "measure.vibration")]
    MeasureVibration,
}

/// How far a profile was tried.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ProfileEvidence {
    /// Against emulators and independent peers; no hardware was touched.
    EmulatorOnly,
    /// On a bench.
    Bench,
    /// On a bench, with published results.
    Published,
}
