//! What may stand in a profile: one serde type a section, one field a key.
//!
//! Unknown keys are errors with their place in the file. The same types make the JSON Schema that
//! editors use ([`json_schema`]). What these types cannot say (that a signal's frame exists, that
//! a field lies within its frame) is checked when the profile is compiled, in [`crate::profile`].

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Deserialize;
use toml::Spanned;

use crate::codec::checksum::Check;
use crate::field::{ByteOrder, NumberType};

/// One instrument.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Description {
    /// Who made it, what it is, where the facts come from.
    pub profile: Header,
    /// How it is reached.
    pub link: Link,
    /// Reads of registers; each yields ONE sample with one time.
    #[serde(default)]
    pub poll: Vec<Poll>,
    /// Frames that come without being asked for, after the stream was started.
    #[serde(default)]
    pub stream: Option<Stream>,
    /// CAN messages that together make one sample.
    #[serde(default)]
    pub message: Vec<Message>,
    /// Lines of text or blocks of bytes that are asked for.
    #[serde(default)]
    pub query: Vec<Query>,
    /// What is sent once, at connection, before anything else.
    #[serde(default)]
    pub init: Vec<Init>,
    /// Blocks of set-points that are written in one piece.
    #[serde(default)]
    pub write: Vec<Write>,
    /// The numbers that the instrument gives.
    #[serde(default)]
    pub signal: Vec<Signal>,
    /// The set-points that it takes.
    #[serde(default)]
    pub set: Vec<Set>,
    /// What must hold at connection, else the instrument is refused.
    #[serde(default)]
    pub signature: Vec<Signature>,
    /// States of the instrument that matter.
    #[serde(default)]
    pub fault: Vec<Fault>,
    /// Where the time of a sample comes from, and how late it is.
    #[serde(default)]
    pub time: Time,
    /// What the emulator answers.
    #[serde(default)]
    pub emulator: Emulator,
    /// Golden vectors: bytes beside the values that they stand for.
    #[serde(default)]
    pub vector: Vec<Vector>,
}

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
    #[serde(default)]
    pub firmware: Option<String>,
    /// Manuals and sources of the facts.
    pub provenance: String,
    /// How far the profile was tried.
    pub verified: Verified,
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
}

/// How far a profile was tried.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Verified {
    /// Against emulators and independent peers; no hardware was touched.
    EmulatorOnly,
    /// On a bench.
    Bench,
    /// On a bench, with published results.
    Published,
}

/// Kinds of link.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LinkKind {
    /// Modbus over TCP.
    ModbusTcp,
    /// Modbus RTU over a serial line.
    ModbusRtu,
    /// Plain CAN.
    Can,
    /// CANopen.
    Canopen,
    /// Lines of text and blocks of bytes over a serial line.
    Serial,
    /// SCPI over TCP.
    Scpi,
}

/// `[link]`: how the instrument is reached. The address itself stands in the setup.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Link {
    /// Kind of link.
    pub kind: LinkKind,
    /// TCP port, unless the setup names one.
    #[serde(default)]
    pub port: Option<u16>,
    /// Modbus unit, unless the setup names one.
    #[serde(default)]
    pub unit: Option<u8>,
    /// Symbols per second on a serial line.
    #[serde(default)]
    pub baud: Option<u32>,
    /// Bits per second on a CAN bus.
    #[serde(default)]
    pub bitrate: Option<u32>,
    /// Data bits, parity and stop bits, as `8N1`.
    #[serde(default)]
    pub format: Option<String>,
    /// DBC file that describes the signals of CAN messages.
    #[serde(default)]
    pub dbc: Option<String>,
    /// CAN identifier that others are counted from, unless the setup names one.
    #[serde(default)]
    pub base: Option<u32>,
    /// CANopen node, unless the setup names one.
    #[serde(default)]
    pub node: Option<u8>,
    /// The node's heartbeat may stay away this long, in ms.
    #[serde(default)]
    pub heartbeat_ms: Option<u32>,
    /// What ends a line that is sent.
    #[serde(default)]
    pub tx_terminator: Option<String>,
    /// What ends a line that comes.
    #[serde(default)]
    pub rx_terminator: Option<String>,
    /// Pause between two requests, in ms.
    #[serde(default)]
    pub min_gap_ms: f64,
    /// Lines that come without being asked for.
    #[serde(default)]
    pub unsolicited: Vec<String>,
    /// A query that is put after every set-point, and what its answer must begin with.
    #[serde(default)]
    pub error_query: Option<ErrorQuery>,
    /// A connection must stand within this time, in ms.
    #[serde(default = "defaults::connect_timeout_ms")]
    pub connect_timeout_ms: u32,
    /// An answer must be complete within this time, in ms; afterwards the connection is dropped.
    #[serde(default = "defaults::response_timeout_ms")]
    pub response_timeout_ms: u32,
    /// First pause before a new connection, in ms; it doubles up to `backoff_longest_ms`.
    #[serde(default = "defaults::backoff_first_ms")]
    pub backoff_first_ms: u32,
    /// Longest pause before a new connection, in ms.
    #[serde(default = "defaults::backoff_longest_ms")]
    pub backoff_longest_ms: u32,
}

