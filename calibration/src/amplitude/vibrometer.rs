//! A laser vibrometer's velocity signal: from volts to an amplitude.
//!
//! The waveform is analogue; the controller's serial line gives only the decoder's name, range and delay.
//! The delay must be subtracted in phase: 8 us are 84 degrees at 29 kHz.

use crate::regression::{FitError, linear};
use models::PeakToPeak;
use nalgebra::{DMatrix, DVector};
use std::f64::consts::PI;

/// What a velocity decoder is set to, as read back from the controller.
#[derive(Clone, Debug, PartialEq)]
pub struct Decoder {
    /// Name: decoder numbers differ between instruments, so the name is what counts.
    pub name: String,
    /// Velocity per volt in (m/s)/V.
    pub range_m_s_per_v: f64,
    /// Delay of the signal in s.
    pub delay_s: f64,
}

/// A setting that is not understood.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("`{text}` is no {what}: expected something like `{like}`")]
pub struct SettingError {
    /// What came back.
    pub text: String,
    /// What it should be.
    pub what: &'static str,
    /// An example.
    pub like: &'static str,
}

impl Decoder {
    /// From the texts of a Polytec controller: `VD-03`, `5mm/s/V`, `8.16 us`.
    ///
    /// # Errors
    /// A text that is not a range or not a delay.
    pub fn from_settings(name: &str, range: &str, delay: &str) -> Result<Self, SettingError> {
        let wrong = |text: &str, what, like| SettingError { text: text.into(), what, like };
        let per_volt = range.trim().strip_suffix("/s/V").and_then(|body| scaled(body, 'm'));
        let range_m_s_per_v =
            per_volt.filter(|r| *r > 0.0).ok_or_else(|| wrong(range, "range", "5mm/s/V"))?;
        let delay_s = scaled(delay, 's').filter(|d| *d >= 0.0);
        let delay_s = delay_s.ok_or_else(|| wrong(delay, "signal delay", "8.16 us"))?;
        Ok(Decoder { name: name.trim().into(), range_m_s_per_v, delay_s })
    }
}

/// `5 mm` as 0.005: a number, an SI prefix, the unit.
fn scaled(text: &str, unit: char) -> Option<f64> {
    let text = text.trim().strip_suffix(unit)?;
    let (number, factor) = match text.chars().last()? {
        'n' => (&text[..text.len() - 1], 1e-9),
        'u' => (&text[..text.len() - 1], 1e-6),
        '\u{b5}' | '\u{3bc}' => (&text[..text.len() - 2], 1e-6),
        'm' => (&text[..text.len() - 1], 1e-3),
        'k' => (&text[..text.len() - 1], 1e3),
        _ => (text, 1.0),
    };
    number.trim().parse().ok().filter(|x: &f64| x.is_finite()).map(|x| x * factor)
}

/// Peak-to-peak amplitude of the displacement, `w = 2 v / (2 pi f)`, by the three-parameter fit of a sine at a
/// known frequency (IEEE 1057) to a waveform in volts.
///
/// # Errors
/// Too few samples, or fewer than a whole period.
pub fn amplitude(
    volts: &[f64],
    rate_hz: f64,
    frequency_hz: f64,
    decoder: &Decoder,
) -> Result<PeakToPeak, FitError> {
    if (volts.len() as f64) < rate_hz / frequency_hz {
        return Err(FitError::TooFew { observations: volts.len(), parameters: 3 });
    }
    let angle = |i: usize| 2.0 * PI * frequency_hz * i as f64 / rate_hz;
    let design = DMatrix::from_fn(volts.len(), 3, |i, k| [angle(i).cos(), -angle(i).sin(), 1.0][k]);
    let sine = linear::ordinary(&design, &DVector::from_column_slice(volts))?.estimates;
    let velocity_m_s = sine[0].hypot(sine[1]) * decoder.range_m_s_per_v;
    Ok(PeakToPeak::from_metres(velocity_m_s / (PI * frequency_hz)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_as_a_polytec_sends_them() {
        let decoder = Decoder::from_settings("VD-03", "5mm/s/V", "8.16 us").unwrap();
        assert!((decoder.range_m_s_per_v - 5e-3).abs() < 1e-18);
        assert!((decoder.delay_s - 8.16e-6).abs() < 1e-18);
        assert_eq!(Decoder::from_settings("", "1 m/s/V", "0 s").unwrap().range_m_s_per_v, 1.0);
        assert!(
            (Decoder::from_settings("", "200\u{b5}m/s/V", "2\u{b5}s").unwrap().range_m_s_per_v - 2e-4).abs()
                < 1e-16
        );
        for bad in ["5mm/V", "fast", "-5mm/s/V", ""] {
            assert!(Decoder::from_settings("x", bad, "1 us").is_err(), "{bad}");
        }
    }

    #[test]
    fn the_amplitude_of_a_sine_is_found() {
        // 2 um peak-to-peak at 27.5 kHz is 172.8 mm/s; the decoder shows it 8.16 us late.
        let (f, rate, w) = (27_500.0, 1e6, 2e-6);
        let decoder = Decoder::from_settings("VD-02", "125mm/s/V", "8.16us").unwrap();
        let volts: Vec<f64> = (0..4000)
            .map(|i| {
                let t = f64::from(i) / rate - decoder.delay_s;
                PI * f * w * (2.0 * PI * f * t + 0.4).cos() / decoder.range_m_s_per_v
            })
            .collect();
        let found = amplitude(&volts, rate, f, &decoder).unwrap();
        assert!((found.metres() / w - 1.0).abs() < 1e-9);
    }
}
