//! A vibrometer's settings, read back from its controller for a calibration.
//!
//! The velocity itself is a voltage that something else reads; the decoder's range and delay turn it into
//! metres. They are queried once, before a calibration, and never changed. Each instrument numbers its
//! decoders differently, and a wrong one gives a plausible wrong amplitude, so their names are queried first.

use super::off::PendingOff;
use super::serial::Line;
use super::stream::first_line;
use super::user_profiles::Source;
use super::{LinkError, OpenError};
use calibration::amplitude::vibrometer::Decoder;
use instruments::Profile;
use instruments::codec::text::quantity;
use instruments::schema::{Link, LinkKind};
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// `[vibrometer]` of a setup.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct VibrometerSetup {
    /// Id of the profile; in a file, also the path of one.
    pub profile: String,
    /// The profile as it was read, where it does not come with the program.
    #[serde(skip)]
    pub source: Option<Arc<Source>>,
    /// Path of the serial line; `pty` for a virtual rig.
    pub address: String,
    /// Name of the decoder whose output is read, as the controller gives it. May be left out where it has one only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub decoder: Option<String>,
    /// Symbols per second, where they are not the profile's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub baud: Option<u32>,
}

impl VibrometerSetup {
    /// What the controller is: the profile that was read with the setup, else the bundled one of that name.
    ///
    /// # Errors
    /// Where there is none, or it does not hold.
    pub fn description(&self) -> Result<Profile, OpenError> {
        self.source.as_ref().map_or_else(|| super::profile(&self.profile), |source| source.profile())
    }
}

/// What a controller says of the decoder that is read.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct VibrometerSettings {
    /// Name of the decoder.
    pub decoder: String,
    /// Its number in this instrument.
    pub number: u8,
    /// Velocity per volt in (m/s)/V.
    pub range_m_s_per_v: f64,
    /// Delay of the output in s.
    pub signal_delay_s: f64,
    /// Upper end of the decoder's band in Hz.
    pub max_frequency_hz: f64,
    /// Names of all decoders, by number.
    pub decoders: Vec<String>,
}

impl VibrometerSettings {
    /// The decoder, as the calibrations take it.
    pub fn decoder(&self) -> Decoder {
        Decoder {
            name: self.decoder.clone(),
            range_m_s_per_v: self.range_m_s_per_v,
            delay_s: self.signal_delay_s,
        }
    }

    /// Whether a drive of that frequency lies within the decoder's band.
    ///
    /// # Errors
    /// It does not: the amplitude would come out too small.
    pub fn covers(&self, frequency_hz: f64) -> Result<(), BeyondBand> {
        let (decoder, most_hz) = (self.decoder.clone(), self.max_frequency_hz);
        if frequency_hz <= most_hz { Ok(()) } else { Err(BeyondBand { decoder, most_hz, frequency_hz }) }
    }
}

impl std::fmt::Display for VibrometerSettings {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "decoder {} (number {}) at {} mm/s/V, delay {:.3} \u{b5}s, to {:.1} kHz",
            self.decoder,
            self.number,
            self.range_m_s_per_v * 1e3,
            self.signal_delay_s * 1e6,
            self.max_frequency_hz * 1e-3
        )
    }
}

/// A drive beyond the decoder's band.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(
    "decoder {decoder} reaches to {most_hz:.0} Hz in this range, the drive is at {frequency_hz:.0} Hz: \
     choose another decoder or range at the controller"
)]
#[allow(missing_docs, reason = "the message of an error says what its fields are")]
pub struct BeyondBand {
    pub decoder: String,
    pub most_hz: f64,
    pub frequency_hz: f64,
}

/// Asks a controller for the settings of the decoder that the setup names.
///
/// # Errors
/// A profile that is not a vibrometer's, a line that cannot be opened, a decoder that is not there, answers
/// that make no sense, settings that changed while they were read.
pub fn settings(setup: &VibrometerSetup) -> Result<VibrometerSettings, OpenError> {
    let profile = setup.description()?;
    let link = profile.description.link.clone();
    let (LinkKind::Serial, Some(choice)) = (link.kind, link.choice.clone()) else {
        return Err(OpenError::Unfit(setup.profile.clone(), " is not that of a vibrometer's controller"));
    };
    let (id, address) = (&setup.profile, &setup.address);
    let failed = |problem| OpenError::Beside { id: id.clone(), address: address.clone(), problem };
    let baud = setup.baud.or(link.baud).unwrap_or(115_200);
    let line = Line::open(&setup.address, baud, link.line_format()).map_err(failed)?;
    let mut talk = Talk { line, link, came: Vec::new() };
    // Ends a line that an earlier program left incomplete.
    talk.line.write(talk.link.tx_end().as_bytes()).map_err(failed)?;
    talk.line
        .drain(Duration::from_millis(100), Duration::from_secs(1), &PendingOff::default())
        .map_err(failed)?;
    let mut decoders = Vec::new();
    for number in 0..choice.most {
        match talk.ask(&choice.ask.replace("{which}", &number.to_string())) {
            Ok(name) if is_name(&name) => decoders.push(name),
            // The end of the list: silence, or words that are no name.
            Ok(_) | Err(LinkError::Timeout(_) | LinkError::Cut(_)) => break,
            Err(error) => return Err(failed(error)),
        }
    }
    let number = choose(&decoders, setup.decoder.as_deref()).map_err(|why| failed(LinkError::Io(why)))?;
    let mut read = || talk.settings(&profile, number, &decoders).map_err(failed);
    let (first, second) = (read()?, read()?);
    if first != second {
        let why = "the settings changed while they were read; let nobody touch the controller and ask again";
        return Err(failed(LinkError::Io(why.into())));
    }
    Ok(first)
}

