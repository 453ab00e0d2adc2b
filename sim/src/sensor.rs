//! The two-axis force sensor: cross-talk, bandwidth, noise, wander, gain, quantisation, latency, saturation,
//! a sample counter and a clock of its own.

use crate::noise::{Noise, Wander};
use realtime::Nanos;
use serde::{Deserialize, Serialize};

/// What the sensor is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SensorConfig {
    /// Time between two samples (s).
    pub sample_period_s: f64,
    /// Time from a sample's instant to its delivery (s); at most 1 s.
    pub latency_s: f64,
    /// How much of that the stamps of its samples leave out (s): forces that arrive later than they are
    /// stamped.
    pub unstated_latency_s: f64,
    /// -3 dB bandwidth of its second-order Bessel-like filter (Hz).
    pub bandwidth_hz: f64,
    /// White noise of a sample, lateral and normal (N).
    pub white_sd_n: [f64; 2],
    /// Slow wander of the zero, lateral and normal (N).
    pub wander_sd_n: [f64; 2],
    /// Correlation time of the wander (s).
    pub wander_time_s: f64,
    /// Gain error, lateral and normal: 1 is right.
    pub gain: [f64; 2],
    /// Lateral reading a newton of normal force, and normal reading a newton of lateral force (-).
    pub cross_talk: [f64; 2],
    /// Force of one count (N).
    pub count_n: f64,
    /// Full scale, both axes (N): beyond it the counts stand still and the sample says so.
    pub full_scale_n: f64,
    /// Relative error of its clock (-).
    pub clock_drift: f64,
}

impl Default for SensorConfig {
    fn default() -> Self {
        Self {
            sample_period_s: 5e-4,
            latency_s: 5e-4,
            unstated_latency_s: 0.0,
            bandwidth_hz: 200.0,
            white_sd_n: [2e-3, 2e-3],
            // Shorter than the time between passes: what rig.toml states of a pass's mean is independent from
            // pass to pass. A zero that wanders over many passes is a defect, `lateral_offset_drift`.
            wander_sd_n: [1.05e-3, 1.05e-3],
            wander_time_s: 0.1,
            gain: [1.0, 1.0],
            cross_talk: [0.0, 0.0],
            count_n: 1e-4,
            full_scale_n: 3.0,
            clock_drift: 2e-5,
        }
    }
}

/// One sample of both axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceSample {
    /// Lateral, normal force in counts.
    pub counts: [i32; 2],
    /// Lateral, normal force (N): counts times the count.
    pub force_n: [f64; 2],
    /// Which axis is at the end of its range.
    pub saturated: [bool; 2],
    /// Sample counter; wraps.
    pub sequence: u32,
    /// The sensor's own clock (ns).
    pub device_time: Nanos,
    /// When the sample was taken, in the world's time.
    pub taken_at: Nanos,
}

/// A second-order low-pass, stepped exactly enough: bilinear with pre-warping, unit gain at rest.
#[derive(Clone, Copy, Debug, Default)]
struct LowPass {
    b: [f64; 3],
    a: [f64; 2],
    z: [f64; 2],
    through: bool,
}

impl LowPass {
    fn new(bandwidth_hz: f64, dt: f64) -> Self {
        if bandwidth_hz >= 0.45 / dt {
            return Self { through: true, ..Self::default() }; // no sample could show it
        }
        let k = (std::f64::consts::PI * bandwidth_hz * dt).tan();
        let q = std::f64::consts::FRAC_1_SQRT_2;
        let norm = 1.0 / (1.0 + k / q + k * k);
        let b0 = k * k * norm;
        Self {
            b: [b0, 2.0 * b0, b0],
            a: [2.0 * (k * k - 1.0) * norm, (1.0 - k / q + k * k) * norm],
            ..Self::default()
        }
    }

    fn step(&mut self, x: f64) -> f64 {
        if self.through {
            return x;
        }
        let y = self.b[0] * x + self.z[0];
        self.z[0] = self.b[1] * x - self.a[0] * y + self.z[1];
        self.z[1] = self.b[2] * x - self.a[1] * y;
        y
    }
}

/// The sensor's state.
#[derive(Clone, Debug)]
pub struct Sensor {
    config: SensorConfig,
    filter: [LowPass; 2],
    wander: [Wander; 2],
    noise: Noise,
    sequence: u32,
}

