//! The contact between the fingertip's ridges and the vibrating plate, in the time domain.
//!
//! Three solvers, one set of parameters:
//! * [`element`]: a massless linear element, exactly, event by event. It serves where nothing but the paper's
//!   own assumptions acts.
//! * [`sampled`]: a massless element with any of the [`Limit`], [`StretchRecovery`] and [`Motion`] terms,
//!   marched through the cycle's contact phase on a fine grid until it repeats.
//! * [`resolved`]: a ridge with mass and damping, which flies, lands and sticks; marched through many cycles.
//!
//! [`Contact::steady`] picks the cheapest one that holds everything requested. [`averaged`] keeps the
//! resolved one affordable in a control loop.
//!
//! Sources: the paper's section 4 (a Coulombic slider on two springs), section 5.3 (finite lateral recovery).

pub mod averaged;
mod compliant;
pub mod element;
pub mod lateral;
pub mod resolved;
pub mod sampled;

use std::f64::consts::PI;

/// The friction limit beyond Coulomb's: every term is zero in the ideal world.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Limit {
    /// Share of the limit carried by a contact area that grows as the 2/3 power of the force (-), 0 to 1.
    pub area_share: f64,
    /// Force at which that share leaves the limit as it was (N); positive where the share is not zero.
    pub area_reference_n: f64,
    /// Attraction fully developed under load (N); it adds to the force in the limit.
    pub adhesion_n: f64,
    /// Load at which 63 % of the attraction has developed (N); positive where `adhesion_n` is not zero.
    pub adhesion_scale_n: f64,
    /// Contact time after which half of the limit is there (s); 0: at once.
    pub dwell_s: f64,
}

impl Limit {
    /// Friction limit (N) for a normal force (N) and a time in contact (s).
    pub fn at(&self, friction: f64, normal_n: f64, dwell_s: f64) -> f64 {
        let mut load = normal_n;
        if self.area_share > 0.0 {
            let area = self.area_reference_n.cbrt() * normal_n.max(0.0).cbrt().powi(2);
            load = (1.0 - self.area_share) * normal_n + self.area_share * area;
        }
        if self.adhesion_n != 0.0 {
            load += self.adhesion_n * (1.0 - (-normal_n / self.adhesion_scale_n).exp());
        }
        let aged =
            if self.dwell_s > 0.0 && dwell_s.is_finite() { dwell_s / (dwell_s + self.dwell_s) } else { 1.0 };
        friction * load * aged
    }
}

/// How the lateral stretch of a ridge recovers once nothing holds it.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub enum StretchRecovery {
    /// At once: the paper's section 4.
    #[default]
    Instant,
    /// At a constant speed (m/s): the paper's section 5.3 (Figs. 13 and 14).
    Rate(f64),
    /// Towards a speed (m/s) for large stretches, exponentially below the given stretch (m).
    Soft {
        /// Speed of a large stretch (m/s).
        speed_m_s: f64,
        /// Stretch below which recovery is exponential (m).
        knee_m: f64,
    },
}

/// How the plate moves beyond `a cos(theta)`: all zero in the ideal world.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Motion {
    /// Second harmonic of the normal motion over the fundamental (-).
    pub second_harmonic: f64,
    /// Its phase at the top of the fundamental (rad).
    pub second_phase_rad: f64,
    /// In-plane motion along the sliding direction over the normal amplitude (-).
    pub in_plane: f64,
    /// Its phase at the top of the normal motion (rad).
    pub in_plane_phase_rad: f64,
    /// Slow modulation of the amplitude, depth (-), 0 to 1; averaged over its period.
    pub modulation: f64,
}

/// The ridges beyond massless ideal springs: all zero in the ideal world.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Ridge {
    /// Mass that follows the plate (kg).
    pub mass_kg: f64,
    /// Damping to the immobile tissue behind (N s/m).
    pub damping_n_s_per_m: f64,
    /// Stiffness of the skin's surface over the normal stiffness (-); 0: rigid, landings without rebound.
    pub skin_ratio: f64,
    /// Damping ratio of that surface under the ridge's mass (-).
    pub skin_loss: f64,
    /// Standard deviation of the heights of the ridges' tops (m).
    pub height_sd_m: f64,
}

/// A contact under steady conditions: everything its cycle depends on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Normal stiffness (N/m).
    pub normal_stiffness_n_per_m: f64,
    /// Lateral stiffness (N/m).
    pub lateral_stiffness_n_per_m: f64,
    /// Intrinsic coefficient of friction (-).
    pub friction: f64,
    /// Mean normal force (N).
    pub normal_force_n: f64,
    /// Zero-to-peak amplitude of the plate (m): half of w.
    pub sine_amplitude_m: f64,
    /// Frequency of the plate (Hz).
    pub frequency_hz: f64,
    /// Sliding speed (m/s), not negative.
    pub speed_m_s: f64,
    /// Friction limit beyond Coulomb's.
    pub limit: Limit,
    /// Lateral recovery.
    pub recovery: StretchRecovery,
    /// Motion of the plate beyond a sine.
    pub motion: Motion,
    /// Ridges beyond massless springs.
    pub ridge: Ridge,
}

/// What a cycle of steady contact yields.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Steady {
    /// Mean lateral force (N).
    pub lateral_force_n: f64,
    /// Share of the cycle in contact (-).
    pub contact_fraction: f64,
}

