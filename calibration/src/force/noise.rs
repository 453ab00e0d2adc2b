//! Noise of a channel at rest: mean with an honest uncertainty, spectrum, quantisation, equal samples.

use statrs::function::erf::erf;
use std::f64::consts::PI;

/// Mean and its standard uncertainty from evenly spaced samples whose errors may be correlated.
///
/// The number of independent samples is `n / tau` with the integrated autocorrelation time
/// `tau = 1 + 2 sum rho_k`, summed up to a window of five `tau` (Sokal 1997).
pub fn mean_with_uncertainty(samples: &[f64]) -> (f64, f64) {
    let n = samples.len();
    if n == 0 {
        return (f64::NAN, f64::INFINITY);
    }
    let mean = samples.iter().sum::<f64>() / n as f64;
    if n < 2 {
        return (mean, f64::INFINITY);
    }
    let variance = samples.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n as f64 - 1.0);
    let tau = integrated_autocorrelation_time(samples);
    let independent = (n as f64 / tau).max(1.0);
    // A sample whose tau is not short beside it also underestimates its own variance.
    let short = (1.0 - 1.0 / independent).max(0.5 / independent);
    (mean, (variance / short / independent).sqrt())
}

/// Integrated autocorrelation time in samples, at least one.
pub fn integrated_autocorrelation_time(samples: &[f64]) -> f64 {
    let n = samples.len();
    let mean = samples.iter().sum::<f64>() / n as f64;
    let covariance = |lag: usize| {
        samples[lag..].iter().zip(samples).map(|(a, b)| (a - mean) * (b - mean)).sum::<f64>() / n as f64
    };
    let zero = covariance(0);
    if zero <= 0.0 {
        return 1.0;
    }
    let mut tau = 1.0;
    for lag in 1..n / 2 {
        tau += 2.0 * covariance(lag) / zero;
        if lag as f64 >= 5.0 * tau {
            break;
        }
    }
    tau.max(1.0)
}

/// A one-sided power spectral density: its sum times `resolution_hz` is the variance.
#[derive(Clone, Debug, PartialEq)]
pub struct Spectrum {
    /// Distance of the lines in Hz; line `k` is at `k * resolution_hz`.
    pub resolution_hz: f64,
    /// Density at each line, in unit squared per Hz. Line 0 is the mean's and is left at zero.
    pub density: Vec<f64>,
    /// Number of averaged segments (half overlapping).
    pub segments: usize,
}

/// A line that stands out of its neighbourhood, as mains hum does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hum {
    /// Frequency in Hz.
    pub frequency_hz: f64,
    /// Standard deviation (RMS) of the line, in the unit of the samples.
    pub rms: f64,
}

impl Spectrum {
    /// Welch's estimate with Hann windows of `length` samples overlapping by half.
    /// `None` where there is not one whole segment of at least 16 samples.
    pub fn welch(samples: &[f64], rate_hz: f64, length: usize) -> Option<Self> {
        if length < 16 || samples.len() < length {
            return None;
        }
        let window: Vec<f64> =
            (0..length).map(|i| (PI * (i as f64 + 0.5) / length as f64).sin().powi(2)).collect();
        let power: f64 = window.iter().map(|w| w * w).sum();
        let mut density = vec![0.0; length / 2 + 1];
        let mut segments = 0;
        for start in (0..=samples.len() - length).step_by(length / 2) {
            let part = &samples[start..start + length];
            let mean = part.iter().sum::<f64>() / length as f64;
            let weighted: Vec<f64> = part.iter().zip(&window).map(|(x, w)| (x - mean) * w).collect();
            for (k, d) in density.iter_mut().enumerate().skip(1) {
                let (re, im) = line(&weighted, k as f64 / length as f64);
                let sides = if 2 * k == length { 1.0 } else { 2.0 };
                *d += sides * (re * re + im * im) / (power * rate_hz);
            }
            segments += 1;
        }
        density.iter_mut().for_each(|d| *d /= segments as f64);
        Some(Spectrum { resolution_hz: rate_hz / length as f64, density, segments })
    }

