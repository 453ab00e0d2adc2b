//! A profile that was read, checked and compiled.
//!
//! Names became indices, places became byte ranges and conditions became [`Expression`]s, so that
//! decoding a frame neither searches nor allocates.

mod compile;
mod computed;
mod fits;
mod frame;
mod keys;
mod quantities;
mod sets;

use crate::codec::dbc::DbcSignal;
use crate::error::ProfileError;
use crate::expression::Expression;
use crate::field::{Field, NumberType};
use crate::schema::{Description, Poll, Query, Severity};
use compile::Compiler;
pub use frame::{Frame, FrameKind, MOST_REGISTERS, Part, Span};
pub use quantities::power_of_ten;
use sets::CompiledSet;
pub use sets::SetError;
use std::collections::HashMap;

/// Index of a frame (poll) of one profile.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FrameId(pub usize);
/// Index of a signal of one profile.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SignalId(pub usize);
/// Index of a set-point of one profile.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct SetId(pub usize);

/// The values of all signals of one profile, each in the profile's `unit`; NaN until decoded.
#[derive(Debug, Clone, PartialEq)]
pub struct Values(Vec<f64>);

impl Values {
    /// The value in the profile's unit; NaN where it was never decoded.
    pub fn get(&self, signal: SignalId) -> f64 {
        self.0.get(signal.0).copied().unwrap_or(f64::NAN)
    }

    pub(crate) fn set(&mut self, signal: SignalId, value: f64) {
        self.0[signal.0] = value;
    }

    /// All of them, by index.
    pub fn as_slice(&self) -> &[f64] {
        &self.0
    }
}

/// A frame was refused: it has not the length that the profile states.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the frame has {found} bytes and should have {expected}")]
#[allow(missing_docs, reason = "the message of an error says what its fields are")]
pub struct FrameError {
    pub expected: usize,
    pub found: usize,
}

/// Where a signal stands in its frame.
#[derive(Debug, Clone)]
pub(crate) enum Place {
    /// Bytes.
    Bytes(Field),
    /// Bits of a CAN message that begins at this byte of the frame.
    Dbc(usize, DbcSignal),
    /// Nowhere: worked out from other signals.
    Computed(Expression),
}

impl Place {
    fn read(&self, frame: &[u8]) -> Option<f64> {
        match self {
            Place::Bytes(field) => field.read(frame),
            Place::Dbc(at, signal) => signal.read(frame.get(*at..)?),
            Place::Computed(_) => None,
        }
    }

    fn write(&self, frame: &mut [u8], value: f64) -> bool {
        match self {
            Place::Bytes(field) => field.write(frame, value),
            Place::Dbc(at, signal) => frame.get_mut(*at..).is_some_and(|frame| signal.write(frame, value)),
            Place::Computed(_) => true,
        }
    }

    /// Whether the frame has a whole number for it.
    fn has_counts(&self) -> bool {
        match self {
            Place::Bytes(Field { bits: None, number: NumberType::F32 | NumberType::F64, .. }) => false,
            Place::Dbc(_, signal) => !signal.float,
            Place::Bytes(_) | Place::Computed(_) => true,
        }
    }

    /// How many values there are before a counter runs round.
    fn turns_after(&self) -> f64 {
        match self {
            Place::Bytes(field) => field.number.limits().1 + 1.0,
            Place::Dbc(_, signal) => 2_f64.powi(i32::from(signal.size)),
            Place::Computed(_) => f64::INFINITY,
        }
    }
}

/// One count of a number that has none: far below any resolution, and up to 9e6 of the unit in 64 bits.
const COUNT_OF_A_FLOAT: f64 = 1e-12;

/// One signal, compiled.
#[derive(Debug, Clone)]
pub(crate) struct CompiledSignal {
    frame: FrameId,
    place: Place,
    scale: f64,
    scale_expression: Option<Expression>,
    offset: f64,
    si_factor: f64,
    range: Option<(f64, f64)>,
    valid_when: Option<Expression>,
    /// SI value of the smallest change, as the profile states it.
    resolution_si: Option<f64>,
    /// The smallest change of what stands in the frame, before `scale`; NaN where nobody knows it.
    step: f64,
}