impl Steady {
    /// No contact.
    pub const NONE: Self = Self { lateral_force_n: 0.0, contact_fraction: 0.0 };
}

/// Points over a slow modulation's period.
const MODULATION_POINTS: usize = 6;
/// Mid-points of seven equal shares of a mirrored gamma distribution of shape 2, mean 0 and deviation 1:
/// heights of a worn bed of ridges.
const HEIGHTS: [f64; 7] = [-1.92261, -0.777237, -0.197039, 0.219217, 0.564011, 0.882609, 1.23105];

impl Contact {
    /// An ideal contact: massless, linear, Coulombic, recovering at once.
    pub fn ideal(
        normal_stiffness_n_per_m: f64,
        lateral_stiffness_n_per_m: f64,
        friction: f64,
        normal_force_n: f64,
        sine_amplitude_m: f64,
        frequency_hz: f64,
        speed_m_s: f64,
    ) -> Self {
        Self {
            normal_stiffness_n_per_m,
            lateral_stiffness_n_per_m,
            friction,
            normal_force_n,
            sine_amplitude_m,
            frequency_hz,
            speed_m_s,
            limit: Limit::default(),
            recovery: StretchRecovery::Instant,
            motion: Motion::default(),
            ridge: Ridge::default(),
        }
    }

    /// Lateral force at rest of the plate (N): the friction limit of the mean normal force.
    pub fn limit_at_rest_n(&self) -> f64 {
        self.limit.at(self.friction, self.normal_force_n, f64::INFINITY)
    }

    /// Whether a ridge must be flown and landed rather than pressed.
    pub fn has_inertia(&self) -> bool {
        self.ridge.mass_kg > 0.0 || self.ridge.damping_n_s_per_m > 0.0
    }

    /// The periodic state under these conditions.
    pub fn steady(&self) -> Steady {
        if self.normal_force_n <= 0.0 {
            return Steady::NONE;
        }
        if self.sine_amplitude_m <= 0.0 {
            return Steady { lateral_force_n: self.limit_at_rest_n(), contact_fraction: 1.0 };
        }
        if self.motion.modulation > 0.0 {
            return self.steady_modulated();
        }
        if self.has_inertia() {
            return resolved::steady(self, resolved::MarchSettings::default()).steady;
        }
        let plain = self.limit == Limit::default()
            && self.recovery == StretchRecovery::Instant
            && self.motion == Motion::default();
        match (plain, self.ridge.height_sd_m > 0.0) {
            (true, false) => self.steady_element(),
            (true, true) => self.steady_bed(),
            (false, _) => sampled::steady(self),
        }
    }

    /// Drag of an element, in the units of [`element`].
    fn drag(&self) -> f64 {
        let force = self.friction * self.normal_stiffness_n_per_m * self.sine_amplitude_m;
        self.lateral_stiffness_n_per_m * self.speed_m_s / (force * 2.0 * PI * self.frequency_hz)
    }

    fn steady_element(&self) -> Steady {
        let unit = self.normal_stiffness_n_per_m * self.sine_amplitude_m;
        let cycle = element::cycle(element::preload_for(self.normal_force_n / unit), self.drag());
        Steady {
            lateral_force_n: self.friction * self.normal_force_n * cycle.lateral / cycle.normal,
            contact_fraction: cycle.contact / (2.0 * PI),
        }
    }

    /// Ridges of unequal height: each its own element, all on one finger.
    fn steady_bed(&self) -> Steady {
        let unit = self.normal_stiffness_n_per_m * self.sine_amplitude_m;
        let spread = self.ridge.height_sd_m / self.sine_amplitude_m;
        let drag = self.drag();
        let count = HEIGHTS.len() as f64;
        let target = self.normal_force_n / unit;
        let normal = |preload: f64| {
            HEIGHTS.iter().map(|h| element::cycle(preload + h * spread, 1.0).normal).sum::<f64>()
                / (2.0 * PI * count)
        };
        let ends = [-1.0 - 1.5 * spread, target + 1.0 + 1.5 * spread];
        let preload = models::root::bisection(ends, 48, |preload| normal(preload) < target);
        let (mut carried, mut lateral, mut contact) = (0.0, 0.0, 0.0);
        for height in HEIGHTS {
            let cycle = element::cycle(preload + height * spread, drag);
            carried += cycle.normal;
            lateral += cycle.lateral;
            contact += cycle.contact / (2.0 * PI * count);
        }
        Steady {
            lateral_force_n: self.friction * self.normal_force_n * lateral / carried,
            contact_fraction: contact,
        }
    }

    /// Slow modulation: the mean over the modulation's period of the steady state at each of its amplitudes.
    fn steady_modulated(&self) -> Steady {
        let mut sum = Steady::NONE;
        for i in 0..MODULATION_POINTS {
            let phase = PI * (2 * i + 1) as f64 / (2 * MODULATION_POINTS) as f64;
            let mut at = *self;
            at.sine_amplitude_m *= 1.0 + self.motion.modulation * phase.cos();
            at.motion.modulation = 0.0;
            let one = at.steady();
            sum.lateral_force_n += one.lateral_force_n / MODULATION_POINTS as f64;
            sum.contact_fraction += one.contact_fraction / MODULATION_POINTS as f64;
        }
        sum
    }
}
