//! Transfer function and coherence of two series by Welch's method, with intervals.
//!
//! P. D. Welch, IEEE Trans. Audio Electroacoust. 15 (1967) 70: averaged periodograms of overlapping
//! segments. J. S. Bendat and A. G. Piersol, 'Random Data', 4th ed. (2010), Eq. 9.90: the relative standard
//! deviation of `|H|` from `n` averages is `sqrt((1 - g2) / (2 n g2))`, with `g2` the coherence.

use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// The transfer function at one frequency.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bin {
    /// Temporal frequency in Hz.
    pub hz: f64,
    /// Spatial frequency in 1/m: the temporal one over the speed.
    pub per_m: f64,
    /// `|H|`.
    pub gain: f64,
    /// Its standard deviation.
    pub gain_sd: f64,
    /// Phase of `H` in rad; negative: the measurement comes later.
    pub phase_rad: f64,
    /// Coherence `g2`, 0 to 1.
    pub coherence: f64,
}

/// A frequency at -3 dB.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Corner {
    /// Frequency in Hz.
    pub hz: f64,
    /// Its standard deviation in Hz.
    pub sd_hz: f64,
}

/// Averaged spectra of segments of equal length.
pub(super) struct Spectra {
    length: usize,
    cycle_s: f64,
    window: Vec<f64>,
    /// Power of both, real and imaginary part of the cross spectrum, from frequency one on.
    sums: Vec<[f64; 4]>,
    segments: f64,
    late: usize,
}

/// Segments of a pass at least: of a target of a few lines, and of a broad one, whose neighbouring lines must
/// not hold their phases from segment to segment. As many bins make a target broad.
pub(super) const SEGMENTS: [usize; 2] = [3, 15];
pub(super) const BROAD: usize = 24;
/// Samples of a segment at least and at most.
const LENGTHS: [usize; 2] = [32, 1024];
/// What neighbours share of a segment's information with Hann's window and half an overlap: their squared
/// correlation, twice.
const OVERLAP: f64 = 2.0 / 36.0;
/// Share of the greatest power that the wanted series must have at a frequency.
const POWER_SHARE: f64 = 2e-3;
/// Least coherence of a frequency that is shown.
const COHERENCE: f64 = 0.1;

impl Spectra {
    /// For passes of these lengths: the longest segment that the shortest pass holds three times, half
    /// overlapped.
    pub fn for_passes(lengths: impl Iterator<Item = usize>, segments: usize, cycle_s: f64) -> Self {
        let shortest = lengths.min().unwrap_or(0);
        let fits = 2 * shortest / (segments + 1);
        let length = fits.clamp(LENGTHS[0], LENGTHS[1]) & !1;
        // Hann's window.
        let window = (0..length).map(|i| 0.5 - 0.5 * (TAU * i as f64 / length as f64).cos()).collect();
        Spectra { length, cycle_s, window, sums: vec![[0.0; 4]; length / 2 - 1], segments: 0.0, late: 0 }
    }

    /// Takes the two series of a pass. The measured one comes `late` samples later: they are aligned first,
    /// since a delay within a segment pulls the gain between neighbouring lines (Bendat and Piersol, section
    /// 9.3.2); the phase has the delay.
    pub fn add(&mut self, wanted: &[f64], measured: &[f64], late: usize) {
        let n = self.length;
        self.late = late;
        let late = late.min(wanted.len());
        let (wanted, measured) = (&wanted[..wanted.len() - late], &measured[late..]);
        let turns: Vec<(f64, f64)> = (0..n).map(|i| (TAU * i as f64 / n as f64).sin_cos()).collect();
        let ready = |series: &[f64]| -> Vec<f64> {
            let mean = series.iter().sum::<f64>() / n as f64;
            series.iter().zip(&self.window).map(|(v, w)| (v - mean) * w).collect()
        };
        let mut start = 0;
        while start + n <= wanted.len() {
            let [x, y] = [wanted, measured].map(|series| ready(&series[start..start + n]));
            for (k, sums) in (1..n / 2).zip(&mut self.sums) {
                let mut s = [0.0; 4];
                for i in 0..n {
                    let (sin, cos) = turns[k * i % n];
                    s = [s[0] + x[i] * cos, s[1] - x[i] * sin, s[2] + y[i] * cos, s[3] - y[i] * sin];
                }
                let [a, b, c, d] = s;
                // Conjugate of the wanted times the measured.
                let now = [a * a + b * b, c * c + d * d, a * c + b * d, a * d - b * c];
                sums.iter_mut().zip(now).for_each(|(sum, v)| *sum += v);
            }
            self.segments += 1.0;
            start += n / 2;
        }
    }

    /// The transfer function at the frequencies that the wanted series holds.
    pub fn bins(&self, speed_m_s: f64) -> Vec<Bin> {
        let most = self.sums.iter().map(|s| s[0]).fold(0.0, f64::max);
        let averages = self.segments / (1.0 + OVERLAP);
        let bin = |(i, [xx, yy, re, im]): (usize, &[f64; 4])| {
            let hz = (i + 1) as f64 / (self.length as f64 * self.cycle_s);
            let gain = re.hypot(*im) / xx;
            let coherence = (re * re + im * im) / (xx * yy);
            let gain_sd = gain * ((1.0 - coherence).max(0.0) / (2.0 * averages * coherence)).sqrt();
            let delay = TAU * hz * self.late as f64 * self.cycle_s;
            let phase_rad = im.atan2(*re) - delay;
            Bin { hz, per_m: hz / speed_m_s, gain, gain_sd, phase_rad, coherence }
        };
        let loud = |(_, s): &(usize, &[f64; 4])| s[0] > POWER_SHARE * most && s[1] > 0.0;
        self.sums.iter().enumerate().filter(loud).map(bin).filter(|b| b.coherence > COHERENCE).collect()
    }
}

