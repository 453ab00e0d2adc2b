//! From a decoded frame to readings.

use super::SampleMark;
use instruments::profile::Refusal;
use instruments::schema::Severity;
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

    pub fn severity(&self) -> Option<Severity> {
        self.profile.fault(self.values).map(|fault| self.profile.description.fault[fault].severity)
    }

    pub fn channel(&self, signal: SignalId) -> Channel {
        let fault = self.profile.fault(self.values).map(|fault| &self.profile.description.fault[fault]);
        let quality = match (self.profile.refusal(signal, self.values), fault) {
            (Some(Refusal::NotANumber | Refusal::MarkedInvalid), _) => return Err(NoData::Invalid),
            (_, Some(fault)) if fault.severity == Severity::Stop => return Err(NoData::Invalid),
            (Some(Refusal::OutOfRange), _) => Quality::Saturated,
            (None, Some(fault)) if fault.overrange => Quality::Saturated,
            (None, Some(fault)) if fault.severity == Severity::Degrade => Quality::Degraded,
            (None, _) => Quality::Good,
        };
        let raw = if self.profile.frame_of(signal) == self.frame {
            self.profile.raw(signal, self.bytes, self.values)
        } else {
            0
        };
        Ok(Sample {
            value: self.si(signal),
            raw,
            taken_at: self.mark.taken_at,
            sequence: self.mark.sequence,
            quality,
        })
    }

    pub fn optional(&self, signal: Option<SignalId>) -> Channel {
        signal.map_or(Err(NoData::NotFitted), |signal| self.channel(signal))
    }
}
