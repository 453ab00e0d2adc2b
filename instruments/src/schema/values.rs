//! The numbers in the frames: `[[signal]]` and `[[set]]`, with their units.

use crate::field::{ByteOrder, NumberType};
use schemars::JsonSchema;
use serde::Deserialize;
use toml::Spanned;

/// `[[signal]]`: one number that the instrument gives.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Signal {
    /// Name, for setups, faults and vectors.
    #[schemars(with = "String")]
    pub name: Spanned<String>,
    /// The poll that it stands in; may be left out where there is only one.
    pub frame: Option<String>,
    /// First register, counted from the start of the frame.
    pub register: Option<u16>,
    /// First register by the instrument's own map, in place of `register`.
    pub address: Option<u16>,
    /// First byte, counted from the start of the frame.
    pub byte: Option<u16>,
    /// How many neighbours of the same type there are: they are called `name0`, `name1` and so on.
    pub array: Option<u16>,
    /// Worked out from other signals, in place of register, byte and type; linear in those of its own frame.
    pub value: Option<String>,
    /// CANopen: index and subindex, in place of byte and type; the data sheet says where in the process data.
    pub object: Option<(u16, u8)>,
    /// `message.signal` of the DBC file, in place of register, byte and type.
    pub dbc: Option<String>,
    /// Type; left out for DBC signals, for objects and for lines of text.
    #[serde(rename = "type", default)]
    pub number: Option<NumberType>,
    /// Byte order.
    #[serde(default)]
    pub byte_order: ByteOrder,
    /// First bit (from the least significant) and width, where only a part of the number counts; also of an
    /// object, and of a whole number of a DBC file.
    pub bits: Option<(u32, u32)>,
    /// Counts times this are `unit`s.
    #[serde(default = "one")]
    pub scale: f64,
    /// A scale that depends on other signals, such as `pow10(-decimals)`; multiplies `scale`.
    pub scale_expr: Option<String>,
    /// Added after scaling, in `unit`s.
    #[serde(default)]
    pub offset: f64,
    /// Unit of the scaled value; empty for a bare number.
    #[serde(default)]
    pub unit: String,
    /// Turns `unit` into its SI unit.
    #[serde(default)]
    pub si: Si,
    /// Smallest and largest value that the instrument can measure, in `unit`s.
    pub range: Option<(f64, f64)>,
    /// The smallest change that the instrument shows, in SI units. Left out: one count, where counts are
    /// whole numbers; unknown for floats, whose type says nothing of it.
    pub resolution_si: Option<f64>,
    /// Standard deviation of the noise, in `unit`s.
    pub noise: Option<f64>,
    /// The value counts only where this holds.
    pub valid_when: Option<String>,
    /// What it is, for the generated documentation.
    #[serde(default)]
    pub text: String,
}

/// The way from an instrument's unit to SI.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Si {
    /// SI value = value times this.
    pub factor: f64,
    /// The SI unit.
    pub unit: String,
}

impl Default for Si {
    fn default() -> Self {
        Self { factor: 1.0, unit: String::new() }
    }
}

/// `[[set]]`: one absolute set-point. There are no increments and no toggles: a frame that reaches
/// the instrument twice must do no harm.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Set {
    /// Name, for the driver.
    #[schemars(with = "String")]
    pub name: Spanned<String>,
    /// The block that it stands in; may be left out where there is only one.
    pub block: Option<String>,
    /// First register, counted from the start of the block.
    #[serde(default)]
    pub register: u16,
    /// CANopen: index and subindex, in place of register and type; the data sheet says where in the process data.
    pub object: Option<(u16, u8)>,
    /// Type; left out for lines of text.
    #[serde(rename = "type", default)]
    pub number: Option<NumberType>,
    /// The line of text that carries it; `{}` is the value, `{name}` the newest one of another set-point.
    /// Forms such as `{:.1}` and `{:04X}`: see docs/profiles.md.
    pub send: Option<String>,
    /// The line of text where the value is zero.
    pub send_zero: Option<String>,
    /// What the answer begins with: where the value is not zero, and where it is; left out where there is none.
    pub answer: Option<(String, String)>,
    /// Byte order.
    #[serde(default)]
    pub byte_order: ByteOrder,
    /// Counts times this are `unit`s.
    #[serde(default = "one")]
    pub scale: f64,
    /// Unit of the scaled value.
    #[serde(default)]
    pub unit: String,
    /// Turns `unit` into its SI unit.
    #[serde(default)]
    pub si: Si,
    /// Smallest and largest value that may be sent, in `unit`s; others are refused.
    pub range: Option<(f64, f64)>,
    /// The value that makes the rig safe, in `unit`s.
    pub safe: Option<f64>,
    /// The signal that echoes what the instrument took.
    pub echo: Option<String>,
    /// Of a `heartbeat`: how long the instrument waits for another value until it switches off by itself, in ms.
    pub timeout_ms: Option<u32>,
    /// What it is, for the generated documentation.
    #[serde(default)]
    pub text: String,
}

const fn one() -> f64 {
    1.0
}