    /// Median density: the level of the white noise, lines and drift aside. (The median of a mean of `m`
    /// exponential variables is about `1 - 1/(3 m)` of its mean.)
    pub fn white_level(&self) -> f64 {
        let mut sorted: Vec<f64> = self.density.iter().copied().skip(1).collect();
        sorted.sort_by(f64::total_cmp);
        sorted[sorted.len() / 2] / (1.0 - 1.0 / (3.0 * self.segments as f64))
    }

    /// Lines at least `factor` times the white level, above the lowest two lines (the drift's).
    pub fn lines(&self, factor: f64) -> Vec<Hum> {
        let floor = self.white_level();
        let d = &self.density;
        (3..d.len().saturating_sub(1))
            .filter(|&k| d[k] > factor * floor && d[k] >= d[k - 1] && d[k] > d[k + 1])
            .map(|k| Hum {
                frequency_hz: k as f64 * self.resolution_hz,
                // A Hann window spreads a line over three.
                rms: ((d[k - 1] + d[k] + d[k + 1] - 3.0 * floor).max(0.0) * self.resolution_hz).sqrt(),
            })
            .collect()
    }
}

/// One line of the discrete Fourier transform at `cycles` per sample (Goertzel's recurrence, stabilised by
/// rotating rather than by the second-order form).
fn line(samples: &[f64], cycles: f64) -> (f64, f64) {
    let (sin, cos) = (2.0 * PI * cycles).sin_cos();
    let (mut c, mut s) = (1.0, 0.0);
    let (mut re, mut im) = (0.0, 0.0);
    for x in samples {
        re += x * c;
        im -= x * s;
        (c, s) = (c * cos - s * sin, s * cos + c * sin);
    }
    (re, im)
}

/// Step of the converter in counts: the largest step of which all differences are multiples.
/// `None` where all samples are equal or not whole numbers.
pub fn quantum(counts: &[i64]) -> Option<u64> {
    let gcd = |mut a: u64, mut b: u64| {
        while b != 0 {
            (a, b) = (b, a % b);
        }
        a
    };
    let step = counts.windows(2).fold(0, |g, w| gcd(g, w[0].abs_diff(w[1])));
    (step > 0).then_some(step)
}

/// Probability that two successive samples of white Gaussian noise are equal after rounding, averaged over
/// where the mean lies between two steps: `erf(r/2) - (2 / (r sqrt pi)) (1 - exp(-r^2/4))`, `r = quantum / sd`.
pub fn probability_of_equal_samples(sd: f64, quantum: f64) -> f64 {
    if sd <= 0.0 {
        return 1.0;
    }
    let r = quantum / sd;
    if r < 1e-4 {
        return r / (2.0 * PI.sqrt());
    }
    erf(r / 2.0) - 2.0 / (r * PI.sqrt()) * (1.0 - (-r * r / 4.0).exp())
}

/// How often successive samples are equal, and the rule for a frozen value that follows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EqualSamples {
    /// Share of successive pairs that are equal.
    pub share: f64,
    /// Upper 99.9 % bound of that probability (Wilson).
    pub upper: f64,
    /// Longest run of equal samples that was seen.
    pub longest_run: usize,
    /// Where that run begins (counted from 0), if fewer than one in a million records of such noise have it.
    /// No value is likelier than the root of the share of equal pairs, wherever the mean lies.
    pub frozen_from: Option<usize>,
}

impl EqualSamples {
    /// From one channel's counts. `None` with fewer than 100 samples.
    pub fn of(counts: &[i64]) -> Option<Self> {
        if counts.len() < 100 {
            return None;
        }
        let pairs = (counts.len() - 1) as f64;
        let equal = counts.windows(2).filter(|w| w[0] == w[1]).count() as f64;
        let run = counts.chunk_by(|a, b| a == b).max_by_key(|run| run.len()).unwrap_or(counts);
        let (p, z) = (equal / pairs, 3.0902);
        let centre = p + z * z / (2.0 * pairs);
        let half = z * (p * (1.0 - p) / pairs + z * z / (4.0 * pairs * pairs)).sqrt();
        let upper = (centre + half) / (1.0 + z * z / pairs);
        let frozen = counts.len() as f64 * upper.powf(0.5 * run.len() as f64) < 1e-6;
        let frozen_from = counts.windows(run.len()).position(|w| w == run).filter(|_| frozen);
        Some(EqualSamples { share: p, upper, longest_run: run.len(), frozen_from })
    }

