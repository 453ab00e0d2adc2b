//! Randomness of the world: every body draws from a stream of its own, named, so that a change in one body
//! leaves the others' draws where they were.

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// A named stream of random numbers.
#[derive(Clone, Debug)]
pub struct Noise(ChaCha8Rng);

impl Noise {
    /// The stream `name` of a world's seed.
    pub fn new(seed: u64, name: &str) -> Self {
        // FNV-1a of the name: stable across versions of Rust, unlike the standard library's hasher.
        let hash = name
            .bytes()
            .fold(0xcbf2_9ce4_8422_2325_u64, |h, b| (h ^ u64::from(b)).wrapping_mul(0x100_0000_01b3));
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(hash);
        Self(rng)
    }

    /// Standard normal.
    pub fn normal(&mut self) -> f64 {
        self.0.sample(StandardNormal)
    }

    /// Uniform in [0, 1).
    pub fn uniform(&mut self) -> f64 {
        self.0.random::<f64>()
    }

    /// Uniform between two bounds.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// Log-uniform between two positive bounds.
    pub fn log_between(&mut self, low: f64, high: f64) -> f64 {
        self.between(low.ln(), high.ln()).exp()
    }

    /// One of `n`, uniformly.
    pub fn below(&mut self, n: usize) -> usize {
        ((self.uniform() * n as f64) as usize).min(n.saturating_sub(1))
    }

    /// True with probability `p`.
    pub fn chance(&mut self, p: f64) -> bool {
        self.uniform() < p
    }

    /// Student's t with `nu` degrees of freedom, scaled to unit variance (`nu` over 2).
    pub fn heavy(&mut self, nu: f64) -> f64 {
        let chi2: f64 = (0..nu.round() as usize).map(|_| self.normal().powi(2)).sum();
        self.normal() / (chi2 / nu).sqrt() * ((nu - 2.0) / nu).sqrt()
    }

    /// Sixty-four random bits.
    pub fn bits(&mut self) -> u64 {
        self.0.next_u64()
    }
}

/// Slow wander: an Ornstein-Uhlenbeck process, exact for any step.
#[derive(Clone, Debug)]
pub struct Wander {
    sd: f64,
    time_s: f64,
    step_s: f64,
    decay: f64,
    kick: f64,
    value: f64,
}

impl Wander {
    /// A stationary wander with a standard deviation and a correlation time (s), started at random.
    pub fn new(sd: f64, time_s: f64, noise: &mut Noise) -> Self {
        Self { sd, time_s, step_s: -1.0, decay: 1.0, kick: 0.0, value: sd * noise.normal() }
    }

    /// Moves on by `dt` seconds.
    pub fn step(&mut self, dt: f64, noise: &mut Noise) -> f64 {
        if self.sd == 0.0 {
            return 0.0;
        }
        if dt != self.step_s {
            self.step_s = dt;
            self.decay = (-dt / self.time_s).exp();
            self.kick = self.sd * (1.0 - self.decay * self.decay).sqrt();
        }
        self.value = self.value * self.decay + self.kick * noise.normal();
        self.value
    }
}
