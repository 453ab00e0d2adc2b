//! Temperature ranges of certificates, compared with what the instruments report while the rig runs.
//!
//! The check when a setup is read knows only the temperature that somebody read off at the bench. Here the
//! amplifier's own channel (its own or the plate's temperature) is looked at when a pass begins to be
//! measured: outside the certificate's range the pass carries a flag. Nothing is corrected and nothing stops;
//! the reader of the table decides. It runs beside the loop, on the rows that it leaves.

use realtime::ports::{Channel, NoData};
use serde::{Deserialize, Serialize};

/// A certificate that holds within a range of temperatures of the amplifier.
#[derive(Clone, Debug, PartialEq)]
pub struct TemperatureRange {
    /// The certificate, for people.
    pub certificate: String,
    /// Range in deg C.
    pub range_c: [f64; 2],
}

/// A pass that was measured where a certificate does not hold, or where that is not known.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TemperatureFlag {
    /// The certificate.
    pub certificate: String,
    /// Where it holds, in deg C.
    pub range_c: [f64; 2],
    /// What the amplifier reported when the pass began to be measured, in deg C.
    pub found_c: Option<f64>,
    /// Why it reported nothing.
    pub missing: Option<NoData>,
}

impl TemperatureRange {
    /// The flag of a pass that begins with this temperature; `None` within the range. An amplifier without
    /// the channel flags no pass: a warning comes once, when the rig is armed.
    pub fn flag(&self, temperature_c: &Channel) -> Option<TemperatureFlag> {
        let (found_c, missing) = match temperature_c {
            Ok(reading) if self.holds(reading.value) => return None,
            Ok(reading) => (Some(reading.value), None),
            Err(NoData::NotFitted) => return None,
            Err(reason) => (None, Some(*reason)),
        };
        let TemperatureRange { certificate, range_c } = self.clone();
        Some(TemperatureFlag { certificate, range_c, found_c, missing })
    }

    fn holds(&self, temperature_c: f64) -> bool {
        (self.range_c[0]..=self.range_c[1]).contains(&temperature_c)
    }
}

impl std::fmt::Display for TemperatureFlag {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [low, high] = self.range_c;
        write!(f, "{} holds from {low:.1} to {high:.1} deg C, the amplifier reports ", self.certificate)?;
        match (self.found_c, self.missing) {
            (Some(found), _) => write!(f, "{found:.1}"),
            (None, Some(reason)) => write!(f, "no temperature ({reason})"),
            (None, None) => write!(f, "no temperature"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use realtime::ports::{Nanos, Quality, Sample};

    fn channel(value: f64) -> Channel {
        Ok(Sample { value, raw: 0, taken_at: Nanos(0), sequence: 0, quality: Quality::Good })
    }

    #[test]
    fn both_ends_of_the_range_belong_to_it_and_silence_is_flagged() {
        let range = TemperatureRange { certificate: "a.toml".into(), range_c: [15.0, 30.0] };
        for held in [15.0, 22.0, 30.0] {
            assert_eq!(range.flag(&channel(held)), None);
        }
        for beyond in [14.99, 30.01, f64::NAN] {
            let flag = range.flag(&channel(beyond)).expect("flagged");
            assert!(flag.missing.is_none() && flag.to_string().contains("15.0 to 30.0"), "{flag}");
        }
        let lost = range.flag(&Err(NoData::Disconnected)).expect("flagged");
        assert!(lost.found_c.is_none() && lost.to_string().contains("the link is down"), "{lost}");
        // An amplifier without a thermometer: reported once, not with every pass.
        assert_eq!(range.flag(&Err(NoData::NotFitted)), None);
    }
}
