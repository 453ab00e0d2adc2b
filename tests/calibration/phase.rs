//! Phase: a non-linear oscillator in the time domain behind two vibrometers with withheld delay errors.

use crate::bench::{Coverage, seed, trials};
use calibration::amplitude::vibrometer::Decoder;
use calibration::phase::{Shift, Waveforms, repeated, shift};
use calibration::uncertainty::student::coverage_factor;
use sim::noise::Noise;
use std::f64::consts::PI;

const F: f64 = 27_500.0;
const RATE: f64 = 1e6;
/// Scatter from repeat to repeat in degrees: the finger is never put on twice alike.
const REPEAT_SD_DEG: f64 = 3.0;
/// Integration steps a sample.
const FINE: usize = 20;

/// Skin as a hardening oscillator on a moving base: `x'' = -2 z w (x' - y') - w^2 (u + b u^3)`, `u = x - y`.
/// Returns plate and skin velocity at the sample rate and the true phase shift in degrees.
fn skin(
    draw: &mut Noise,
    natural_hz: f64,
    zeta: f64,
    bend: f64,
    samples: usize,
) -> (Vec<f64>, Vec<f64>, f64) {
    let (w0, omega, a) = (2.0 * PI * natural_hz, 2.0 * PI * F, 1e-6);
    let dt = 1.0 / RATE / FINE as f64;
    let start = draw.uniform() / F;
    let base = |t: f64| {
        let (s, c) = (omega * (t + start)).sin_cos();
        (a * s, a * omega * c, -a * omega * omega * s)
    };
    let acceleration = |t: f64, x: f64, v: f64| {
        let (y, vy, _) = base(t);
        let u = x - y;
        -2.0 * zeta * w0 * (v - vy) - w0 * w0 * (u + bend * u * (u / a).powi(2))
    };
    let (mut x, mut v) = (base(0.0).0, base(0.0).1);
    let settle = (60.0 * RATE / F) as usize * FINE;
    let (mut plate, mut skin) = (Vec::new(), Vec::new());
    let mut peaks = [(f64::MIN, 0.0); 2];
    let period = 1.0 / F;
    for i in 0..settle + samples * FINE {
        let t = i as f64 * dt;
        if i >= settle && (i - settle).is_multiple_of(FINE) {
            plate.push(base(t).1);
            skin.push(v);
        }
        // The true instants of the largest accelerations within the first recorded period.
        if i >= settle && (i - settle) as f64 * dt < period {
            for (peak, value) in peaks.iter_mut().zip([base(t).2, acceleration(t, x, v)]) {
                if value > peak.0 {
                    *peak = (value, t);
                }
            }
        }
        // Runge-Kutta of the fourth order.
        let k1 = (v, acceleration(t, x, v));
        let k2 = (v + 0.5 * dt * k1.1, acceleration(t + 0.5 * dt, x + 0.5 * dt * k1.0, v + 0.5 * dt * k1.1));
        let k3 = (v + 0.5 * dt * k2.1, acceleration(t + 0.5 * dt, x + 0.5 * dt * k2.0, v + 0.5 * dt * k2.1));
        let k4 = (v + dt * k3.1, acceleration(t + dt, x + dt * k3.0, v + dt * k3.1));
        x += dt / 6.0 * (k1.0 + 2.0 * k2.0 + 2.0 * k3.0 + k4.0);
        v += dt / 6.0 * (k1.1 + 2.0 * k2.1 + 2.0 * k3.1 + k4.1);
    }
    (plate, skin, (360.0 * F * (peaks[1].1 - peaks[0].1)).rem_euclid(360.0))
}

/// The lines of a periodic record: number, cosine and sine part.
fn lines(samples: &[f64]) -> Vec<(f64, f64, f64)> {
    let n = samples.len();
    (0..n / 2)
        .map(|k| {
            let w = 2.0 * PI * k as f64 / n as f64;
            let part = |f: fn(f64) -> f64| {
                samples.iter().enumerate().map(|(i, s)| s * f(w * i as f64)).sum::<f64>() * 2.0 / n as f64
            };
            let half = if k == 0 { 0.5 } else { 1.0 };
            (k as f64, half * part(f64::cos), half * part(f64::sin))
        })
        .filter(|(_, re, im)| re.hypot(*im) > 1e-6)
        .collect()
}

/// The record one delay later, exactly: each of its lines turned by its own phase.
fn delayed(lines: &[(f64, f64, f64)], n: usize, delay_s: f64) -> Vec<f64> {
    let at = |i: usize| {
        let t = i as f64 - delay_s * RATE;
        lines.iter().map(move |(k, re, im)| {
            let (s, c) = (2.0 * PI * k / n as f64 * t).sin_cos();
            re * c + im * s
        })
    };
    (0..n).map(|i| at(i).sum()).collect()
}

#[test]
fn phase_shifts_over_ten_repeats_are_covered_as_stated() {
    let mut covered = Coverage::default();
    let delay_sd = 0.1e-6;
    for trial in 0..trials() {
        let mut draw = Noise::new(seed(trial), "phase bench");
        let (natural, zeta, bend) =
            (draw.between(25e3, 60e3), draw.between(0.2, 0.5), draw.between(0.0, 0.15));
        // 400 samples at 1 MHz are 11 whole periods of 27.5 kHz.
        let (plate, moved, truth) = skin(&mut draw, natural, zeta, bend, 400);
        let stated = Decoder { name: "VD-02".into(), range_m_s_per_v: 0.125, delay_s: 8.16e-6 };
        let error = delay_sd * draw.normal();
        let (plate_lines, skin_lines) = (lines(&plate), lines(&moved));
        let late_plate = delayed(&plate_lines, plate.len(), stated.delay_s);
        let shifts: Vec<Shift> = (0..10)
            .map(|_| {
                let wobble = REPEAT_SD_DEG / 360.0 / F * draw.normal();
                let late_skin = delayed(&skin_lines, moved.len(), stated.delay_s + error + wobble);
                let mut volts = |v: &[f64]| -> Vec<f64> {
                    v.iter().map(|v| (v + 2e-3 * draw.normal()) / stated.range_m_s_per_v).collect()
                };
                let (plate_v, skin_v) = (volts(&late_plate), volts(&late_skin));
                let w = Waveforms {
                    plate_v: &plate_v,
                    skin_v: &skin_v,
                    rate_hz: RATE,
                    frequency_hz: F,
                    plate: &stated,
                    skin: &stated,
                };
                shift(&w).unwrap()
            })
            .collect();
        let repeats = repeated(&shifts, F, delay_sd).unwrap();
        let found = &repeats.phase_deg;
        let half = coverage_factor(0.95, found.degrees_of_freedom) * found.standard_uncertainty;
        let off = (found.value - truth + 180.0).rem_euclid(360.0) - 180.0;
        // Of ten Gaussian repeats; what the delays share is no statistics.
        let bound = REPEAT_SD_DEG / 10f64.sqrt();
        let statistical = coverage_factor(0.95, 9.0) * repeats.repeat_sd_deg / 10f64.sqrt();
        covered.add_with_bound([off - half, off + half], 0.0, statistical, bound);
    }
    covered.judge("phase shift");
}
