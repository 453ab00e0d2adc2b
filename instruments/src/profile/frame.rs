//! Frames: what comes as one, and yields one sample.

use super::SignalId;
use crate::codec::dbc::DbcSignal;
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
    /// The reads that it is made of, one after the other; none but for registers.
    pub spans: Vec<Span>,
    /// What its lines look like, where it is one of text: its bytes are then the numbers as doubles, high byte first.
    pub text: Option<Form>,
}

impl Frame {
    /// A frame of registers or bytes without time, counter and text.
    pub(super) fn new(name: &str, bytes: usize, kind: FrameKind) -> Frame {
        let name = name.to_owned();
        Frame { name, bytes, sequence: None, device_time: None, kind, spans: Vec::new(), text: None }
    }

    /// The bytes of a line of text; `None` where it is no such line.
    pub fn read_line(&self, line: &str) -> Option<Vec<u8>> {
        let numbers = self.text.as_ref()?.read(line)?;
        Some(numbers.into_iter().flat_map(f64::to_be_bytes).collect())
    }

    /// The line of text of these bytes, its numbers times `factor`; `None` for a frame that is none of text.
    pub fn write_line(&self, bytes: &[u8], factor: f64) -> Option<String> {
        let number = |eight: &[u8]| eight.try_into().map_or(f64::NAN, f64::from_be_bytes) * factor;
        let numbers: Vec<f64> = bytes.chunks_exact(8).map(number).collect();
        self.text.as_ref().map(|form| form.write(&numbers))
    }
}

/// Neighbouring registers that one read brings.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Span {
    /// The first.
    pub address: u16,
    /// How many: 1 to 125.
    pub count: u16,
}

impl Span {
    /// The first register behind it.
    pub const fn end(self) -> u32 {
        self.address as u32 + self.count as u32
    }

    /// The fewest reads that bring all of `wanted` (first register and count of each), where so many
    /// registers between two of them may be read in vain. Each of them lies within one read.
    pub fn cover(mut wanted: Vec<Span>, gap: u16) -> Vec<Span> {
        wanted.sort_by_key(|span| (span.address, span.count));
        let mut spans: Vec<Span> = Vec::new();
        for next in wanted {
            if let Some(last) = spans.last_mut() {
                let end = last.end().max(next.end());
                let count = end - u32::from(last.address);
                if u32::from(next.address) <= last.end() + u32::from(gap)
                    && count <= u32::from(MOST_REGISTERS)
                {
                    last.count = count as u16;
                    continue;
                }
            }
            spans.push(next);
        }
        spans
    }
}

/// Registers that one read can bring.
pub const MOST_REGISTERS: u16 = 125;

/// One CAN message of a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Part {
    /// Identifier, less the base that it is counted from.
    pub id: u32,
    /// The DBC file gives the identifier 29 bits.
    pub extended: bool,
    /// Bytes.
    pub length: usize,
    /// The signal whose value tells it from others of its identifier, and that value.
    pub selector: Option<(DbcSignal, u64)>,
}

impl Part {
    /// Whether the data of a message of its identifier is this one's.
    pub fn selects(&self, data: &[u8]) -> bool {
        let unsigned = |signal: DbcSignal| signal.raw(data).map(|raw| raw as u64 & signal.mask());
        data.len() == self.length
            && self.selector.is_none_or(|(signal, value)| unsigned(signal) == Some(value))
    }

    /// Its identifier, and whether that has 29 bits, for an instrument at that base.
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