impl Sensor {
    /// A sensor stepped every `tick_s` seconds.
    pub fn new(config: SensorConfig, tick_s: f64, seed: u64) -> Self {
        let mut noise = Noise::new(seed, "sensor");
        let filter = [LowPass::new(config.bandwidth_hz, tick_s); 2];
        let wander = config.wander_sd_n.map(|sd| Wander::new(sd, config.wander_time_s, &mut noise));
        Self { config, filter, wander, noise, sequence: 0 }
    }

    /// Takes in the true forces (N) of one tick; returns what the filter shows.
    pub fn feel(&mut self, lateral_n: f64, normal_n: f64) -> [f64; 2] {
        let [xz, zx] = self.config.cross_talk;
        let felt = [lateral_n + xz * normal_n, normal_n + zx * lateral_n];
        [self.filter[0].step(felt[0]), self.filter[1].step(felt[1])]
    }

    /// Moves its slow wander on by one sample and makes the sample of what [`Sensor::feel`] showed.
    pub fn sample(&mut self, shown: [f64; 2], now: Nanos) -> ForceSample {
        let c = self.config;
        let mut counts = [0; 2];
        let mut saturated = [false; 2];
        for axis in 0..2 {
            let drift = self.wander[axis].step(c.sample_period_s, &mut self.noise);
            let value = c.gain[axis] * shown[axis] + drift + c.white_sd_n[axis] * self.noise.normal();
            let limit = c.full_scale_n / c.count_n;
            let exact = (value / c.count_n).round();
            saturated[axis] = exact.abs() >= limit;
            counts[axis] = exact.clamp(-limit, limit) as i32;
        }
        self.sequence = self.sequence.wrapping_add(1);
        ForceSample {
            counts,
            force_n: counts.map(|n| f64::from(n) * c.count_n),
            saturated,
            sequence: self.sequence,
            device_time: Nanos(now.0.saturating_add_signed((now.0 as f64 * c.clock_drift).round() as i64)),
            taken_at: now,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quiet() -> SensorConfig {
        SensorConfig { white_sd_n: [0.0; 2], wander_sd_n: [0.0; 2], ..SensorConfig::default() }
    }

    #[test]
    fn a_force_is_rounded_to_counts_and_stops_at_the_full_scale() {
        let mut sensor = Sensor::new(quiet(), 5e-4, 1);
        let sample = sensor.sample([0.123_456, -5.0], Nanos(0));
        assert_eq!(sample.counts, [1235, -30_000]);
        assert_eq!(sample.saturated, [false, true]);
    }

    #[test]
    fn the_bandwidth_is_where_the_amplitude_is_down_by_the_square_root_of_two() {
        let tick = 1e-4;
        let mut sensor = Sensor::new(SensorConfig { bandwidth_hz: 200.0, ..quiet() }, tick, 1);
        let (mut peak, n) = (0.0_f64, 20_000);
        for i in 0..n {
            let shown = sensor.feel((2.0 * std::f64::consts::PI * 200.0 * i as f64 * tick).sin(), 0.0);
            if i > n / 2 {
                peak = peak.max(shown[0]);
            }
        }
        assert!((peak - 0.5_f64.sqrt()).abs() < 0.01, "{peak}");
    }

    #[test]
    fn cross_talk_gain_and_constant_forces() {
        let config = SensorConfig { cross_talk: [0.1, 0.0], gain: [2.0, 1.0], ..quiet() };
        let mut sensor = Sensor::new(config, 5e-4, 1);
        let mut shown = [0.0; 2];
        for _ in 0..1000 {
            shown = sensor.feel(0.2, 1.0);
        }
        let sample = sensor.sample(shown, Nanos(0));
        assert!(
            (sample.force_n[0] - 0.6).abs() < 1e-9 && (sample.force_n[1] - 1.0).abs() < 1e-9,
            "{sample:?}"
        );
    }

    #[test]
    fn its_clock_runs_at_its_own_rate() {
        let mut sensor = Sensor::new(SensorConfig { clock_drift: 1e-3, ..quiet() }, 5e-4, 1);
        let sample = sensor.sample([0.0; 2], Nanos(1_000_000_000));
        assert_eq!(sample.device_time, Nanos(1_001_000_000));
    }
}
