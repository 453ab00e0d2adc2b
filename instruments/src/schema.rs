//! What may stand in a profile: one serde type a section, one field a key.
//! A new key is a field of the section's type, in the module that bears the section's name.
//!
//! Unknown keys are errors with their place in the file. The same types make the JSON Schema that
//! editors use ([`json_schema`]). What these types cannot say (that a signal's frame exists, that
//! a field lies within its frame) is checked when the profile is compiled, in [`crate::profile`].

use schemars::JsonSchema;
use serde::Deserialize;

mod frames;
mod header;
mod link;
mod state;
mod trial;
mod values;

pub use frames::{CheckOrder, Init, Message, Poll, Query, Stream, Table, Write};
pub use header::{Header, ProfileEvidence, Role};
pub use link::{Choice, ErrorQuery, Link, LinkKind};
pub use state::{Fault, Severity, Signature, Stamp, Time};
pub use trial::{Emulator, Vector};
pub use values::{Set, Si, Signal};

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
    /// Frames that the instrument sends without a request, after the stream was started.
    pub stream: Option<Stream>,
    /// CAN messages that together make one sample.
    #[serde(default)]
    pub message: Vec<Message>,
    /// Lines of text or blocks of bytes that are requested.
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

/// The JSON Schema of a profile, for editors.
pub fn json_schema() -> schemars::Schema {
    schemars::schema_for!(Description)
}
