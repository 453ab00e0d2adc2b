//! From forces to friction: `mu`, `mu'` with uncertainty and age in every cycle, and means over a pass.
#![deny(clippy::disallowed_types, clippy::disallowed_methods)]

use crate::ports::{Nanos, Sample};
use models::Direction;
use serde::{Deserialize, Serialize};

/// Largest window of the running mean, in samples.
pub const WINDOW_MAX: usize = 256;

/// How the running estimate is made.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct EstimateConfig {
    /// Samples in the running mean, 1 to 256.
    pub window: usize,
    /// N. Below this normal force `mu'` is undefined: there is no finger, and noise must not be divided by noise.
    pub normal_force_min_n: f64,
    /// Standard deviation of one sample of either force in N, from the calibration.
    pub sample_sd_n: f64,
}

impl Default for EstimateConfig {
    fn default() -> Self {
        EstimateConfig { window: 50, normal_force_min_n: 0.02, sample_sd_n: 0.002 }
    }
}

/// Friction coefficient without vibration, as known at a time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mu0 {
    /// Value.
    pub value: f64,
    /// Standard uncertainty.
    pub sd: f64,
}

/// Relative friction as measured now.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MuRelative {
    /// `mu' = mu / mu_0`.
    pub value: f64,
    /// Standard uncertainty, that of `mu_0` included.
    pub sd: f64,
    /// Age of the older of the two newest samples in it.
    pub age: Nanos,
    /// Samples behind it.
    pub samples: u32,
}

/// Why there is no `mu'`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
#[serde(rename_all = "snake_case")]
pub enum NoMu {
    /// Not one usable sample since the condition changed.
    #[error("no usable sample since the condition changed")]
    NoSample,
    /// Normal force below the minimum.
    #[error("normal force below the minimum: no contact")]
    NoContact,
    /// `mu_0` is not known yet.
    #[error("mu0 is not known yet")]
    NoMu0,
}

/// Running means over a fixed window. `Copy`: no heap.
#[derive(Clone, Copy, Debug)]
pub struct Window {
    lateral: [f64; WINDOW_MAX],
    normal: [f64; WINDOW_MAX],
    next: usize,
    filled: usize,
    lateral_sequence: Option<u32>,
}

impl Default for Window {
    fn default() -> Self {
        let none = [0.0; WINDOW_MAX];
        Window { lateral: none, normal: none, next: 0, filled: 0, lateral_sequence: None }
    }
}

impl Window {
    /// Forgets all samples: the condition has changed.
    pub fn clear(&mut self) {
        (self.next, self.filled) = (0, 0);
    }

    /// Takes a pair of samples, unless the lateral one was seen before.
    pub fn push(&mut self, config: &EstimateConfig, lateral: &Sample, normal: &Sample) {
        if self.lateral_sequence == Some(lateral.sequence) {
            return;
        }
        self.lateral_sequence = Some(lateral.sequence);
        let window = config.window.clamp(1, WINDOW_MAX);
        self.next %= window;
        self.lateral[self.next] = lateral.value;
        self.normal[self.next] = normal.value;
        self.next = (self.next + 1) % window;
        self.filled = (self.filled + 1).min(window);
    }

    /// Mean lateral and normal force over the window in N, and the number of samples.
    pub fn means(&self) -> Option<(f64, f64, usize)> {
        if self.filled == 0 {
            return None;
        }
        let n = self.filled as f64;
        let mean = |values: &[f64]| values.iter().sum::<f64>() / n;
        Some((mean(&self.lateral[..self.filled]), mean(&self.normal[..self.filled]), self.filled))
    }

    /// The running `mu'`.
    ///
    /// # Errors
    /// Why there is none.
    pub fn mu_relative(
        &self,
        config: &EstimateConfig,
        direction: Direction,
        mu0: Option<Mu0>,
        age: Nanos,
    ) -> Result<MuRelative, NoMu> {
        let (lateral, normal, samples) = self.means().ok_or(NoMu::NoSample)?;
        if normal.is_nan() || normal < config.normal_force_min_n {
            return Err(NoMu::NoContact);
        }
        let mu0 = mu0.ok_or(NoMu::NoMu0)?;
        let mu = direction.sign() * lateral / normal;
        // d mu = dL/F - mu dF/F, both means of `samples` samples.
        let mu_sd = config.sample_sd_n / normal * ((1.0 + mu * mu) / samples as f64).sqrt();
        let value = mu / mu0.value;
        let sd = (mu_sd / mu0.value).hypot(value * mu0.sd / mu0.value);
        Ok(MuRelative { value, sd, age, samples: samples as u32 })
    }
}

/// Mean, standard deviation and autocorrelation of one channel over a pass (Welford's recursion).
#[derive(Clone, Copy, Debug, Default)]
pub struct Moments {
    n: u64,
    mean: f64,
    sum_squares: f64,
    products: f64,
    last: Option<f64>,
}

impl Moments {
    /// Takes a sample.
    pub fn push(&mut self, value: f64) {
        self.n += 1;
        let before = value - self.mean;
        self.mean += before / self.n as f64;
        let after = value - self.mean;
        self.sum_squares += before * after;
        if let Some(last) = self.last {
            self.products += after * (last - self.mean);
        }
        self.last = Some(value);
    }

    /// Number of samples.
    pub const fn count(&self) -> u64 {
        self.n
    }

    /// Mean; `None` without samples.
    pub fn mean(&self) -> Option<f64> {
        (self.n > 0).then_some(self.mean)
    }

    /// Standard deviation of the samples; `None` with fewer than two.
    pub fn sd(&self) -> Option<f64> {
        (self.n > 1).then(|| (self.sum_squares / (self.n - 1) as f64).max(0.0).sqrt())
    }
}
