//! From a decoded frame to readings.

use super::SampleMark;
use instruments::profile::Refusal;
use instruments::schema::{Fault, Severity};
use instruments::{FrameId, Profile, SignalId, Values};
use realtime::ports::{Channel, NoData, Quality, Sample};

/// A decoded frame and what is needed to make readings of it.
pub(super) struct View<'a> {
    pub profile: &'a Profile,
    pub values: &'a Values,
    pub bytes: &'a [u8],
    pub frame: FrameId,
    pub mark: SampleMark,
}

impl View<'_> {
    pub fn si(&self, signal: SignalId) -> f64 {
        self.profile.si(signal, self.values)
    }

    fn fault(&self) -> Option<&Fault> {
        self.profile.fault(self.values).map(|fault| &self.profile.description.fault[fault])
    }

    /// Whether the signal, where the profile has it, is not zero.
    pub fn flag(&self, signal: Option<SignalId>) -> bool {
        signal.is_some_and(|signal| self.values.get(signal) != 0.0)
    }

    /// Whether the instrument says that it has a fault, by that signal or by one that stops the rig.
    pub fn is_faulty(&self, signal: Option<SignalId>) -> bool {
        self.flag(signal) || self.fault().is_some_and(|fault| fault.severity == Severity::Stop)
    }

    /// Whether the signal is in this frame.
    pub fn holds(&self, signal: SignalId) -> bool {
        self.profile.frame_of(signal) == self.frame
    }

    pub fn channel(&self, signal: SignalId) -> Channel {
        let quality = match (self.profile.refusal(signal, self.values), self.fault()) {
            (Some(Refusal::NotANumber | Refusal::MarkedInvalid), _) => return Err(NoData::Invalid),
            (_, Some(fault)) if fault.severity == Severity::Stop => return Err(NoData::Invalid),
            (Some(Refusal::OutOfRange), _) => Quality::Saturated,
            (None, Some(fault)) if fault.overrange => Quality::Saturated,
            (None, Some(fault)) if fault.severity == Severity::Degrade => Quality::Degraded,
            (None, _) => Quality::Good,
        };
        let raw = if self.holds(signal) { self.profile.raw(signal, self.bytes, self.values) } else { 0 };
        let SampleMark { taken_at, sequence, .. } = self.mark;
        Ok(Sample { value: self.si(signal), raw, taken_at, sequence, quality })
    }

    pub fn optional(&self, signal: Option<SignalId>) -> Channel {
        signal.map_or(Err(NoData::NotFitted), |signal| self.channel(signal))
    }
}