/// Tables of Modbus registers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Table {
    /// Function codes 3, 6 and 16.
    #[default]
    Holding,
    /// Function code 4.
    Input,
}

/// `[[poll]]`: one read of neighbouring registers, which yields one sample.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Poll {
    /// Name, for signals to refer to.
    #[schemars(with = "String")]
    pub name: Spanned<String>,
    /// Table.
    #[serde(default)]
    pub table: Table,
    /// First register.
    pub address: u16,
    /// How many registers: 1 to 125.
    pub count: u16,
    /// Reads per second; left out for one that is read once, at connection.
    #[serde(default)]
    pub rate_hz: Option<f64>,
    /// Read once, at connection.
    #[serde(default)]
    pub once: bool,
    /// The signal that counts the instrument's samples, modulo its type.
    #[serde(default)]
    pub sequence: Option<String>,
    /// The signal that holds the instrument's own time; its SI value is in seconds.
    #[serde(default)]
    pub device_time: Option<String>,
}

/// A question for errors.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ErrorQuery {
    /// The question.
    pub send: String,
    /// What the answer begins with where there is no error.
    pub ok: Vec<String>,
}

/// `[stream]`: frames that come without being asked for. Its frame is called `stream`.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Stream {
    /// Frames per second that the instrument sends.
    pub rate_hz: f64,
    /// The bytes that every frame begins with.
    #[serde(default)]
    pub sync: Vec<u8>,
    /// Length of a frame, sync and check included.
    pub length: u16,
    /// The check at its end.
    pub check: Check,
    /// Frames in a row that make an alignment believed.
    #[serde(default = "defaults::one_frame")]
    pub believed_after: u32,
    /// The register write that starts it.
    #[serde(default)]
    pub start_register: Option<(u16, u16)>,
    /// The function of the maker's own, with its byte, that starts it.
    #[serde(default)]
    pub start_function: Option<(u8, u8)>,
    /// Byte that stops it, and how often that is sent.
    pub stop: (u8, u16),
    /// Silence after the stop before the instrument listens again, in ms.
    pub settle_ms: u32,
    /// A crashed client leaves an instrument streaming: stop it before the first request.
    #[serde(default)]
    pub stop_before_open: bool,
    /// Signal that counts samples.
    #[serde(default)]
    pub sequence: Option<String>,
}

/// `[[message]]`: CAN messages that together make one sample, with what asks for them.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Message {
    /// Name, for signals to refer to.
    #[schemars(with = "String")]
    pub name: Spanned<String>,
    /// The messages by their names in the DBC file, in the order in which they come; or none, and `cob`.
    #[serde(default)]
    pub replies: Vec<String>,
    /// The identifier that the DBC file's identifiers were written for; they move with `link.base`.
    #[serde(default)]
    pub dbc_base: Option<u32>,
    /// CANopen: identifier less the node number.
    #[serde(default)]
    pub cob: Option<u32>,
    /// CANopen: length in bytes.
    #[serde(default)]
    pub length: Option<u16>,
    /// What asks for them, sent to `link.base`; left out for messages that come by themselves.
    #[serde(default)]
    pub request: Option<Vec<u8>>,
    /// Requests per second, or messages per second where they come by themselves.
    pub rate_hz: f64,
    /// Signal that counts samples.
    #[serde(default)]
    pub sequence: Option<String>,
}

/// `[[query]]`: a question, and the answer as one sample.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Query {
    /// Name, for signals to refer to.
    #[schemars(with = "String")]
    pub name: Spanned<String>,
    /// The question, without its terminator.
    pub send: String,
    /// Length of a binary answer; left out for a line of text that is one number or a truth.
    #[serde(default)]
    pub length: Option<u16>,
    /// Questions per second.
    pub rate_hz: f64,
}

/// `[[init]]`: what is sent once, at connection.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Init {
    /// A line of text.
    #[serde(default)]
    pub send: Option<String>,
    /// What its answer must begin with; left out where there is none.
    #[serde(default)]
    pub expect: Option<Vec<String>>,
    /// A CAN frame: identifier (less the node for CANopen) and data.
    #[serde(default)]
    pub can: Option<(u32, Vec<u8>)>,
    /// CANopen: object, subindex, bytes and value to be written.
    #[serde(default)]
    pub sdo: Option<(u16, u8, u8, i64)>,
    /// What to tell the user where the answer is another.
    #[serde(default)]
    pub text: String,
}

