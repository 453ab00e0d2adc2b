//! `[link]`: the bus, its settings and its time limits.

use schemars::JsonSchema;
use serde::Deserialize;
use std::time::Duration;

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
    /// The same over TCP, for instruments with a socket of their own.
    Tcp,
    /// Frames or lines that come by themselves in datagrams.
    Udp,
    /// SCPI over TCP.
    Scpi,
    /// Attributes of a device that the kernel drives, such as an IIO converter's in sysfs: a question is the
    /// name of one, its content the answer.
    Sysfs,
}

/// `[link]`: how the instrument is reached. The setup has the address itself.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Link {
    /// Kind of link.
    pub kind: LinkKind,
    /// TCP or UDP port, unless the setup names one.
    pub port: Option<u16>,
    /// UDP: the port of this machine that the instrument is set to send to. Left out: it sends to where an `[[init]]` comes from.
    pub local_port: Option<u16>,
    /// Modbus unit, unless the setup names one.
    pub unit: Option<u8>,
    /// Symbols per second on a serial line.
    pub baud: Option<u32>,
    /// Bits per second on a CAN bus.
    pub bitrate: Option<u32>,
    /// Data bits, parity and stop bits, as `8N1`.
    pub format: Option<String>,
    /// DBC file that describes the signals of CAN messages.
    pub dbc: Option<String>,
    /// CANopen: the electronic data sheet that describes the objects and the process data.
    pub eds: Option<String>,
    /// CAN identifier that others are counted from, unless the setup names one.
    pub base: Option<u32>,
    /// CANopen node, unless the setup names one.
    pub node: Option<u8>,
    /// The node's heartbeat may stay away this long, in ms.
    pub heartbeat_ms: Option<u32>,
    /// What ends a line that is sent.
    pub tx_terminator: Option<String>,
    /// What ends a line that comes.
    pub rx_terminator: Option<String>,
    /// Pause between two requests, in ms.
    #[serde(default)]
    pub min_gap_ms: f64,
    /// Alarms: lines sent without a request, such as `ALARM {code}`. See docs/profiles.md.
    #[serde(default)]
    pub unsolicited: Vec<String>,
    /// A query that is put after every set-point, and what its answer must begin with.
    pub error_query: Option<ErrorQuery>,
    /// Several units of one kind, of which the setup means one by its name: `{which}` in the questions is its number.
    pub choice: Option<Choice>,
    /// A connection must stand within this time, in ms.
    #[serde(default = "connect_timeout_ms")]
    pub connect_timeout_ms: u32,
    /// An answer must be complete within this time, in ms, from 1 on; afterwards the connection is dropped.
    /// At most 2000 with `safe` set-points. An 'off' that waits cuts it to 100.
    #[serde(default = "response_timeout_ms")]
    pub response_timeout_ms: u32,
    /// First pause before a new connection, in ms; it doubles up to `backoff_longest_ms`.
    #[serde(default = "backoff_first_ms")]
    pub backoff_first_ms: u32,
    /// Longest pause before a new connection, in ms.
    #[serde(default = "backoff_longest_ms")]
    pub backoff_longest_ms: u32,
}

impl Link {
    /// What ends a line that is sent.
    pub fn tx_end(&self) -> &str {
        self.tx_terminator.as_deref().unwrap_or("\n")
    }

    /// What ends a line that comes.
    pub fn rx_end(&self) -> &str {
        self.rx_terminator.as_deref().unwrap_or("\n")
    }

    /// Data bits, parity and stop bits of a serial line.
    pub fn line_format(&self) -> &str {
        self.format.as_deref().unwrap_or("8N1")
    }

    /// How long an answer may take.
    pub fn patience(&self) -> Duration {
        Duration::from_millis(self.response_timeout_ms.into())
    }
}

/// The query for the name of each of several units.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Choice {
    /// The question for a name; `{which}` is the number of the unit, from 0.
    pub ask: String,
    /// Most numbers that are queried.
    pub most: u8,
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

const fn backoff_first_ms() -> u32 {
    20
}
const fn backoff_longest_ms() -> u32 {
    2000
}
const fn connect_timeout_ms() -> u32 {
    1000
}
const fn response_timeout_ms() -> u32 {
    100
}
