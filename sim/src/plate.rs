//! The plate: a resonator whose amplitude follows its drive with a time constant of `Q / (pi f)`.
//!
//! The envelope is a complex number in the frame that turns with the drive: `A' = (i d - 1/tau) A + A_0/tau`,
//! with `d` the detuning in rad/s. So `|A|` settles at `A_0 / sqrt(1 + (d tau)^2)`, rings up and down with
//! `tau`, and beats at the detuning on the way. Each step is exact for a drive that is constant over it.

use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// What the plate is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PlateConfig {
    /// Quality factor (-).
    pub quality_factor: f64,
    /// Resonance (Hz); 0: the bench tunes the plate to whatever frequency is set (a set of horns).
    pub resonance_hz: f64,
    /// Relative fall of the resonance a kelvin of warming (1/K).
    pub resonance_per_k: f64,
    /// Warming in the steady state at 1 um peak-to-peak and 27.5 kHz (K); grows as the square of both.
    pub warming_k: f64,
    /// Time constant of warming (s).
    pub warming_time_s: f64,
}

impl Default for PlateConfig {
    fn default() -> Self {
        Self {
            quality_factor: 150.0,
            resonance_hz: 0.0,
            resonance_per_k: 0.0,
            warming_k: 0.2,
            warming_time_s: 90.0,
        }
    }
}

/// The plate's state.
#[derive(Clone, Debug)]
pub struct Plate {
    config: PlateConfig,
    re: f64,
    im: f64,
    /// Warming above the room (K).
    pub warming_k: f64,
    map: Transition,
}

/// The envelope's transition over one step, remembered while nothing changes.
#[derive(Clone, Copy, Debug, Default)]
struct Transition {
    frequency_hz: f64,
    resonance_hz: f64,
    dt: f64,
    re: f64,
    im: f64,
    gain_re: f64,
    gain_im: f64,
    warming: f64,
}

impl Plate {
    /// A plate at rest, at the room's temperature.
    pub fn new(config: PlateConfig) -> Self {
        Self { config, re: 0.0, im: 0.0, warming_k: 0.0, map: Transition::default() }
    }

    /// Moves on by `dt` seconds under a drive that would settle at `drive_pp_m` at resonance.
    /// Returns the peak-to-peak amplitude (m).
    pub fn step(&mut self, drive_pp_m: f64, frequency_hz: f64, dt: f64) -> f64 {
        let nominal = if self.config.resonance_hz > 0.0 { self.config.resonance_hz } else { frequency_hz };
        let resonance = nominal * (1.0 - self.config.resonance_per_k * self.warming_k);
        let same = self.map.frequency_hz == frequency_hz
            && self.map.dt == dt
            && (self.map.resonance_hz - resonance).abs() < 1e-3;
        if !same {
            self.map = Self::transition(&self.config, frequency_hz, resonance, dt);
        }
        let m = &self.map;
        let (to_re, to_im) = (m.gain_re * drive_pp_m, m.gain_im * drive_pp_m);
        let (dre, dim) = (self.re - to_re, self.im - to_im);
        self.re = to_re + m.re * dre - m.im * dim;
        self.im = to_im + m.re * dim + m.im * dre;
        let pp = self.amplitude_pp_m();
        let power = (pp / 1e-6 * frequency_hz / 27_500.0).powi(2);
        self.warming_k += (self.config.warming_k * power - self.warming_k) * m.warming;
        pp
    }

    fn transition(config: &PlateConfig, frequency_hz: f64, resonance_hz: f64, dt: f64) -> Transition {
        let tau = config.quality_factor / (PI * resonance_hz);
        let detuning = 2.0 * PI * (frequency_hz - resonance_hz);
        let decay = (-dt / tau).exp();
        let (sin, cos) = (detuning * dt).sin_cos();
        let x = detuning * tau;
        let norm = 1.0 + x * x;
        Transition {
            frequency_hz,
            resonance_hz,
            dt,
            re: decay * cos,
            im: -decay * sin,
            gain_re: 1.0 / norm,
            gain_im: -x / norm,
            warming: 1.0 - (-dt / config.warming_time_s).exp(),
        }
    }

    /// Peak-to-peak amplitude (m).
    pub fn amplitude_pp_m(&self) -> f64 {
        // Far below a picometre nothing is left to feel; a true zero spares the contact its smallest numbers.
        let pp = self.re.hypot(self.im);
        if pp < 1e-13 { 0.0 } else { pp }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rings_up_and_down_with_q_over_pi_f() {
        let config = PlateConfig { quality_factor: 200.0, ..PlateConfig::default() };
        for dt in [1e-5, 5e-4] {
            let mut plate = Plate::new(config);
            let tau = 200.0 / (PI * 30_000.0); // 2.1 ms
            let steps = (tau / dt).round();
            for _ in 0..steps as usize {
                plate.step(2e-6, 30_000.0, dt);
            }
            let expected = 2e-6 * (1.0 - (-steps * dt / tau).exp());
            assert!((plate.amplitude_pp_m() / expected - 1.0).abs() < 1e-9);
            for _ in 0..(20.0 * steps) as usize {
                plate.step(2e-6, 30_000.0, dt);
            }
            for _ in 0..(3.0 * tau / dt).ceil() as usize {
                plate.step(0.0, 30_000.0, dt);
            }
            assert!(plate.amplitude_pp_m() < 0.051 * 2e-6, "under 5 % after three time constants");
        }
    }

    #[test]
    fn detuning_by_half_the_band_halves_the_power() {
        let config = PlateConfig { quality_factor: 100.0, resonance_hz: 27_500.0, ..PlateConfig::default() };
        let mut plate = Plate::new(config);
        for _ in 0..1000 {
            plate.step(1e-6, 27_500.0 + 137.5, 1e-4);
        }
        // f / (2 Q) = 137.5 Hz away: amplitude down by the square root of two.
        assert!((plate.amplitude_pp_m() * 1e6 - 0.5_f64.sqrt()).abs() < 3e-3, "{}", plate.amplitude_pp_m());
    }
}