/// An instrument's description, ready for use.
#[derive(Debug, Clone)]
pub struct Profile {
    /// What the file says.
    pub description: Description,
    frames: Vec<Frame>,
    signals: Vec<CompiledSignal>,
    sets: Vec<CompiledSet>,
    signatures: Vec<Expression>,
    faults: Vec<Expression>,
    by_name: HashMap<String, usize>,
}

impl Profile {
    /// Reads, checks and compiles a profile. Vectors are run by [`Profile::check`].
    ///
    /// # Errors
    /// What is wrong, with the place in the file.
    pub fn parse(text: &str) -> Result<Self, ProfileError> {
        Self::parse_with(text, &|_| None)
    }

    /// The same for a profile that names other files: `file` gives the text of each.
    pub fn parse_with(text: &str, file: &dyn Fn(&str) -> Option<String>) -> Result<Self, ProfileError> {
        let mut description = described(text)?;
        description.signal = computed::spread(description.signal);
        Compiler { text, description: &description, file }.compile()
    }

    /// The same with its golden vectors run ([`Profile::check`]).
    pub fn checked(text: &str, file: &dyn Fn(&str) -> Option<String>) -> Result<Self, ProfileError> {
        let profile = Self::parse_with(text, file)?;
        profile.check(text)?;
        Ok(profile)
    }

    /// The files that a profile names, such as its DBC file: what [`Profile::parse_with`] will ask for.
    ///
    /// # Errors
    /// Where the text is not a profile, with the place.
    pub fn names_files(text: &str) -> Result<Vec<String>, ProfileError> {
        let link = described(text)?.link;
        Ok(link.dbc.into_iter().chain(link.eds).collect())
    }

    /// The name that setups use.
    pub fn id(&self) -> &str {
        &self.description.profile.id
    }

    /// The signal of that name.
    pub fn signal(&self, name: &str) -> Option<SignalId> {
        self.by_name.get(name).copied().map(SignalId)
    }

    /// The set-point of that name.
    pub fn set(&self, name: &str) -> Option<SetId> {
        self.description.set.iter().position(|set| set.name.as_ref() == name).map(SetId)
    }

    /// The frame of that name.
    pub fn frame(&self, name: &str) -> Option<FrameId> {
        self.frames.iter().position(|frame| frame.name == name).map(FrameId)
    }

    /// All frames: polls, the stream, groups of messages, queries.
    pub fn frames(&self) -> &[Frame] {
        &self.frames
    }

    /// The largest identifier of CAN at this base.
    pub fn last_identifier(&self, base: u32) -> u64 {
        let parts = |frame: &Frame| match &frame.kind {
            FrameKind::Messages(_, parts) => parts.iter().map(|part| part.id).max(),
            _ => None,
        };
        u64::from(base) + u64::from(self.frames.iter().filter_map(parts).max().unwrap_or(0))
    }

    /// The polls, each with its frame.
    pub fn polls(&self) -> impl Iterator<Item = (FrameId, &Poll)> {
        self.frames.iter().enumerate().filter_map(|(i, frame)| match frame.kind {
            FrameKind::Poll(index) => Some((FrameId(i), &self.description.poll[index])),
            _ => None,
        })
    }

    /// The queries, each with its frame.
    pub fn queries(&self) -> impl Iterator<Item = (FrameId, &Query)> {
        self.frames.iter().enumerate().filter_map(|(i, frame)| match frame.kind {
            FrameKind::Query(index) => Some((FrameId(i), &self.description.query[index])),
            _ => None,
        })
    }

    /// How many values a signal has before it runs round, and the SI value of one count.
    pub fn turn(&self, signal: SignalId) -> (f64, f64) {
        let signal = &self.signals[signal.0];
        (signal.place.turns_after(), signal.scale * signal.si_factor)
    }

    /// The frame in which a signal stands.
    pub fn frame_of(&self, signal: SignalId) -> FrameId {
        self.signals[signal.0].frame
    }

    /// Names and indices of all signals, in the file's order.
    pub fn signals(&self) -> impl Iterator<Item = (&str, SignalId)> {
        let signals = self.description.signal.iter().enumerate();
        signals.map(|(i, signal)| (signal.name.as_ref().as_str(), SignalId(i)))
    }

    /// Values of all signals, none decoded yet.
    pub fn values(&self) -> Values {
        Values(vec![f64::NAN; self.signals.len()])
    }

