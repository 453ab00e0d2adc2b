//! A profile that was read, checked and compiled.
//!
//! Names became indices, places became byte ranges and conditions became [`Expression`]s, so that
//! decoding a frame neither searches nor allocates.

mod compile;
mod computed;
mod fits;

use std::collections::HashMap;
use std::ops::Range;

use crate::codec::dbc::DbcSignal;
use crate::codec::pattern::Pattern;
use crate::codec::text::Form;
use crate::error::ProfileError;
use crate::expression::Expression;
use crate::field::Field;
use crate::schema::{Description, Role, Severity};
use compile::Compiler;

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
    #[must_use]
    pub fn get(&self, signal: SignalId) -> f64 {
        self.0.get(signal.0).copied().unwrap_or(f64::NAN)
    }

    pub(crate) fn set(&mut self, signal: SignalId, value: f64) {
        self.0[signal.0] = value;
    }

    /// All of them, by index.
    #[must_use]
    pub fn as_slice(&self) -> &[f64] {
        &self.0
    }
}

/// A frame was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum FrameError {
    /// Not the length that the profile states.
    #[error("the frame has {found} bytes and should have {expected}")]
    Length {
        /// Bytes by the profile.
        expected: usize,
        /// Bytes that came.
        found: usize,
    },
}

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

    fn counts(&self, frame: &[u8]) -> Option<i64> {
        match self {
            Place::Bytes(field) => field.counts(frame),
            // of floating-point numbers the bits; of the others the counts, which the file's offset shifts
            Place::Dbc(at, signal) if signal.float => signal.raw(frame.get(*at..)?),
            Place::Dbc(at, signal) => {
                signal.read(frame.get(*at..)?).map(|value| (value / signal.factor).round() as i64)
            }
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

    /// How many values there are before a counter runs round.
    fn turns_after(&self) -> f64 {
        match self {
            Place::Bytes(field) => field.number.limits().1 + 1.0,
            Place::Dbc(_, signal) => 2_f64.powi(i32::from(signal.size)),
            Place::Computed(_) => f64::INFINITY,
        }
    }
}

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

/// One block of set-points, compiled.
#[derive(Debug, Clone)]
struct CompiledSet {
    /// Block and place; `None` for a line of text.
    block: Option<(usize, Field)>,
    scale: f64,
    /// The line of text, with the set-points whose values stand in it; `None` for its own.
    line: Option<(Pattern, Vec<Option<SetId>>)>,
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
    ///
    /// # Errors
    /// What is wrong, with the place in the file.
    pub fn parse_with(text: &str, file: &dyn Fn(&str) -> Option<String>) -> Result<Self, ProfileError> {
        let mut description: Description =
            toml::from_str(text).map_err(|error| ProfileError::from_toml(text, &error))?;
        description.signal = computed::spread(description.signal);
        Compiler { text, description: &description, file }.compile()
    }

    /// The files that a profile names, such as its DBC file: what [`Profile::parse_with`] will ask for.
    ///
    /// # Errors
    /// Where the text is no profile, with the place.
    pub fn names_files(text: &str) -> Result<Vec<String>, ProfileError> {
        let description: Description =
            toml::from_str(text).map_err(|error| ProfileError::from_toml(text, &error))?;
        Ok(description.link.dbc.into_iter().chain(description.link.eds).collect())
    }

    /// The name that setups use.
    #[must_use]
    pub fn id(&self) -> &str {
        &self.description.profile.id
    }

    /// Whether the instrument can be used as `role`.
    #[must_use]
    pub fn has_role(&self, role: Role) -> bool {
        self.description.profile.roles.contains(&role)
    }

    /// The signal of that name.
    #[must_use]
    pub fn signal(&self, name: &str) -> Option<SignalId> {
        self.by_name.get(name).copied().map(SignalId)
    }

    /// The set-point of that name.
    #[must_use]
    pub fn set(&self, name: &str) -> Option<SetId> {
        self.description.set.iter().position(|set| set.name.as_ref() == name).map(SetId)
    }

    /// The frame of that name.
    #[must_use]
    pub fn frame(&self, name: &str) -> Option<FrameId> {
        self.frames.iter().position(|frame| frame.name == name).map(FrameId)
    }

    /// All frames: polls, the stream, groups of messages, queries.
    #[must_use]
    pub fn frames(&self) -> &[Frame] {
        &self.frames
    }

    /// How many values a signal has before it runs round, and the SI value of one count.
    #[must_use]
    pub fn turn(&self, signal: SignalId) -> (f64, f64) {
        let signal = &self.signals[signal.0];
        (signal.place.turns_after(), signal.scale * signal.si_factor)
    }

    /// The frame in which a signal stands.
    #[must_use]
    pub fn frame_of(&self, signal: SignalId) -> FrameId {
        self.signals[signal.0].frame
    }

    /// Names and indices of all signals, in the file's order.
    pub fn signals(&self) -> impl Iterator<Item = (&str, SignalId)> {
        self.description
            .signal
            .iter()
            .enumerate()
            .map(|(i, signal)| (signal.name.as_ref().as_str(), SignalId(i)))
    }

    /// Values of all signals, none decoded yet.
    #[must_use]
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
            return Err(FrameError::Length { expected, found: bytes.len() });
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
    }

    /// What the instrument sent for a signal, in its own counts; for `f32` the bits of the number.
    /// Zero where the frame is too short. A signal that is worked out is given in its own smallest steps
    /// ([`Profile::lsb_si`]).
    #[must_use]
    pub fn raw(&self, signal: SignalId, frame: &[u8], values: &Values) -> i64 {
        match &self.signals[signal.0].place {
            // saturates, and NaN gives zero
            Place::Computed(_) => (self.si(signal, values) / self.lsb_si(signal, values)).round() as i64,
            place => place.counts(frame).unwrap_or(0),
        }
    }

    /// Whether a set-point may take `value` (in its `unit`).
    ///
    /// # Errors
    /// A value outside the stated range, or not a number.
    pub fn allows(&self, set: SetId, value: f64) -> Result<(), SetError> {
        let (low, high) = self.description.set[set.0].range.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
        if value >= low && value <= high { Ok(()) } else { Err(SetError { value, low, high }) }
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
    #[must_use]
    pub fn frame_bytes(&self, frame: FrameId) -> usize {
        self.frames[frame.0].bytes
    }

    /// A value in SI units.
    #[must_use]
    pub fn si(&self, signal: SignalId, values: &Values) -> f64 {
        values.get(signal) * self.signals[signal.0].si_factor
    }

    /// The smallest change that a signal shows, in SI units, at the scale that holds now: what the profile states, else one
    /// count. NaN where neither is known, as with floats.
    #[must_use]
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
    #[must_use]
    pub fn refusal(&self, signal: SignalId, values: &Values) -> Option<Refusal> {
        let value = values.get(signal);
        let signal = &self.signals[signal.0];
        if !value.is_finite() {
            return Some(Refusal::NotANumber);
        }
        if signal.valid_when.as_ref().is_some_and(|valid| !valid.holds(values.as_slice())) {
            return Some(Refusal::MarkedInvalid);
        }
        // A value on the end of the range is a rail: what lies beyond it cannot be seen. What is worked out from a
        // signal at its rail is worth no more.
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

    /// The first signature that does not hold, by index into the description.
    #[must_use]
    pub fn broken_signature(&self, values: &Values) -> Option<usize> {
        self.signatures.iter().position(|signature| !signature.holds(values.as_slice()))
    }

    /// The gravest fault that holds, by index into the description.
    #[must_use]
    pub fn fault(&self, values: &Values) -> Option<usize> {
        let grave = |index: &usize| match self.description.fault[*index].severity {
            Severity::Stop => 0,
            Severity::Degrade => 1,
            Severity::Log => 2,
        };
        (0..self.faults.len()).filter(|&i| self.faults[i].holds(values.as_slice())).min_by_key(grave)
    }

    /// Encodes a set-point (in its `unit`) into its block's bytes.
    ///
    /// # Errors
    /// A value outside the stated range, or not a number, is refused.
    pub fn encode_set(&self, set: SetId, value: f64, block: &mut [u8]) -> Result<(), SetError> {
        self.allows(set, value)?;
        let compiled = &self.sets[set.0];
        if let Some((_, field)) = compiled.block {
            field.write(block, value / compiled.scale);
        }
        Ok(())
    }

    /// A set-point's value (in its `unit`) from its block's bytes.
    #[must_use]
    pub fn decode_set(&self, set: SetId, block: &[u8]) -> Option<f64> {
        let compiled = &self.sets[set.0];
        compiled.block?.1.read(block).map(|raw| raw * compiled.scale)
    }

    /// The set-points of one block.
    pub fn sets_of(&self, block: usize) -> impl Iterator<Item = SetId> {
        let stands = move |set: &CompiledSet| set.block.is_some_and(|(stands, _)| stands == block);
        self.sets.iter().enumerate().filter(move |(_, set)| stands(set)).map(|(i, _)| SetId(i))
    }

    /// The line of text that carries a set-point, and what its answer begins with; `None` where the
    /// set-point is no line of text. `newest` gives the values of others that stand in the line.
    #[must_use]
    pub fn line(
        &self,
        set: SetId,
        value: f64,
        newest: &dyn Fn(SetId) -> f64,
    ) -> Option<(String, Option<&str>)> {
        let description = &self.description.set[set.0];
        let (for_value, for_zero) =
            description.answer.as_ref().map(|(v, z)| (v.as_str(), z.as_str())).unzip();
        if let (true, Some(zero)) = (value == 0.0, &description.send_zero) {
            return Some((zero.clone(), for_zero));
        }
        let (pattern, owners) = self.sets[set.0].line.as_ref()?;
        let value = |owner: &Option<SetId>| {
            owner.map_or_else(|| self.quantise(set, value), |other| self.quantise(other, newest(other)))
        };
        let values: Vec<f64> = owners.iter().map(value).collect();
        // Counts are whole numbers; the scale says how many decimals the unit's value needs.
        let decimals = (-self.sets[set.0].scale.log10()).ceil().clamp(0.0, 12.0) as u8;
        Some((pattern.write(&values, decimals), for_value))
    }

    /// The set-point that a line of text carries, as an emulator hears it: its own value, and those of others that stand in
    /// the line. A line without a number is 1.
    #[must_use]
    pub fn heard(&self, set: SetId, line: &str) -> Option<Vec<(SetId, f64)>> {
        let (pattern, owners) = self.sets[set.0].line.as_ref()?;
        let values = pattern.read(line)?;
        let named = owners.iter().map(|owner| owner.unwrap_or(set));
        let heard: Vec<(SetId, f64)> = named.zip(values).collect();
        Some(if heard.is_empty() { vec![(set, 1.0)] } else { heard })
    }

    /// How many values a heartbeat has before it runs round.
    #[must_use]
    pub fn heartbeat_turns(&self, set: SetId) -> f64 {
        self.sets[set.0].block.map_or(65536.0, |(_, field)| field.number.limits().1 + 1.0)
    }

    /// The value nearest to `value` that the set-point can take (both in its `unit`).
    #[must_use]
    pub fn quantise(&self, set: SetId, value: f64) -> f64 {
        let scale = self.sets[set.0].scale;
        (value / scale).round() * scale
    }

    /// The bytes of the file where a set-point, signal, poll or block is named, for messages.
    #[must_use]
    pub fn span_of_signal(&self, signal: SignalId) -> Range<usize> {
        self.description.signal[signal.0].name.span()
    }
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

/// A set-point was refused.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("the set-point {value} lies outside {low} to {high}")]
pub struct SetError {
    /// The value, in the set-point's unit.
    pub value: f64,
    /// Smallest.
    pub low: f64,
    /// Largest.
    pub high: f64,
}

/// The function code that reads a table.
#[must_use]
pub const fn read_function(table: crate::schema::Table) -> u8 {
    match table {
        crate::schema::Table::Holding => 3,
        crate::schema::Table::Input => 4,
        crate::schema::Table::Coil => 1,
        crate::schema::Table::Discrete => 2,
    }
}
