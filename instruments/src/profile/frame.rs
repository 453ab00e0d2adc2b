//! Frames: what comes as one, and yields one sample.

use super::SignalId;
use crate::codec::text::Form;

/// One frame, compiled: a poll, the stream, a group of messages or a query. Each yields one sample.
#[derive(Debug, Clone)]
pub struct Frame {
    /// Name.
    pub name: String,
    /// Length in bytes.
    pub bytes: usize,
    /// The signal that counts the instrument's samples.
    pub sequence: Option<SignalId>,
    /// The signal that holds the instrument's own time.
    pub device_time: Option<SignalId>,
    /// What it is.
    pub kind: FrameKind,
    /// What its lines look like, where it is one of text: its bytes are then the numbers as doubles, high byte first.
    pub text: Option<Form>,
}

impl Frame {
    /// The bytes of a line of text; `None` where it is no such line.
    #[must_use]
    pub fn read_line(&self, line: &str) -> Option<Vec<u8>> {
        let numbers = self.text.as_ref()?.read(line)?;
        Some(numbers.into_iter().flat_map(f64::to_be_bytes).collect())
    }

    /// The line of text of these bytes, its numbers times `factor`; `None` for a frame that is none of text.
    #[must_use]
    pub fn write_line(&self, bytes: &[u8], factor: f64) -> Option<String> {
        let number = |eight: &[u8]| eight.try_into().map_or(f64::NAN, f64::from_be_bytes) * factor;
        let numbers: Vec<f64> = bytes.chunks_exact(8).map(number).collect();
        self.text.as_ref().map(|form| form.write(&numbers))
    }
}

/// One CAN message of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Part {
    /// Identifier, less the base that it is counted from.
    pub id: u32,
    /// The DBC file gives the identifier 29 bits.
    pub extended: bool,
    /// Bytes.
    pub length: usize,
}

impl Part {
    /// Its identifier, and whether that has 29 bits, for an instrument at that base.
    #[must_use]
    pub const fn at(self, base: u32) -> (u32, bool) {
        let id = base.saturating_add(self.id);
        (id, self.extended || id > 0x7FF)
    }
}

/// What a frame is.
#[derive(Debug, Clone, PartialEq)]
pub enum FrameKind {
    /// Registers; the index of the poll in the description.
    Poll(usize),
    /// Frames that come by themselves.
    Stream,
    /// CAN messages; the index in the description, and the messages.
    Messages(usize, Vec<Part>),
    /// A question; the index in the description.
    Query(usize),
}