/// `[[write]]`: a block of set-points, written in one piece.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Write {
    /// Name, for set-points to refer to.
    #[schemars(with = "String")]
    pub name: Spanned<String>,
    /// First register.
    #[serde(default)]
    pub address: u16,
    /// How many registers: 1 to 123. CANopen: bytes in pairs.
    pub count: u16,
    /// CANopen: identifier less the node number.
    #[serde(default)]
    pub cob: Option<u32>,
    /// The block is repeated at this rate even without news, to keep a watchdog fed; per second.
    #[serde(default)]
    pub rate_hz: Option<f64>,
}

/// `[[signal]]`: one number that the instrument gives.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Signal {
    /// Name, for setups, faults and vectors.
    #[schemars(with = "String")]
    pub name: Spanned<String>,
    /// The poll that it stands in; may be left out where there is only one.
    #[serde(default)]
    pub frame: Option<String>,
    /// First register, counted from the start of the frame.
    #[serde(default)]
    pub register: Option<u16>,
    /// First byte, counted from the start of the frame.
    #[serde(default)]
    pub byte: Option<u16>,
    /// `message.signal` of the DBC file, in place of register, byte and type.
    #[serde(default)]
    pub dbc: Option<String>,
    /// Type; left out for DBC signals and for lines of text.
    #[serde(rename = "type", default)]
    pub number: Option<NumberType>,
    /// Byte order.
    #[serde(default)]
    pub byte_order: ByteOrder,
    /// First bit and width, where only a part of the number counts.
    #[serde(default)]
    pub bits: Option<(u32, u32)>,
    /// Counts times this are `unit`s.
    #[serde(default = "defaults::one")]
    pub scale: f64,
    /// A scale that depends on other signals, such as `pow10(-decimals)`; multiplies `scale`.
    #[serde(default)]
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
    #[serde(default)]
    pub range: Option<(f64, f64)>,
    /// Standard deviation of the noise, in `unit`s.
    #[serde(default)]
    pub noise: Option<f64>,
    /// The value counts only where this holds.
    #[serde(default)]
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
    #[serde(default)]
    pub block: Option<String>,
    /// First register, counted from the start of the block.
    #[serde(default)]
    pub register: u16,
    /// Type; left out for lines of text.
    #[serde(rename = "type", default)]
    pub number: Option<NumberType>,
    /// The line of text that carries it; `{}` is the value.
    #[serde(default)]
    pub send: Option<String>,
    /// The line of text where the value is zero.
    #[serde(default)]
    pub send_zero: Option<String>,
    /// What the answer to `send` and to `send_zero` begins with; left out where there is none.
    #[serde(default)]
    pub answer: Option<(String, String)>,
    /// Byte order.
    #[serde(default)]
    pub byte_order: ByteOrder,
    /// Counts times this are `unit`s.
    #[serde(default = "defaults::one")]
    pub scale: f64,
    /// Unit of the scaled value.
    #[serde(default)]
    pub unit: String,
    /// Turns `unit` into its SI unit.
    #[serde(default)]
    pub si: Si,
    /// Smallest and largest value that may be sent, in `unit`s; others are refused.
    #[serde(default)]
    pub range: Option<(f64, f64)>,
    /// The value that makes the rig safe, in `unit`s.
    #[serde(default)]
    pub safe: Option<f64>,
    /// The signal that echoes what the instrument took.
    #[serde(default)]
    pub echo: Option<String>,
    /// What it is, for the generated documentation.
    #[serde(default)]
    pub text: String,
}

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
    #[serde(default)]
    pub passband_hz: Option<f64>,
    /// The instrument's own samples per second, where it has such.
    #[serde(default)]
    pub sample_rate_hz: Option<f64>,
}

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
}

/// `[[vector]]`: bytes beside the values that they stand for.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Vector {
    /// The poll or block; may be left out where there is only one.
    #[serde(default)]
    pub frame: Option<String>,
    /// Registers, for Modbus.
    #[serde(default)]
    pub registers: Option<Vec<u16>>,
    /// Bytes in hexadecimal, spaces allowed.
    #[serde(default)]
    pub hex: Option<String>,
    /// A line of text.
    #[serde(default)]
    pub line: Option<String>,
    /// Values in their `unit`s, by signal or set-point.
    #[schemars(with = "BTreeMap<String, f64>")]
    pub expect: Spanned<BTreeMap<String, f64>>,
}

mod defaults {
    pub const fn connect_timeout_ms() -> u32 {
        1000
    }
    pub const fn response_timeout_ms() -> u32 {
        100
    }
    pub const fn backoff_first_ms() -> u32 {
        20
    }
    pub const fn backoff_longest_ms() -> u32 {
        2000
    }
    pub const fn one() -> f64 {
        1.0
    }
    pub const fn one_frame() -> u32 {
        1
    }
}

/// The JSON Schema of a profile, for editors.
#[must_use]
pub fn json_schema() -> schemars::Schema {
    schemars::schema_for!(Description)
}