    /// Decodes one frame into `values`. Signals of other frames keep theirs.
    ///
    /// # Errors
    /// A frame of another length is refused whole; nothing is changed then.
    pub fn decode(&self, frame: FrameId, bytes: &[u8], values: &mut Values) -> Result<(), FrameError> {
        let expected = self.frame_bytes(frame);
        if bytes.len() != expected {
            return Err(FrameError { expected, found: bytes.len() });
        }
        // Scales may depend on signals of the same frame, so raw values come first.
        let stored = |s: &CompiledSignal| s.frame == frame && !matches!(s.place, Place::Computed(_));
        for (signal, value) in self.signals.iter().zip(&mut values.0).filter(|(s, _)| stored(s)) {
            let raw = signal.place.read(bytes).unwrap_or(f64::NAN);
            *value = if signal.scale_expression.is_none() { raw * signal.scale + signal.offset } else { raw };
        }
        for index in 0..self.signals.len() {
            let signal = &self.signals[index];
            if let (Some(scale), true) = (&signal.scale_expression, signal.frame == frame) {
                values.0[index] = values.0[index] * signal.scale * scale.value(&values.0) + signal.offset;
            }
        }
        self.work_out(frame, values);
        Ok(())
    }

    /// Encodes one frame from raw values, as the emulator needs it: `unit_value` gives a signal's
    /// value in its unit, or `None` to leave the bytes as they are.
    pub fn encode(
        &self,
        frame: FrameId,
        bytes: &mut [u8],
        unit_value: &mut dyn FnMut(SignalId) -> Option<f64>,
    ) {
        let mut values = vec![f64::NAN; self.signals.len()];
        for (index, signal) in self.signals.iter().enumerate() {
            if let Some(value) = unit_value(SignalId(index)) {
                values[index] = value;
                if signal.frame == frame && signal.scale_expression.is_none() {
                    signal.place.write(bytes, (value - signal.offset) / signal.scale);
                }
            }
        }
        for (index, signal) in self.signals.iter().enumerate().filter(|(_, s)| s.frame == frame) {
            if let (Some(scale), false) = (&signal.scale_expression, values[index].is_nan()) {
                let scale = signal.scale * scale.value(&values);
                signal.place.write(bytes, (values[index] - signal.offset) / scale);
            }
        }
        if let FrameKind::Messages(_, parts) = &self.frames[frame.0].kind {
            let mut at = 0;
            for part in parts {
                if let (Some((selector, value)), Some(data)) = (part.selector, bytes.get_mut(at..)) {
                    selector.write(data, value as f64 * selector.factor + selector.offset);
                }
                at += part.length;
            }
        }
    }

    /// What the instrument sent for a signal, in its own counts. Of a floating-point number, of one in a line
    /// of text and of a signal that is worked out a count is 1e-12 of its unit: no certificate depends on the
    /// resolution that a profile states. Zero where the frame is too short.
    pub fn raw(&self, signal: SignalId, frame: &[u8], values: &Values) -> i64 {
        match &self.signals[signal.0].place {
            Place::Computed(_) => self.in_counts(signal, values.get(signal)),
            place => self.in_counts(signal, place.read(frame).unwrap_or(0.0)),
        }
    }

    /// The counts of [`Profile::raw`] that stand for a value in SI units, at the scale that holds now.
    pub fn counts(&self, signal: SignalId, value_si: f64, values: &Values) -> i64 {
        let described = &self.signals[signal.0];
        let value = value_si / described.si_factor;
        if let Place::Computed(_) = described.place {
            return self.in_counts(signal, value);
        }
        let expression =
            described.scale_expression.as_ref().map_or(1.0, |scale| scale.value(values.as_slice()));
        self.in_counts(signal, (value - described.offset) / (described.scale * expression))
    }

    fn in_counts(&self, signal: SignalId, number: f64) -> i64 {
        let count = match &self.signals[signal.0].place {
            Place::Computed(_) => COUNT_OF_A_FLOAT,
            place if !place.has_counts() => COUNT_OF_A_FLOAT,
            // The file's offset shifts the counts.
            Place::Dbc(_, dbc) => dbc.factor,
            Place::Bytes(_) => 1.0,
        };
        // saturates, and NaN gives zero
        (number / count).round() as i64
    }

