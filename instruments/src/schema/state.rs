//! States and time: `[[signature]]`, `[[fault]]`, `[time]`.

use schemars::JsonSchema;
use serde::Deserialize;
use toml::Spanned;

/// `[[signature]]`: what must hold at connection.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Signature {
    /// The condition.
    #[schemars(with = "String")]
    pub when: Spanned<String>,
    /// What to tell the user where it does not hold.
    pub text: String,
}

/// How grave a fault is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// The sample is invalid, and the rig stops.
    Stop,
    /// The sample counts, and says that it is degraded.
    Degrade,
    /// It is written down.
    Log,
}

/// `[[fault]]`: a state of the instrument that matters.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fault {
    /// The condition.
    #[schemars(with = "String")]
    pub when: Spanned<String>,
    /// How grave it is.
    pub severity: Severity,
    /// It says that a channel is at its rail.
    #[serde(default)]
    pub overrange: bool,
    /// What it means.
    pub text: String,
}

/// Where a sample's time comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Stamp {
    /// The instrument's own clock, mapped to the rig's.
    Device,
    /// The moment that the answer was complete, less the stated latency.
    #[default]
    Arrival,
}

/// `[time]`: how late a sample is.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Time {
    /// Where the time comes from.
    #[serde(default)]
    pub stamp: Stamp,
    /// From the force to the register, in ms.
    #[serde(default)]
    pub latency_ms: f64,
    /// Standard deviation of that, in ms.
    #[serde(default)]
    pub jitter_ms: f64,
    /// -3 dB bandwidth of the instrument's filter, in Hz.
    pub passband_hz: Option<f64>,
    /// The instrument's own samples per second, where it has such.
    pub sample_rate_hz: Option<f64>,
}
