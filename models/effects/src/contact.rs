//! One cycle of the massless slider under a vibrating plate, as every effect may have changed it.
//!
//! The plate moves as `(w/2) sin(2 pi f t)`. In units of `k_n w/2` the normal force is
//! `cos(psi) - cos(phi)`, psi the phase from the highest point and phi the half contact angle. The lateral
//! force is the largest that grows no faster than the drag of the spring and never passes the friction limit
//! (a Skorokhod reflection), `L(x) = min over y <= x of [limit(y) + k_l U (x - y)]`. For a limit proportional
//! to the normal force that minimum, and its mean over the cycle, are closed forms but for one root
//! ([`mean_friction`]); laws that change the limit within the cycle take the sweep of [`sweep`].

pub mod asperities;
mod bonds;
pub mod distorted;
pub(crate) mod gap;
mod held;
pub mod impact;
mod retarded;
mod stick;
pub mod sweep;

pub use bonds::Bonds;
pub use held::Held;
use models::root::{bisection, newton_or_half};
use std::f64::consts::PI;

/// What one pass presents to the contact after every effect has had its say. SI units.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Contact {
    /// Intrinsic friction coefficient.
    pub mu0: f64,
    /// Normal stiffness, N/m.
    pub normal_stiffness: f64,
    /// Lateral stiffness, N/m.
    pub lateral_stiffness: f64,
    /// True vibration amplitude, peak to peak, m.
    pub amplitude_pp: f64,
    /// Vibration frequency, Hz.
    pub frequency: f64,
    /// True sliding speed (magnitude), m/s.
    pub speed: f64,
    /// True normal force on the finger, N.
    pub normal_force: f64,
    /// Share of the normal force that solid contact carries; the rest floats on air. 1 in the baseline.
    pub solid_share: f64,
    /// Factor on the mean friction force. 1 in the baseline.
    pub friction_factor: f64,
    /// Adhesive force of the whole contact (DMT), N. 0 in the baseline.
    pub adhesion: f64,
    /// Attraction that adds to the friction limit without holding the contact at lift-off. None in the
    /// baseline.
    pub attraction: Attraction,
    /// Exponent by which the friction limit departs from Amontons within the cycle: the limit is
    /// `mu0 F (F/reference_load)^load_exponent`. 0 in the baseline.
    pub load_exponent: f64,
    /// Load at which the limit is `mu0 F` whatever the exponent, N.
    pub reference_load: f64,
    /// Inverse of the largest speed of lateral recovery, s/m. 0 in the baseline (infinitely fast).
    pub inverse_recovery_speed: f64,
    /// Stretch below which that speed falls in proportion to the stretch, m. 0: the speed is the same at any
    /// stretch.
    pub recovery_knee: f64,
    /// Relaxation time of the lateral stretch out of contact, s. 0 in the baseline.
    pub lateral_relaxation_time: f64,
    /// Share of the rate of relaxation at [`sweep::STATED_STRETCH_M`] that goes in proportion to the stretch,
    /// below 1. 0 in the baseline, where the rate is the same at any stretch.
    pub relaxation_growth: f64,
    /// Whether a stretch beyond the friction limit recovers towards the limit while the plate goes on drawing
    /// the skin along, in slip against viscosity (Perzyna); else it follows the limit down no faster than the
    /// recovery allows, and does not grow. In flight it recovers in either case.
    pub viscous_slip: bool,
    /// Stretch that the tissue holds from contact to contact. Nothing in the baseline.
    pub held: Held,
    /// How bonds grow after touch-down.
    pub bonds: Bonds,
    /// Scale of the heights of the asperities, m. 0 in the baseline (one height).
    pub asperity_height: f64,
    /// Distribution of the heights.
    pub asperity_heights: asperities::Heights,
    /// Retardation time of the normal spring, s. 0 in the baseline.
    pub normal_retardation_time: f64,
    /// Damping in proportion to the indentation (Hunt and Crossley), s/m: the normal force rises by this
    /// times the speed of indentation, and no more than twofold. 0 in the baseline.
    pub indentation_damping: f64,
    /// Second harmonic of the plate's motion; with it only springs and Coulomb friction act.
    pub harmonic: distorted::Harmonic,
    /// Mass of the ridges that follow the plate, kg. 0 in the baseline.
    pub mass: f64,
    /// Share of the ridges without mass. 0 in the baseline.
    pub massless_share: f64,
    /// Damping ratio of the ridges where there is mass.
    pub ridge_damping_ratio: f64,
    /// Index into [`impact::LANDINGS`] where there is mass.
    pub landing: usize,
    /// Whether a sweep may be coarse: for searches that only look for places to begin.
    pub coarse: bool,
}