    /// Number of equal samples in a row after which a channel counts as frozen, such that a live one is
    /// called frozen at most with this probability per sample, and never for a run that was seen at rest.
    /// `None` where the noise is below the converter's step, so that equal samples say nothing.
    pub fn frozen_after(&self, false_alarm_per_sample: f64) -> Option<usize> {
        let p = self.upper;
        let n = 1 + (false_alarm_per_sample.ln() / p.ln()).ceil() as usize;
        (p < 0.98).then(|| n.max(2 * self.longest_run))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha12Rng;
    use rand_distr::{Distribution, StandardNormal};

    fn white(n: usize, sd: f64, seed: u64) -> Vec<f64> {
        let mut rng = ChaCha12Rng::seed_from_u64(seed);
        (0..n)
            .map(|_| {
                sd * {
                    let z: f64 = StandardNormal.sample(&mut rng);
                    z
                }
            })
            .collect()
    }

    #[test]
    fn the_spectrum_of_white_noise_is_flat_and_sums_to_the_variance() {
        let x = white(65_536, 2.0, 1);
        let s = Spectrum::welch(&x, 1000.0, 256).unwrap();
        let variance = s.density.iter().sum::<f64>() * s.resolution_hz;
        assert!((variance / 4.0 - 1.0).abs() < 0.02, "Parseval");
        // One-sided density of white noise: 2 sd^2 / rate.
        assert!((s.white_level() / 8e-3 - 1.0).abs() < 0.03);
        assert!(s.lines(6.0).is_empty());
    }

    #[test]
    fn mains_hum_is_found_with_its_size() {
        let hum = |i: usize| 0.5 * 2f64.sqrt() * (2.0 * PI * 50.0 * i as f64 / 1000.0).sin();
        let x: Vec<f64> = white(40_000, 1.0, 2).iter().enumerate().map(|(i, x)| x + hum(i)).collect();
        let lines = Spectrum::welch(&x, 1000.0, 500).unwrap().lines(6.0);
        assert_eq!(lines.len(), 1);
        assert_eq!(lines[0].frequency_hz, 50.0);
        assert!((lines[0].rms - 0.5).abs() < 0.02);
    }

    #[test]
    fn the_uncertainty_of_a_mean_of_correlated_samples_is_the_closed_form() {
        // AR(1) with coefficient 0.9: tau = (1 + 0.9) / (1 - 0.9) = 19.
        let z = white(400_000, 1.0, 3);
        let mut x = 0.0;
        let series: Vec<f64> = z
            .iter()
            .map(|z| {
                x = 0.9 * x + z;
                x
            })
            .collect();
        assert!((integrated_autocorrelation_time(&series) / 19.0 - 1.0).abs() < 0.1);
        let (_, u) = mean_with_uncertainty(&series);
        let expected = (1.0 / (1.0 - 0.81) * 19.0 / 400_000.0f64).sqrt();
        assert!((u / expected - 1.0).abs() < 0.06);
    }

    #[test]
    fn equal_samples_follow_the_closed_form_over_all_roundings() {
        for (sd, seed) in [(0.3, 4), (1.0, 5), (5.0, 6)] {
            // A slow ramp moves the mean over all places between two counts.
            let counts: Vec<i64> = white(200_000, sd, seed)
                .iter()
                .enumerate()
                .map(|(i, x)| (x + i as f64 * 1e-3).round() as i64)
                .collect();
            let seen = EqualSamples::of(&counts).unwrap();
            let expected = probability_of_equal_samples(sd, 1.0);
            assert!(
                (seen.share - expected).abs() < 4.0 * (expected / 200_000.0f64).sqrt(),
                "{sd}: {seen:?} {expected}"
            );
        }
        assert_eq!(quantum(&[3, 9, -3, 15]), Some(6));
        assert_eq!(quantum(&[3, 3]), None);
    }

    #[test]
    fn a_silent_channel_has_no_frozen_rule() {
        assert_eq!(EqualSamples::of(&[7; 1000]).unwrap().frozen_after(1e-9), None);
        let counts: Vec<i64> = white(5_000, 3.0, 7).iter().map(|x| x.round() as i64).collect();
        let n = EqualSamples::of(&counts).unwrap().frozen_after(1e-9).unwrap();
        assert!((8..=20).contains(&n), "{n}");
    }
}
