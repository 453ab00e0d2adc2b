//! A profile that was read, checked and compiled.
//!
//! Names became indices, places became byte ranges and conditions became [`Expression`]s, so that
//! decoding a frame neither searches nor allocates.

mod compile;

use std::collections::HashMap;
use std::ops::Range;

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
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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

/// One signal, compiled.
#[derive(Debug, Clone)]
pub struct CompiledSignal {
    /// Its frame.
    pub frame: FrameId,
    /// Its place there.
    pub field: Field,
    scale: f64,
    scale_expression: Option<Expression>,
    offset: f64,
    si_factor: f64,
    range: Option<(f64, f64)>,
    valid_when: Option<Expression>,
}

/// One block of set-points, compiled.
#[derive(Debug, Clone)]
struct CompiledSet {
    block: usize,
    field: Field,
    scale: f64,
}

/// An instrument's description, ready for use.
#[derive(Debug, Clone)]
pub struct Profile {
    /// What the file says.
    pub description: Description,
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
        let description: Description =
            toml::from_str(text).map_err(|error| ProfileError::from_toml(text, &error))?;
        Compiler { text, description: &description }.compile()
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
        self.description.poll.iter().position(|poll| poll.name.as_ref() == name).map(FrameId)
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
        for (signal, value) in self.signals.iter().zip(&mut values.0).filter(|(s, _)| s.frame == frame) {
            let raw = signal.field.read(bytes).unwrap_or(f64::NAN);
            *value = if signal.scale_expression.is_none() { raw * signal.scale + signal.offset } else { raw };
        }
        for index in 0..self.signals.len() {
            let signal = &self.signals[index];
            if let (Some(scale), true) = (&signal.scale_expression, signal.frame == frame) {
                values.0[index] = values.0[index] * signal.scale * scale.value(&values.0) + signal.offset;
            }
        }
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
                    signal.field.write(bytes, (value - signal.offset) / signal.scale);
                }
            }
        }
        for (index, signal) in self.signals.iter().enumerate().filter(|(_, s)| s.frame == frame) {
            if let (Some(scale), false) = (&signal.scale_expression, values[index].is_nan()) {
                let scale = signal.scale * scale.value(&values);
                signal.field.write(bytes, (values[index] - signal.offset) / scale);
            }
        }
    }

    /// What the instrument sent for a signal, in its own counts; for `f32` the bits of the number.
    /// Zero where the frame is too short.
    #[must_use]
    pub fn raw(&self, signal: SignalId, frame: &[u8]) -> i64 {
        self.signals[signal.0].field.counts(frame).unwrap_or(0)
    }

    /// Whether a set-point may take `value` (in its `unit`).
    ///
    /// # Errors
    /// A value outside the stated range, or not a number.
    pub fn allows(&self, set: SetId, value: f64) -> Result<(), SetError> {
        let (low, high) = self.description.set[set.0].range.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
        if value >= low && value <= high { Ok(()) } else { Err(SetError { value, low, high }) }
    }

    /// Bytes of a frame.
    #[must_use]
    pub fn frame_bytes(&self, frame: FrameId) -> usize {
        2 * usize::from(self.description.poll[frame.0].count)
    }

    /// A value in SI units.
    #[must_use]
    pub fn si(&self, signal: SignalId, values: &Values) -> f64 {
        values.get(signal) * self.signals[signal.0].si_factor
    }

    /// The size of one count in SI units, at the scale that holds now.
    #[must_use]
    pub fn lsb_si(&self, signal: SignalId, values: &Values) -> f64 {
        let signal = &self.signals[signal.0];
        let expression = signal.scale_expression.as_ref().map_or(1.0, |scale| scale.value(values.as_slice()));
        (signal.scale * expression * signal.si_factor).abs()
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
        // A value on the end of the range is a rail: what lies beyond it cannot be seen.
        signal.range.and_then(|(low, high)| (value <= low || value >= high).then_some(Refusal::OutOfRange))
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
        compiled.field.write(block, value / compiled.scale);
        Ok(())
    }

    /// A set-point's value (in its `unit`) from its block's bytes.
    #[must_use]
    pub fn decode_set(&self, set: SetId, block: &[u8]) -> Option<f64> {
        let compiled = &self.sets[set.0];
        compiled.field.read(block).map(|raw| raw * compiled.scale)
    }

    /// The set-points of one block.
    pub fn sets_of(&self, block: usize) -> impl Iterator<Item = SetId> {
        self.sets.iter().enumerate().filter(move |(_, set)| set.block == block).map(|(i, _)| SetId(i))
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