/// Bins up to this multiple of the crossing are fitted, and so many at least.
const BEYOND: f64 = 1.6;
const BINS: usize = 6;

/// Where the gain has fallen to 0.707 of its value at rest. The inverse power gain of a low pass without zeros
/// is an even polynomial of the frequency: `1/|H|^2 = a (1 + b f^2 + c f^4)` is fitted to the bins, weighted by
/// their intervals. None where the bins end below the crossing. The deviation is that of the scatter about it.
pub(super) fn minus_3_db(bins: &[Bin]) -> Option<Corner> {
    let mut end = bins.last()?.hz;
    let mut found = None;
    for _ in 0..20 {
        let used: Vec<&Bin> = bins.iter().filter(|b| b.hz <= end).collect();
        let corner = (used.len() >= BINS).then(|| fitted(&used)).flatten()?;
        found = Some(corner);
        let next = BEYOND * corner.hz;
        if (next / end - 1.0).abs() < 0.01 || next > bins.last()?.hz && end == bins.last()?.hz {
            break;
        }
        end = next.min(bins.last()?.hz);
    }
    found.filter(|corner| corner.hz < bins.last().map_or(0.0, |b| b.hz))
}

fn fitted(bins: &[&Bin]) -> Option<Corner> {
    let scale = bins.last()?.hz.powi(2);
    let row = |b: &&Bin| {
        let (u, y) = (b.hz.powi(2) / scale, b.gain.powi(-2));
        let sd = 2.0 * (b.gain_sd / b.gain).max(1e-4) * y;
        ([1.0, u, u * u], y, sd.powi(-2))
    };
    let rows: Vec<([f64; 3], f64, f64)> = bins.iter().map(row).collect();
    let (mut m, mut r) = ([[0.0; 3]; 3], [0.0; 3]);
    for (x, y, w) in &rows {
        for i in 0..3 {
            r[i] += w * x[i] * y;
            (0..3).for_each(|k| m[i][k] += w * x[i] * x[k]);
        }
    }
    let det = |m: &[[f64; 3]; 3]| -> f64 {
        let minor = |a: usize, b: usize| m[1][a] * m[2][b] - m[1][b] * m[2][a];
        m[0][0] * minor(1, 2) - m[0][1] * minor(0, 2) + m[0][2] * minor(0, 1)
    };
    let whole = det(&m);
    let with = |k: usize, r: [f64; 3]| {
        let mut n = m;
        (0..3).for_each(|i| n[i][k] = r[i]);
        det(&n) / whole
    };
    let crossing = |[a, b, c]: [f64; 3]| {
        // a + b u + c u^2 = 2 a.
        let root = (b * b + 4.0 * a * c).sqrt();
        (2.0 * a / (b + root) * scale).sqrt()
    };
    let solve = |r: [f64; 3]| [with(0, r), with(1, r), with(2, r)];
    let best = solve(r);
    let off =
        |(x, y, w): &([f64; 3], f64, f64)| w * (y - (0..3).map(|i| best[i] * x[i]).sum::<f64>()).powi(2);
    let scatter = rows.iter().map(off).sum::<f64>() / rows.len().saturating_sub(3).max(1) as f64;
    // To first order in each bin, with the scatter found.
    let pulled = |(x, _, w): &([f64; 3], f64, f64)| {
        let step = 1e-3 * w.sqrt();
        let change = solve([0, 1, 2].map(|i| r[i] + step * x[i]));
        ((crossing(change) - crossing(best)) / 1e-3).powi(2)
    };
    let hz = crossing(best);
    let sd_hz = (scatter * rows.iter().map(pulled).sum::<f64>()).sqrt();
    (hz.is_finite() && sd_hz.is_finite()).then_some(Corner { hz, sd_hz })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// White noise through the exact first-order low pass `y' = (x - y)/tau` ends at `1/(2 pi tau)`.
    #[test]
    fn a_first_order_low_pass_ends_where_its_closed_form_does() {
        let (tau, cycle): (f64, f64) = (4e-3, 1e-3);
        let decay = (-cycle / tau).exp();
        let mut state = 12345u64;
        let mut noise = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        };
        let mut spectra = Spectra::for_passes([1000].into_iter(), SEGMENTS[0], cycle);
        for _ in 0..40 {
            let x: Vec<f64> = (0..1000).map(|_| noise()).collect();
            let mut y = 0.0;
            let series: Vec<f64> = x
                .iter()
                .map(|x| {
                    y = x + (y - x) * decay;
                    y + 0.02 * noise()
                })
                .collect();
            spectra.add(&x, &series, 0);
        }
        let bins = spectra.bins(0.02);
        // Of the held series: |H| = (1 - d) / |1 - d exp(-i omega T)|.
        for b in &bins {
            let exact =
                (1.0 - decay) / (1.0 + decay * decay - 2.0 * decay * (TAU * b.hz * cycle).cos()).sqrt();
            assert!((b.gain - exact).abs() < 5.0 * b.gain_sd + 0.02, "{b:?} {exact}");
        }
        let found = minus_3_db(&bins).expect("it ends");
        let exact = 1.0 / (TAU * tau);
        assert!((found.hz / exact - 1.0).abs() < 0.03, "{found:?} {exact}");
    }
}
