//! What goes over the link: `[[poll]]`, `[stream]`, `[[message]]`, `[[query]]`, `[[init]]`, `[[write]]`.

use crate::codec::checksum::Check;
use crate::codec::stream::FrameShape;
use schemars::JsonSchema;
use serde::Deserialize;
use toml::Spanned;

/// Tables of Modbus registers. A coil or a discrete input counts as a register whose value is 0 or 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Table {
    /// Function codes 3, 6 and 16.
    #[default]
    Holding,
    /// Function code 4.
    Input,
    /// Coils: function codes 1 and 15.
    Coil,
    /// Discrete inputs: function code 2.
    Discrete,
}

impl Table {
    /// The function code that reads it.
    pub const fn read_function(self) -> u8 {
        match self {
            Self::Coil => 1,
            Self::Discrete => 2,
            Self::Holding => 3,
            Self::Input => 4,
        }
    }

    /// Whether its registers are single bits on the wire.
    pub const fn is_bits(self) -> bool {
        matches!(self, Self::Coil | Self::Discrete)
    }
}

/// `[[poll]]`: registers that are read together, and yield one sample: `count` of them from `address` on, or
/// those that its signals name by their own `address`, in as few reads as `gap` permits.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Poll {
    /// Name, for signals to refer to.
    #[schemars(with = "String")]
    pub name: Spanned<String>,
    /// Table.
    #[serde(default)]
    pub table: Table,
    /// First register; left out where the signals name theirs.
    pub address: Option<u16>,
    /// How many registers: 1 to 125; left out where the signals name theirs.
    pub count: Option<u16>,
    /// Where the signals name theirs: so many registers between two of them may be read although nobody wants
    /// them, to save a read.
    #[serde(default)]
    pub gap: u16,
    /// Reads per second; left out for one that is read once, at connection.
    pub rate_hz: Option<f64>,
    /// Read once, at connection.
    #[serde(default)]
    pub once: bool,
    /// The signal that counts the instrument's samples, modulo its type.
    pub sequence: Option<String>,
    /// The signal that holds the instrument's own time; its SI value is in seconds.
    pub device_time: Option<String>,
}

/// `[stream]`: frames that the instrument sends without a request. Its frame is called `stream`.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Stream {
    /// Frames per second that the instrument sends.
    pub rate_hz: f64,
    /// The bytes that every frame begins with.
    #[serde(default)]
    pub sync: Vec<u8>,
    /// Length of a frame, sync and check included; left out for lines of text.
    pub length: Option<u16>,
    /// The check at its end; left out for lines of text, and for datagrams, which have one of their own.
    pub check: Option<Check>,
    /// Bytes at a frame's beginning that the check leaves out, such as sync bytes.
    #[serde(default)]
    pub check_from: u16,
    /// `high_first` or `low_first`: the order of the check's bytes. Left out: low first where the check is reflected, as is usual.
    pub check_order: Option<CheckOrder>,
    /// In place of length and check: the instrument sends lines of text like this one, `{lateral},{normal}`,
    /// each number by its signal's name. See docs/profiles.md.
    pub line: Option<String>,
    /// Frames in a row that make an alignment believed.
    #[serde(default = "one_frame")]
    pub believed_after: u32,
    /// The register write that starts it.
    pub start_register: Option<(u16, u16)>,
    /// The function of the maker's own, with its byte, that starts it.
    pub start_function: Option<(u8, u8)>,
    /// Byte that stops it, and how often that is sent; left out for one that runs as long as the instrument is on.
    pub stop: Option<(u8, u16)>,
    /// Silence after the stop before the instrument listens again, in ms.
    #[serde(default)]
    pub settle_ms: u32,
    /// A crashed client leaves an instrument streaming: stop it before the first request.
    #[serde(default)]
    pub stop_before_open: bool,
    /// Signal that counts samples.
    pub sequence: Option<String>,
}

/// The order of a check's bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CheckOrder {
    /// The high byte comes first.
    HighFirst,
    /// The low byte comes first.
    LowFirst,
}

impl Stream {
    /// What its binary frames look like; `None` for lines of text and for datagrams without a check.
    pub fn shape(&self) -> Option<FrameShape> {
        Some(FrameShape {
            sync: self.sync.clone(),
            length: usize::from(self.length?),
            check: self.check?,
            check_from: usize::from(self.check_from),
            check_high_first: self.check_order.map(|order| order == CheckOrder::HighFirst),
            believed_after: self.believed_after,
        })
    }
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
    pub dbc_base: Option<u32>,
    /// Only messages whose multiplexor, by the DBC file, has this value: the signals that are there only then
    /// stand in this group.
    pub multiplex: Option<u64>,
    /// CANopen: identifier less the node number.
    pub cob: Option<u32>,
    /// CANopen: length in bytes.
    pub length: Option<u16>,
    /// What asks for them, sent to `link.base`; left out for messages that come by themselves.
    pub request: Option<Vec<u8>>,
    /// Requests per second, or messages per second where they come by themselves.
    pub rate_hz: f64,
    /// Signal that counts samples.
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
    /// Length of a binary answer; left out for a line of text.
    pub length: Option<u16>,
    /// The answer is a number, an SI prefix or none, and this unit, as `5mm/s/V`; left out for a bare number or a truth.
    pub unit: Option<String>,
    /// The answer is a line like this one, `AMP={amplitude}%,F={frequency}`: each number by its signal's
    /// name. See docs/profiles.md.
    pub answer: Option<String>,
    /// Questions per second.
    pub rate_hz: f64,
}

/// `[[init]]`: what is sent once, at connection.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Init {
    /// A line of text.
    pub send: Option<String>,
    /// Bytes in hexadecimal, sent as they are.
    pub hex: Option<String>,
    /// What the answer to `send` must begin with; left out where there is none.
    pub expect: Option<Vec<String>>,
    /// A CAN frame: identifier (less the node for CANopen) and data.
    pub can: Option<(u32, Vec<u8>)>,
    /// Modbus RTU: a function of the maker's own and its byte; answered by the function and 1.
    pub function: Option<(u8, u8)>,
    /// Modbus: registers read from the first address and written to the second, and how many.
    pub copy: Option<(u16, u16, u16)>,
    /// Modbus: first register, and the values to be written from there on.
    pub registers: Option<(u16, Vec<u16>)>,
    /// Table of `registers`: holding registers, or coils.
    #[serde(default)]
    pub table: Table,
    /// CANopen: object, subindex, bytes and value to be written.
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
    /// Table: holding registers, or coils.
    #[serde(default)]
    pub table: Table,
    /// First register.
    #[serde(default)]
    pub address: u16,
    /// How many registers: 1 to 123. CANopen: bytes in pairs.
    pub count: u16,
    /// CANopen: identifier less the node number.
    pub cob: Option<u32>,
    /// The block is repeated at this rate even without news, to keep a watchdog fed; per second.
    pub rate_hz: Option<f64>,
}

const fn one_frame() -> u32 {
    1
}