/// Attraction between skin and plate that friction feels beside the normal force.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Attraction {
    /// There is none.
    #[default]
    None,
    /// `force F / (F + scale)`: it is there as far as the surfaces are pressed into each other.
    Developing {
        /// Attraction of the full contact, N.
        force: f64,
        /// Normal force at which half of it is there, N.
        scale: f64,
    },
    /// `2 Fc + 2 sqrt(Fc (F + Fc))`: what the contact of Johnson, Kendall and Roberts adds to the load, by
    /// its pull-off force.
    Jkr {
        /// Pull-off force, N.
        pull_off: f64,
    },
}

impl Attraction {
    /// Attraction at a normal force in contact, N.
    pub fn at(&self, force: f64) -> f64 {
        match *self {
            Attraction::None => 0.0,
            Attraction::Developing { force: full, scale } => full * force / (force + scale),
            Attraction::Jkr { pull_off } => 2.0 * pull_off + 2.0 * (pull_off * (force + pull_off)).sqrt(),
        }
    }
}

impl Contact {
    /// Half the peak-to-peak amplitude, m: the sine's amplitude.
    pub fn half_amplitude(&self) -> f64 {
        0.5 * self.amplitude_pp
    }
    /// The ratio `F / (k_n w/2)`: 1 or more keeps the plate touched for the whole cycle.
    pub fn load_ratio(&self) -> f64 {
        self.normal_force * self.solid_share / (self.normal_stiffness * self.half_amplitude())
    }
    /// Drag of the lateral spring per radian of phase in units of `mu0 k_n w/2`; 1 or more never sticks.
    pub fn drag(&self) -> f64 {
        self.lateral_stiffness * self.speed
            / (2.0 * PI * self.frequency * self.mu0 * self.normal_stiffness * self.half_amplitude())
    }
    fn needs_sweep(&self) -> bool {
        self.load_exponent != 0.0
            || self.inverse_recovery_speed > 0.0
            || self.lateral_relaxation_time > 0.0
            || self.bonds != Bonds::AtOnce
            || self.attraction != Attraction::None
            || self.normal_retardation_time > 0.0
            || self.indentation_damping > 0.0
            || self.held.share > 0.0
    }
}

/// Below this amplitude (m, peak to peak) the plate is taken as still: far below any vibrometer's floor.
pub const STILL_PLATE_M: f64 = 1e-12;

/// Mean friction force over a cycle of the periodic steady state, N (unsigned).
pub fn mean_friction(c: &Contact) -> f64 {
    if c.normal_force.is_nan() || c.normal_force <= 0.0 {
        return 0.0;
    }
    let base = if c.amplitude_pp < STILL_PLATE_M {
        still_friction(c)
    } else if c.asperity_height > 0.0 {
        asperities::mean_friction(c)
    } else if c.harmonic.ratio > 0.0 {
        closed_form(c) * distorted::friction_ratio(c)
    } else if c.needs_sweep() {
        sweep::mean_friction(c)
    } else {
        closed_form(c)
    };
    let inertia =
        if c.mass > 0.0 && c.amplitude_pp >= STILL_PLATE_M { impact::friction_ratio(c) } else { 1.0 };
    let inertia = inertia + c.massless_share * (1.0 - inertia);
    base * c.friction_factor * inertia
}

/// Steady sliding on a still plate, N.
fn still_friction(c: &Contact) -> f64 {
    let carried = c.normal_force * c.solid_share;
    let load = carried + c.adhesion + c.attraction.at(carried);
    c.mu0 * load * (load / c.reference_load).powf(c.load_exponent)
}

/// Closed form for a limit proportional to the normal force, with adhesion.
fn closed_form(c: &Contact) -> f64 {
    let scale = c.normal_stiffness * c.half_amplitude();
    let pull = c.adhesion / scale;
    let load = c.load_ratio();
    let phi = half_contact_angle(load, pull);
    let carried = match (phi >= PI, pull == 0.0) {
        (true, _) => load + pull,
        // The angle is the one that carries the load.
        (false, true) => load,
        (false, false) => arc_load(phi),
    };
    (carried - lost_to_stick(phi, c.drag()) / (2.0 * PI)) * c.mu0 * scale
}

/// Angle (rad) below which a difference of sines loses digits, and a series is exact to 1e-12.
const SMALL_ANGLE: f64 = 1e-2;

/// Mean of `(cos psi - cos phi)+` over a cycle.
pub fn arc_load(phi: f64) -> f64 {
    arc_load_of(phi, phi.sin_cos())
}

/// The same where sine and cosine are at hand.
fn arc_load_of(phi: f64, (sin, cos): (f64, f64)) -> f64 {
    if phi < SMALL_ANGLE {
        phi.powi(3) / (3.0 * PI) * (1.0 - 0.1 * phi * phi)
    } else {
        (sin - phi * cos) / PI
    }
}

