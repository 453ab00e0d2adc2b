//! What tries a profile: `[emulator]` and `[[vector]]`.

use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeMap;
use toml::Spanned;

/// `[emulator]`: what the emulator answers.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Emulator {
    /// Signal name to quantity of the virtual world.
    #[serde(default)]
    pub measure: BTreeMap<String, String>,
    /// Set-point name to quantity of the virtual world.
    #[serde(default)]
    pub command: BTreeMap<String, String>,
    /// Signals that keep one raw value.
    #[serde(default)]
    pub constant: BTreeMap<String, f64>,
    /// Names of the units of `link.choice`, by number. The first has the values above; a unit's range is ten
    /// times that of the unit before: a wrong one answers plausibly.
    #[serde(default)]
    pub names: Vec<String>,
}

/// `[[vector]]`: bytes beside the values that they stand for.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Vector {
    /// The poll or block; may be left out where there is only one.
    pub frame: Option<String>,
    /// Registers, for Modbus.
    pub registers: Option<Vec<u16>>,
    /// Bytes in hexadecimal, spaces allowed.
    pub hex: Option<String>,
    /// A line of text.
    pub line: Option<String>,
    /// Values that were read before, of signals of other frames.
    #[serde(default)]
    pub given: BTreeMap<String, f64>,
    /// Values in their `unit`s, by signal or set-point.
    #[schemars(with = "BTreeMap<String, f64>")]
    pub expect: Spanned<BTreeMap<String, f64>>,
}
