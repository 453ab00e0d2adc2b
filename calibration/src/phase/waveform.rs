//! From two velocity waveforms to one phase shift.

use crate::amplitude::vibrometer::Decoder;
use crate::regression::{Fit, FitError, ends, linear};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::PI;

/// Harmonics of the fundamental (and as many half-odd ones) that describe a waveform.
const HARMONICS: usize = 8;

/// Two records of one acquisition.
#[derive(Clone, Debug, PartialEq)]
pub struct Waveforms<'a> {
    /// Samples of the plate's velocity in V.
    pub plate_v: &'a [f64],
    /// Samples of the skin's velocity in V.
    pub skin_v: &'a [f64],
    /// Sample rate in Hz.
    pub rate_hz: f64,
    /// Frequency of the drive in Hz.
    pub frequency_hz: f64,
    /// Decoder of the plate's signal.
    pub plate: &'a Decoder,
    /// Decoder of the skin's signal.
    pub skin: &'a Decoder,
}

/// Phase shift of one acquisition.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shift {
    /// Eq. 1 in degrees, in [0, 360): how much later than the plate's the skin's acceleration peaks.
    pub phase_deg: f64,
    /// Whether the share of the skin's motion (variance of the velocity) at half-odd multiples of the
    /// frequency is significant and above a hundredth: the period has doubled.
    pub period_doubled: bool,
}