/// Half contact angle that balances the mean load: `arc_load(phi) - pull phi/pi = load`; pi for full contact.
/// `pull` is the adhesive force in units of `k_n w/2`.
pub fn half_contact_angle(load: f64, pull: f64) -> f64 {
    if load >= 1.0 {
        return PI;
    }
    if pull == 0.0 {
        return angles().at(load);
    }
    // With pull, the balance first falls and then rises with phi; the loaded branch is the upper one.
    let balance = |phi: f64| {
        let (sin, cos) = phi.sin_cos();
        (arc_load_of(phi, (sin, cos)) - pull * phi / PI - load, (phi * sin - pull) / PI)
    };
    if balance(PI).0 <= 0.0 {
        return PI;
    }
    let look = |phi: f64| {
        let (value, slope) = balance(phi);
        (value > 0.0, if slope > 0.0 { phi - value / slope } else { f64::NAN })
    };
    let low = half_contact_angle(load, 0.0);
    // Newton squares the error: what is left is below 1e-12.
    newton_or_half([low, PI], low, |phi| 1e-7 * phi, look)
}

/// Makes the tables that any contact asks for, so that none is made inside a control loop.
pub fn prepare() {
    let _ = (angles(), stick::guesses());
}

/// The inverse of [`arc_load`], tabulated: Hermite cubics in the fourth root of the load, and in the root of
/// what it lacks of full contact, where the angle rises steeply. Within 1e-9 rad of the root (tested).
struct Angles {
    low: Vec<(f64, f64)>,
    high: Vec<(f64, f64)>,
}

const ANGLE_NODES: usize = 1024;
const SERIES_LOAD: f64 = 1e-4;
const STEEP_LOAD: f64 = 0.8;

fn angles() -> &'static Angles {
    static ANGLES: std::sync::OnceLock<Angles> = std::sync::OnceLock::new();
    ANGLES.get_or_init(|| {
        let (first, last) = (SERIES_LOAD.powf(0.25), STEEP_LOAD.powf(0.25));
        let top = (1.0 - STEEP_LOAD).sqrt();
        let low = |i: usize| {
            let t = first + (last - first) * i as f64 / ANGLE_NODES as f64;
            let phi = angle_by_bisection(t.powi(4));
            (phi, 4.0 * t.powi(3) * PI / (phi * phi.sin()))
        };
        let high = |i: usize| {
            let t = top * i as f64 / ANGLE_NODES as f64;
            let phi = angle_by_bisection(1.0 - t * t);
            if i == 0 { (PI, -std::f64::consts::SQRT_2) } else { (phi, -2.0 * t * PI / (phi * phi.sin())) }
        };
        let nodes = 0..=ANGLE_NODES;
        Angles { low: nodes.clone().map(low).collect(), high: nodes.map(high).collect() }
    })
}

impl Angles {
    fn at(&self, load: f64) -> f64 {
        if load < SERIES_LOAD {
            // arc_load = phi^3/(3 pi) (1 - phi^2/10): one correction of the leading term is exact to 1e-8.
            let phi = (3.0 * PI * load.max(0.0)).cbrt();
            return phi * (1.0 + phi * phi / 30.0);
        }
        if load < STEEP_LOAD {
            let (first, last) = (0.1, 0.945_741_609_003_176_2);
            hermite(&self.low, (load.sqrt().sqrt() - first) / (last - first), last - first)
        } else {
            let top = (1.0 - STEEP_LOAD).sqrt();
            hermite(&self.high, (1.0 - load).max(0.0).sqrt() / top, top)
        }
    }
}

fn hermite(nodes: &[(f64, f64)], place: f64, range: f64) -> f64 {
    let s = (place * ANGLE_NODES as f64).clamp(0.0, ANGLE_NODES as f64);
    let i = (s as usize).min(ANGLE_NODES - 1);
    let t = s - i as f64;
    let h = range / ANGLE_NODES as f64;
    let ((a, da), (b, db)) = (nodes[i], nodes[i + 1]);
    let r = 1.0 - t;
    r * r * ((1.0 + 2.0 * t) * a + t * h * da) + t * t * ((3.0 - 2.0 * t) * b - r * h * db)
}

fn angle_by_bisection(load: f64) -> f64 {
    bisection([0.0, PI], 60, |phi| arc_load(phi) <= load)
}

/// Integral over the cycle of friction limit minus lateral force, in units of `mu0 k_n w/2` radian.
///
/// `phi` is the half contact angle (pi: never leaves), `drag` the rate of stretch per radian.
pub fn lost_to_stick(phi: f64, drag: f64) -> f64 {
    stick::lost(phi, phi.sin_cos(), drag)
}

/// A contact to test: the paper's condition on round springs.
#[cfg(test)]
fn example() -> Contact {
    let design = crate::Design {
        duration_s: 1.0,
        reference_load_n: 0.3,
        reference_speed_m_s: 0.02,
        reference_frequency_hz: 30_000.0,
        reference_temperature_c: 20.0,
        stroke_m: 0.03,
        largest_amplitude_m: 5e-6,
    };
    let base = crate::Baseline { mu0: 0.5, normal_stiffness_n_per_m: 1e6, lateral_stiffness_n_per_m: 4e5 };
    base.contact(&models::condition::Condition::paper(), &design)
}