    /// Gives the set-point of that name, or else the signal, another way to SI: a certificate's.
    pub fn set_si(&mut self, name: &str, factor: f64) {
        match self.description.set.iter_mut().find(|set| set.name.as_ref() == name) {
            Some(set) => set.si.factor = factor,
            None => self.set_measured_si(name, factor),
        }
    }

    /// Gives the signal of that name another way to SI.
    pub fn set_measured_si(&mut self, name: &str, factor: f64) {
        if let Some(index) = self.by_name.get(name) {
            self.signals[*index].si_factor = factor;
            self.description.signal[*index].si.factor = factor;
        }
    }

    /// Bytes of a frame.
    pub fn frame_bytes(&self, frame: FrameId) -> usize {
        self.frames[frame.0].bytes
    }

    /// A value in SI units.
    pub fn si(&self, signal: SignalId, values: &Values) -> f64 {
        values.get(signal) * self.signals[signal.0].si_factor
    }

    /// The smallest change that a signal shows, in SI units, at the scale that holds now: what the profile
    /// states, else one count. NaN where neither is known, as with floats.
    pub fn lsb_si(&self, signal: SignalId, values: &Values) -> f64 {
        if let Some(stated) = self.signals[signal.0].resolution_si {
            return stated;
        }
        if let Place::Computed(value) = &self.signals[signal.0].place {
            return self.smallest_step(signal, value, values);
        }
        let signal = &self.signals[signal.0];
        let expression = signal.scale_expression.as_ref().map_or(1.0, |scale| scale.value(values.as_slice()));
        (signal.step * signal.scale * expression * signal.si_factor).abs()
    }

    /// Why a decoded value does not count, if it does not.
    pub fn refusal(&self, signal: SignalId, values: &Values) -> Option<Refusal> {
        let value = values.get(signal);
        let signal = &self.signals[signal.0];
        if !value.is_finite() {
            return Some(Refusal::NotANumber);
        }
        if signal.valid_when.as_ref().is_some_and(|valid| !valid.holds(values.as_slice())) {
            return Some(Refusal::MarkedInvalid);
        }
        // A value on the end of the range is a rail: what lies beyond it cannot be seen. What is worked out
        // from a signal at its rail is worth no more.
        let railed = |signal: &CompiledSignal, value: f64| {
            signal.range.is_some_and(|(low, high)| value <= low || value >= high)
        };
        let computed = matches!(signal.place, Place::Computed(_));
        let input = |(other, value): (&CompiledSignal, &f64)| {
            computed && other.frame == signal.frame && railed(other, *value)
        };
        let beyond = railed(signal, value) || self.signals.iter().zip(values.as_slice()).any(input);
        beyond.then_some(Refusal::OutOfRange)
    }

    /// A condition of the profile with what was read of its signals: `model == 4712` (model = 4711).
    pub fn shown(&self, when: &str, values: &Values) -> String {
        let words: Vec<&str> = when.split(|c: char| !(c.is_alphanumeric() || c == '_')).collect();
        let read = self.signals().filter(|(name, _)| words.contains(name));
        let read: Vec<String> = read.map(|(name, id)| format!("{name} = {}", values.get(id))).collect();
        format!("`{when}` ({})", read.join(", "))
    }

    /// The first signature that does not hold, by index into the description.
    pub fn broken_signature(&self, values: &Values) -> Option<usize> {
        self.signatures.iter().position(|signature| !signature.holds(values.as_slice()))
    }

    /// Whether a fault holds, by its index into the description.
    pub fn fault_holds(&self, fault: usize, values: &Values) -> bool {
        self.faults[fault].holds(values.as_slice())
    }

    /// The gravest fault that holds, by index into the description.
    pub fn fault(&self, values: &Values) -> Option<usize> {
        let grave = |index: &usize| match self.description.fault[*index].severity {
            Severity::Stop => 0,
            Severity::Degrade => 1,
            Severity::Log => 2,
        };
        (0..self.faults.len()).filter(|&fault| self.fault_holds(fault, values)).min_by_key(grave)
    }
}

fn described(text: &str) -> Result<Description, ProfileError> {
    toml::from_str(text).map_err(|error| ProfileError::at(text, error.span(), error.message()))
}

/// Why a decoded value does not count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Refusal {
    /// NaN or infinite, or never decoded.
    NotANumber,
    /// The profile's `valid_when` does not hold.
    MarkedInvalid,
    /// At or beyond the end of the stated range.
    OutOfRange,
}