/// A name is one word with a letter in it, such as `VD-02`.
fn is_name(text: &str) -> bool {
    !text.is_empty()
        && text.len() <= 32
        && text.chars().any(|c| c.is_ascii_alphabetic())
        && text.chars().all(|c| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.' | '/'))
        && !text.to_ascii_lowercase().contains("err")
}

/// The number of the decoder that is meant.
fn choose(decoders: &[String], wanted: Option<&str>) -> Result<u8, String> {
    let all = decoders.join(", ");
    let found: Vec<usize> = match wanted {
        None => (0..decoders.len()).collect(),
        Some(name) => (0..decoders.len()).filter(|&i| decoders[i] == name).collect(),
    };
    match (found.as_slice(), wanted) {
        ([one], _) => u8::try_from(*one).map_err(|e| e.to_string()),
        (_, _) if decoders.is_empty() => {
            Err("no decoder answered with a name: is its echo on, or is this another instrument?".into())
        }
        (_, None) => Err(format!("it has several decoders ({all}): say which by `decoder` in the setup")),
        ([], Some(name)) => Err(format!("it has no decoder {name}; it has {all}")),
        (_, Some(name)) => Err(format!("two of its decoders are called {name}")),
    }
}

struct Talk {
    line: Line,
    link: Link,
    came: Vec<u8>,
}

impl Talk {
    /// One question and its answer, a line.
    fn ask(&mut self, question: &str) -> Result<String, LinkError> {
        let came = self.link.rx_end().as_bytes();
        self.came.clear();
        self.line.write(format!("{question}{}", self.link.tx_end()).as_bytes())?;
        let deadline = Instant::now() + self.link.patience();
        loop {
            if let Some(line) = first_line(&mut self.came, came)? {
                let answer = String::from_utf8_lossy(&line).trim().to_string();
                if answer == question {
                    return Err(LinkError::Refused("it echoes what it is sent: switch its Echo off".into()));
                }
                return Ok(answer);
            }
            let mut buffer = [0; 256];
            let count = self.line.read(&mut buffer, deadline)?;
            self.came.extend_from_slice(&buffer[..count]);
            if count == 0 && Instant::now() >= deadline {
                return Err(match self.came.is_empty() {
                    true => LinkError::Timeout(self.link.response_timeout_ms),
                    false => LinkError::Cut(super::remedy::unended(&self.came, came, question)),
                });
            }
        }
    }

    fn settings(
        &mut self,
        profile: &Profile,
        number: u8,
        decoders: &[String],
    ) -> Result<VibrometerSettings, LinkError> {
        let mut values = profile.values();
        for (frame, query) in profile.queries() {
            let question = query.send.replace("{which}", &number.to_string());
            let answer = self.ask(&question)?;
            let unit = query.unit.as_deref().unwrap_or("");
            let value = quantity(&answer, unit)
                .ok_or_else(|| LinkError::Refused(format!("`{question}` was answered by `{answer}`")))?;
            profile
                .decode(frame, &value.to_be_bytes(), &mut values)
                .map_err(|error| LinkError::Refused(format!("`{question}`, `{answer}`: {error}")))?;
        }
        let value = |name: &str| {
            let signal = profile.signal(name);
            let signal =
                signal.ok_or_else(|| LinkError::Refused(format!("the profile has no signal `{name}`")))?;
            match profile.refusal(signal, &values) {
                None => Ok(values.get(signal)),
                Some(why) => Err(LinkError::Refused(format!("{name} = {}: {why:?}", values.get(signal)))),
            }
        };
        Ok(VibrometerSettings {
            decoder: decoders[usize::from(number)].clone(),
            number,
            range_m_s_per_v: value("range")?,
            signal_delay_s: value("signal_delay")?,
            max_frequency_hz: value("max_frequency")?,
            decoders: decoders.to_vec(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_decoder_is_chosen_by_its_name_alone() {
        let all: Vec<String> = ["DD-300", "VD-02", "VD-09"].map(String::from).into();
        assert_eq!(choose(&all, Some("VD-02")), Ok(1));
        assert_eq!(choose(&all[..1], None), Ok(0));
        assert!(choose(&all, None).unwrap_err().contains("DD-300, VD-02, VD-09"));
        assert!(choose(&all, Some("VD-03")).unwrap_err().contains("no decoder VD-03"));
        assert!(choose(&[], Some("VD-02")).unwrap_err().contains("echo"));
        for (text, name) in
            [("VD-02", true), ("", false), ("Error", false), ("5", false), ("no such unit", false)]
        {
            assert_eq!(is_name(text), name, "{text}");
        }
    }

    #[test]
    fn a_frequency_beyond_the_band_is_told() {
        let settings = VibrometerSettings {
            decoder: "VD-09".into(),
            number: 0,
            range_m_s_per_v: 0.1,
            signal_delay_s: 8e-6,
            max_frequency_hz: 20e3,
            decoders: vec!["VD-09".into()],
        };
        assert!(settings.covers(19e3).is_ok());
        assert!(settings.covers(27.5e3).unwrap_err().to_string().contains("20000 Hz"));
    }
}
