//! Designs of sealed data sets: which passes were made. They differ as laboratories' sweeps do.

use crate::noise::Noise;
use models::{Condition, Direction, PeakToPeak};
use serde::{Deserialize, Serialize};

/// The plan of a set, in words that its label can hold.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Design {
    /// Frequencies (Hz).
    pub frequencies_hz: Vec<f64>,
    /// Amplitudes, peak-to-peak (m), without the zero of the references.
    pub amplitudes_pp_m: Vec<f64>,
    /// Speeds (m/s).
    pub speeds_m_s: Vec<f64>,
    /// Normal forces (N).
    pub normal_forces_n: Vec<f64>,
    /// Ambient pressures (Pa); empty: not measured, one atmosphere.
    pub pressures_pa: Vec<f64>,
    /// Half of the stretch of positions used (m).
    pub reach_m: f64,
    /// A reference without vibration after so many passes.
    pub reference_every: usize,
    /// How often a condition is made, on average.
    pub replicates: f64,
    /// Passes in all, about.
    pub passes: usize,
    /// Runs; the finger is lifted and put on anew between them.
    pub runs: usize,
    /// Time from pass to pass (s).
    pub pace_s: f64,
}

/// One pass of the plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Planned {
    /// Its condition; `mu0` is left at 0.5 and means nothing.
    pub condition: Condition,
    /// Which repeat of its condition.
    pub replicate: u64,
    /// Which run.
    pub run: usize,
}

/// So many levels between two bounds, evenly in the logarithm, each a little off.
fn levels(noise: &mut Noise, n: usize, low: f64, high: f64) -> Vec<f64> {
    (0..n)
        .map(|i| {
            let share = if n == 1 { 0.5 } else { i as f64 / (n - 1) as f64 };
            let value = low * (high / low).powf(share) * (1.0 + 0.05 * (noise.uniform() - 0.5));
            let digits = 10_f64.powf(2.0 - value.log10().floor());
            (value * digits).round() / digits
        })
        .collect()
}

impl Design {
    /// A design of a seed.
    pub fn draw(noise: &mut Noise) -> Self {
        let sparse = noise.chance(0.3);
        let one_frequency = noise.chance(0.35);
        let frequencies_hz = match (one_frequency, noise.below(3)) {
            (true, 0) => vec![27_500.0],
            (true, _) => vec![(noise.between(24.0, 45.0) * 10.0).round() * 100.0],
            (false, 0) => vec![25_000.0, 40_000.0],
            (false, 1) => vec![27_500.0, 35_000.0, 55_000.0],
            (false, _) => vec![22_000.0, 33_000.0],
        };
        let pressures_pa = match noise.below(4) {
            0 => vec![101_325.0, 20_000.0],
            1 => vec![101_325.0],
            _ => Vec::new(),
        };
        let n = |few: usize, many: usize| if sparse { few } else { many };
        let (slow, fast) = (noise.between(4e-3, 1e-2), noise.between(0.1, 0.2));
        let (light, heavy) = (noise.between(0.1, 0.18), noise.between(0.5, 0.9));
        let (small, large) = (noise.between(0.4e-6, 0.8e-6), noise.between(3.5e-6, 5e-6));
        let pressures = pressures_pa.len();
        Self {
            amplitudes_pp_m: levels(noise, n(4, 6), small, large),
            speeds_m_s: levels(noise, n(3, 5), slow, fast),
            normal_forces_n: levels(noise, n(2, 4), light, heavy),
            frequencies_hz,
            pressures_pa,
            reach_m: if noise.chance(0.6) { 0.02 } else { 0.002 },
            reference_every: 5 + noise.below(4),
            replicates: if noise.chance(0.15) { 1.0 } else { noise.between(1.2, 2.0) },
            passes: if sparse { 70 + noise.below(50) } else { 160 + noise.below(180) },
            runs: (1 + noise.below(4)).max(pressures),
            pace_s: noise.between(3.0, 7.0),
        }
    }

    fn condition(&self, noise: &mut Noise, still: bool) -> Condition {
        let pick = |from: &[f64], noise: &mut Noise| from[noise.below(from.len())];
        Condition {
            amplitude: PeakToPeak::from_metres(if still { 0.0 } else { pick(&self.amplitudes_pp_m, noise) }),
            frequency_hz: pick(&self.frequencies_hz, noise),
            speed_m_s: pick(&self.speeds_m_s, noise),
            direction: if noise.chance(0.5) { Direction::Forward } else { Direction::Backward },
            normal_force_n: pick(&self.normal_forces_n, noise),
            position_m: (noise.between(-self.reach_m, self.reach_m) * 1e5).round() * 1e-5,
            ambient_pressure_pa: (!self.pressures_pa.is_empty()).then(|| pick(&self.pressures_pa, noise)),
            ..Condition::paper()
        }
    }

    /// The passes, in the order in which they are made. The pressure changes only between runs.
    pub fn plan(&self, noise: &mut Noise) -> Vec<Planned> {
        let mut open: Vec<(Condition, u64)> = Vec::new();
        while open.len() < self.passes {
            let condition = self.condition(noise, false);
            let repeats = 1 + u64::from(noise.chance(self.replicates - 1.0)) * (1 + noise.below(2) as u64);
            open.extend((0..repeats).map(|i| (condition, i)));
        }
        for i in (1..open.len()).rev() {
            open.swap(i, noise.below(i + 1)); // Fisher-Yates: the order carries no condition
        }
        let per_run = open.len().div_ceil(self.runs);
        let mut out = Vec::with_capacity(open.len() * 5 / 4);
        for (run, chunk) in open.chunks(per_run).enumerate() {
            let mut time = noise.between(2.0, 10.0);
            let pressure =
                (!self.pressures_pa.is_empty()).then(|| self.pressures_pa[run % self.pressures_pa.len()]);
            let mut push = |mut condition: Condition, replicate: u64, time: &mut f64, noise: &mut Noise| {
                condition.time_s = (*time * 1e3).round() * 1e-3;
                condition.ambient_pressure_pa = pressure;
                *time += self.pace_s * noise.between(0.8, 1.3);
                out.push(Planned { condition, replicate, run });
            };
            for (i, (condition, replicate)) in chunk.iter().enumerate() {
                if i % self.reference_every == 0 {
                    let reference = self.condition(noise, true);
                    push(reference, 0, &mut time, noise);
                }
                push(*condition, *replicate, &mut time, noise);
            }
        }
        out
    }

    /// Hidden conditions: from the same space, but between the levels too, and at any time of the runs.
    pub fn hidden(&self, noise: &mut Noise, planned: &[Planned], n: usize) -> Vec<Planned> {
        let span = |from: &[f64], noise: &mut Noise| {
            let (low, high) = from.iter().fold((f64::MAX, 0.0_f64), |(l, h), x| (l.min(*x), h.max(*x)));
            if high > low { noise.log_between(low, high) } else { low }
        };
        (0..n)
            .map(|_| {
                let still = noise.chance(0.1);
                let mut condition = self.condition(noise, still);
                let near = &planned[noise.below(planned.len())];
                condition.time_s = near.condition.time_s;
                condition.ambient_pressure_pa = near.condition.ambient_pressure_pa;
                if condition.amplitude != PeakToPeak::ZERO {
                    condition.amplitude = PeakToPeak::from_metres(span(&self.amplitudes_pp_m, noise));
                }
                condition.speed_m_s = span(&self.speeds_m_s, noise);
                condition.normal_force_n = span(&self.normal_forces_n, noise);
                Planned { condition, replicate: 0, run: near.run }
            })
            .collect()
    }
}
