//! Why a conversation ended, and how the link was closed then.

use super::endpoint::BadFrame;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// A link tries this long to switch off and to read it back, reconnections included; then it is
/// given up, and [`Closed::NotReadBack`] says so.
pub const OFF_WITHIN: Duration = Duration::from_secs(2);
/// So many bad answers in a row end a connection.
pub const BAD_IN_A_ROW: u32 = 3;

/// Why a conversation ended.
#[derive(Debug, PartialEq, thiserror::Error)]
pub enum LinkError {
    /// The address of the instrument leads nowhere.
    #[error(transparent)]
    Address(#[from] AddressError),
    /// Nothing came before the end.
    #[error("its thread ended before the first sample")]
    Unopened,
    /// The thread is to end.
    #[error("stopped")]
    Stopped,
    /// A deadline passed.
    #[error("no answer within {0} ms")]
    Timeout(u32),
    /// A deadline passed in the midst of an answer: what came of it, and the likely cause.
    #[error("{0}")]
    Cut(String),
    /// The line itself failed.
    #[error("{0}")]
    Io(String),
    /// The instrument refuses a request.
    #[error("the instrument refused: {0}")]
    Refused(String),
    /// Answers do not pass their checks.
    #[error("{BAD_IN_A_ROW} bad answers in a row; the last: {0}")]
    Corrupt(String),
    /// A frame that must not become a sample.
    #[error(transparent)]
    Frame(#[from] BadFrame),
    /// 'Off' was sent again and again, and the instrument still shows 'on', or shows nothing.
    #[error("the instrument did not show 'off' within {} s of the command", OFF_WITHIN.as_secs())]
    StillOn,
    /// The driver panicked: a fault of this program.
    #[error("the driver panicked: {0}")]
    Panicked(String),
}

impl From<std::io::Error> for LinkError {
    fn from(error: std::io::Error) -> Self {
        Self::Io(error.to_string())
    }
}

/// An address that leads nowhere.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum AddressError {
    /// It is that of a serial line.
    #[error("`{0}` is a serial line, and the profile uses TCP: write rtu:{0}")]
    Serial(String),
    /// It lacks a port.
    #[error("neither the address nor the profile names a port")]
    NoPort,
    /// Its name is unknown.
    #[error("no machine is called `{0}`; give its name or IP address")]
    Unknown(String),
    /// Its name has no address.
    #[error("`{0}` stands for no address")]
    Empty(String),
}

/// How a link was closed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Closed {
    /// A sensor, or an instrument without safe set-points: nothing to switch off.
    NothingToSwitch,
    /// The safe set-points were sent, and a later state of the instrument showed that it is off, or stands.
    ReadBackOff,
    /// No state has shown that. The reason in words.
    NotReadBack(String),
}