/// Why there is no phase shift.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the message of an error says what its fields are")]
pub enum PhaseError {
    /// The record is too short or sampled too slowly.
    #[error("{samples} samples at {rate_hz} Hz: {reason}")]
    Record { samples: usize, rate_hz: f64, reason: &'static str },
    /// A record at the end of the digitiser's range.
    #[error("the {0} record is clipped: its extreme value repeats; choose a larger vibrometer range")]
    Clipped(&'static str),
    /// No motion at the drive's frequency.
    #[error("the {0} does not move at the drive's frequency: check focus and frequency")]
    NoMotion(&'static str),
    /// Too few repeats.
    #[error("{found} repeats are too few: the paper takes 10, three are the least")]
    TooFewRepeats { found: usize },
    /// The repeats do not agree.
    #[error("the repeats point everywhere (mean resultant {resultant:.2}): there is no phase to state")]
    Scattered { resultant: f64 },
    /// The regression failed.
    #[error(transparent)]
    Fit(#[from] FitError),
}

/// Fourier coefficients of a velocity at multiples of half the drive's frequency.
struct Spectrum {
    /// Cosine and sine parts in m/s, index `k` at `k f / 2`.
    parts: Vec<[f64; 2]>,
    fit: Fit,
}

/// The phase shift of Eq. 1 from one acquisition.
///
/// # Errors
/// Records that cannot carry the answer: too short, too slow, clipped, or without motion.
pub fn shift(w: &Waveforms) -> Result<Shift, PhaseError> {
    let n = w.plate_v.len().min(w.skin_v.len());
    let record = |reason| PhaseError::Record { samples: n, rate_hz: w.rate_hz, reason };
    if (n as f64) < 8.0 * w.rate_hz / w.frequency_hz {
        return Err(record("eight periods are needed, twice that where the period doubles"));
    }
    if w.rate_hz < 8.0 * w.frequency_hz {
        return Err(record("at least eight samples per period are needed for the acceleration's peak"));
    }
    // As many harmonics as the rate carries.
    let harmonics = HARMONICS.min(((w.rate_hz / w.frequency_hz - 1.0) / 2.0) as usize);
    let plate = spectrum("plate", &w.plate_v[..n], w, w.plate, harmonics)?;
    let skin = spectrum("skin", &w.skin_v[..n], w, w.skin, harmonics)?;
    let variance = |s: &Spectrum, which: &dyn Fn(usize) -> bool| {
        let lines = s.parts.iter().enumerate().filter(|(k, _)| which(*k));
        lines.map(|(_, p)| p[0] * p[0] + p[1] * p[1]).sum::<f64>()
    };
    let odd = |k: usize| k % 2 == 1;
    let share = variance(&skin, &odd) / variance(&skin, &|_| true);
    // Chi squared of the half-odd lines against the residual scatter.
    let noise: f64 = (0..skin.parts.len())
        .filter(|k| odd(*k))
        .map(|k| skin.fit.covariance[(2 * k - 1, 2 * k - 1)] + skin.fit.covariance[(2 * k, 2 * k)])
        .sum();
    let significant = variance(&skin, &odd) > 10.0 * noise;
    let period_doubled = significant && share > 0.01;
    let t_plate = peak_of_acceleration(&plate.parts, false);
    let t_skin = peak_of_acceleration(&skin.parts, period_doubled);
    Ok(Shift { phase_deg: (360.0 * (t_skin - t_plate)).rem_euclid(360.0), period_doubled })
}

fn spectrum(
    name: &'static str,
    volts: &[f64],
    w: &Waveforms,
    decoder: &Decoder,
    harmonics: usize,
) -> Result<Spectrum, PhaseError> {
    for top in ends(volts.iter().copied()) {
        // A clipped wave stays at its extreme for several samples in a row, period after period.
        let flat = volts.windows(3).filter(|v| v.iter().all(|x| *x == top)).count();
        if flat > 3 {
            return Err(PhaseError::Clipped(name));
        }
    }
    let lines = 2 * harmonics;
    let step = PI * w.frequency_hz / w.rate_hz;
    let design = DMatrix::from_fn(volts.len(), 2 * lines + 1, |i, j| match j {
        0 => 1.0,
        _ => {
            let k = j.div_ceil(2) as f64;
            let angle = k * step * i as f64;
            if j % 2 == 1 { angle.cos() } else { angle.sin() }
        }
    });
    let mut fit = linear::ordinary(&design, &DVector::from_column_slice(volts))?;
    let scale = decoder.range_m_s_per_v;
    fit.estimates *= scale;
    fit.covariance *= scale * scale;
    let mut parts = vec![[0.0; 2]];
    for k in 1..=lines {
        // The signal shows what the surface did one delay ago: turn each line forward by its own phase.
        let (s, c) = (PI * k as f64 * w.frequency_hz * decoder.delay_s).sin_cos();
        let (a, b) = (fit.estimates[2 * k - 1], fit.estimates[2 * k]);
        parts.push([a * c + b * s, b * c - a * s]);
    }
    let fundamental = parts[2][0].hypot(parts[2][1]);
    let doubt = (fit.covariance[(3, 3)] + fit.covariance[(4, 4)]).sqrt();
    if fundamental < 10.0 * doubt { Err(PhaseError::NoMotion(name)) } else { Ok(Spectrum { parts, fit }) }
}

/// Instant of the largest acceleration in periods of the drive; over two periods with subharmonics.
fn peak_of_acceleration(parts: &[[f64; 2]], with_subharmonics: bool) -> f64 {
    let acceleration = |t: f64| -> f64 {
        parts
            .iter()
            .enumerate()
            .filter(|(k, _)| with_subharmonics || k % 2 == 0)
            .map(|(k, [a, b])| {
                let omega = PI * k as f64;
                let (s, c) = (omega * t).sin_cos();
                omega * (b * c - a * s)
            })
            .sum()
    };
    let span = if with_subharmonics { 2.0 } else { 1.0 };
    let steps = 512;
    let at = |i: usize| span * i as f64 / steps as f64;
    let best = (0..steps).max_by(|i, j| acceleration(at(*i)).total_cmp(&acceleration(at(*j)))).unwrap_or(0);
    // Golden section around the best of the grid.
    let ratio = 0.5 * (5f64.sqrt() - 1.0);
    let (mut low, mut high) = (at(best) - span / steps as f64, at(best) + span / steps as f64);
    for _ in 0..60 {
        let (a, b) = (high - ratio * (high - low), low + ratio * (high - low));
        if acceleration(a) > acceleration(b) { high = b } else { low = a }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decoder(delay_s: f64) -> Decoder {
        Decoder { name: "VD-02".into(), range_m_s_per_v: 0.125, delay_s }
    }

    fn volts(f: impl Fn(f64) -> f64, delay_s: f64) -> Vec<f64> {
        (0..4096).map(|i| f(f64::from(i) / 1e6 - delay_s) / 0.125).collect()
    }

    const F: f64 = 27_500.0;

    #[test]
    fn a_lag_of_a_quarter_comes_back_with_unequal_delays_taken_off() {
        let (plate, skin) = (decoder(8.16e-6), decoder(2.5e-6));
        let wave = |lag: f64| {
            move |t: f64| 0.1 * (2.0 * PI * F * t - lag).sin() + 0.02 * (4.0 * PI * F * t - 2.0 * lag).sin()
        };
        let p = volts(wave(0.0), plate.delay_s);
        let s = volts(wave(PI / 2.0), skin.delay_s);
        let w =
            Waveforms { plate_v: &p, skin_v: &s, rate_hz: 1e6, frequency_hz: F, plate: &plate, skin: &skin };
        let found = shift(&w).unwrap();
        assert!((found.phase_deg - 90.0).abs() < 1e-4, "{found:?}");
        assert!(!found.period_doubled);
    }

    #[test]
    fn a_doubled_period_is_flagged() {
        let d = decoder(0.0);
        let p = volts(|t| 0.1 * (2.0 * PI * F * t).sin(), 0.0);
        let s = volts(|t| 0.1 * (2.0 * PI * F * t).sin() + 0.05 * (PI * F * t).sin(), 0.0);
        let w = Waveforms { plate_v: &p, skin_v: &s, rate_hz: 1e6, frequency_hz: F, plate: &d, skin: &d };
        assert!(shift(&w).unwrap().period_doubled);
    }

    #[test]
    fn clipped_short_and_still_records_are_refused() {
        let d = decoder(0.0);
        let p = volts(|t| 0.1 * (2.0 * PI * F * t).sin(), 0.0);
        let clipped: Vec<f64> = p.iter().map(|x| x.clamp(-0.5, 0.5)).collect();
        let still: Vec<f64> = (0..4096).map(|i| f64::from(i % 7) * 1e-3).collect();
        let make = |skin: &[f64]| {
            shift(&Waveforms {
                plate_v: &p,
                skin_v: skin,
                rate_hz: 1e6,
                frequency_hz: F,
                plate: &d,
                skin: &d,
            })
        };
        assert_eq!(make(&clipped).unwrap_err(), PhaseError::Clipped("skin"));
        assert_eq!(make(&still).unwrap_err(), PhaseError::NoMotion("skin"));
        assert!(matches!(make(&p[..100]), Err(PhaseError::Record { .. })));
    }
}
