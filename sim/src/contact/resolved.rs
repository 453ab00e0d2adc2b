//! A ridge with mass and damping on a rigid vibrating plate, marched in time.
//!
//! In contact the ridge follows the plate, and the contact force is what that takes:
//! `m z'' + c z' + k_n (z + d)`. Where it would turn negative the ridge flies: a damped oscillator about
//! `-d`, advanced by its exact transition matrix, so that a light ridge needs no smaller step. Where it meets
//! the plate it lands without rebound; the impulse counts in the mean normal force but not in the friction,
//! because the massless lateral spring cannot pass it on. The static compression `d` is adjusted from cycle
//! to cycle until the mean normal force is the one the finger presses with.

use super::lateral::Lateral;
use super::{Contact, Steady, element};
use std::f64::consts::PI;

/// How finely and how long to march.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MarchSettings {
    /// Steps a period.
    pub steps: usize,
    /// Cycles before averaging.
    pub settle: usize,
    /// Cycles averaged.
    pub average: usize,
}

impl Default for MarchSettings {
    fn default() -> Self {
        Self { steps: 240, settle: 72, average: 24 }
    }
}

/// The march's answer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resolved {
    /// Means over the averaged cycles.
    pub steady: Steady,
    /// Mean normal force over the averaged cycles (N): how well the balance was met.
    pub normal_force_n: f64,
}

/// Lightest ridge marched (kg): lighter ones move as if they had this mass.
pub(super) const LIGHTEST_KG: f64 = 1e-8;

/// Transition matrix of a mass on spring and dashpot over one step.
pub(super) fn transition(stiffness: f64, damping: f64, m: f64, dt: f64) -> [f64; 4] {
    let gamma = damping / (2.0 * m);
    let w2 = stiffness / m;
    let disc = gamma * gamma - w2;
    // e^(-gamma t) cosh and e^(-gamma t) sinh / root, in the form that overflows nowhere.
    let (c, s) = if disc < -1e-9 * w2 {
        let root = (-disc).sqrt();
        let decay = (-gamma * dt).exp();
        (decay * (root * dt).cos(), decay * (root * dt).sin() / root)
    } else if disc > 1e-9 * w2 {
        let root = disc.sqrt();
        let (slow, fast) = ((-w2 / (gamma + root) * dt).exp(), (-(gamma + root) * dt).exp());
        (0.5 * (slow + fast), 0.5 * (slow - fast) / root)
    } else {
        let decay = (-gamma * dt).exp();
        (decay, decay * dt)
    };
    [c + gamma * s, s, -w2 * s, c - gamma * s]
}

/// Marches until the averages are there.
pub fn steady(contact: &Contact, settings: MarchSettings) -> Resolved {
    let finer = if contact.ridge.skin_ratio > 0.0 { 2 } else { 1 };
    let mut march = March::new(contact, settings.steps * finer);
    for _ in 0..settings.settle {
        march.cycle(contact);
    }
    let (mut lateral, mut normal, mut touching) = (0.0, 0.0, 0.0);
    for _ in 0..settings.average {
        let one = march.cycle(contact);
        lateral += one.lateral_n;
        normal += one.normal_n;
        touching += one.contact;
    }
    let n = settings.average as f64;
    Resolved {
        steady: Steady { lateral_force_n: lateral / n, contact_fraction: touching / n },
        normal_force_n: normal / n,
    }
}

/// Means over one cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactMeans {
    /// Lateral force (N).
    pub lateral_n: f64,
    /// Normal force, impulses included (N).
    pub normal_n: f64,
    /// Share of the cycle in contact.
    pub contact: f64,
}

/// Integrals of the forces over a cycle so far, N s, and the steps in contact.
#[derive(Default)]
pub(super) struct Sums {
    lateral: f64,
    normal: f64,
    touched: usize,
}

/// The moving ridge.
#[derive(Clone, Copy, Debug)]
pub struct March {
    pub(super) steps: usize,
    pub(super) preload_m: f64,
    pub(super) height_m: f64,
    pub(super) speed_m_s: f64,
    pub(super) touching: bool,
    pub(super) last_normal_n: f64,
    pub(super) last_lateral_n: f64,
    pub(super) spring: Lateral,
}

impl March {
    /// A ridge resting on the plate, with the static compression of a massless one.
    pub fn new(contact: &Contact, steps: usize) -> Self {
        let a = contact.sine_amplitude_m;
        let target = contact.normal_force_n / (contact.normal_stiffness_n_per_m * a);
        Self {
            steps,
            preload_m: a * element::preload_for(target),
            height_m: a,
            speed_m_s: 0.0,
            touching: true,
            last_normal_n: 0.0,
            last_lateral_n: 0.0,
            spring: Lateral::default(),
        }
    }

    /// One period, from the plate's top; then the static compression is corrected.
    pub fn cycle(&mut self, contact: &Contact) -> ContactMeans {
        if contact.ridge.skin_ratio > 0.0 {
            return self.compliant_cycle(contact);
        }
        let omega = 2.0 * PI * contact.frequency_hz;
        let dt = 1.0 / (contact.frequency_hz * self.steps as f64);
        let m = contact.ridge.mass_kg.max(LIGHTEST_KG);
        let (k, c) = (contact.normal_stiffness_n_per_m, contact.ridge.damping_n_s_per_m);
        let map = transition(k, c, m, dt);
        let a = contact.sine_amplitude_m;
        let (turn_s, turn_c) = (omega * dt).sin_cos();
        let (mut cos, mut sin) = (1.0_f64, 0.0_f64);
        let mut sums = Sums::default();
        for _ in 0..self.steps {
            let (z0, zd0) = (a * cos, -a * omega * sin);
            (cos, sin) = (cos * turn_c - sin * turn_s, sin * turn_c + cos * turn_s);
            let (z, zd, zdd) = (a * cos, -a * omega * sin, -a * omega * omega * cos);
            let pressed = m * zdd + c * zd + k * (z + self.preload_m);
            if self.touching && pressed < 0.0 {
                // Lift-off where the force, taken as linear over the step, passes zero.
                let share = self.last_normal_n / (self.last_normal_n - pressed);
                let left = (1.0 - share) * dt;
                let v = zd0 + share * (zd - zd0);
                let y = z0 + share * (z - z0);
                let pull = -(k * (y + self.preload_m) + c * v) / m;
                self.height_m = y + (v + 0.5 * pull * left) * left;
                self.speed_m_s = v + pull * left;
                self.touching = self.height_m < z;
                if self.touching {
                    self.height_m = z;
                }
            } else if !self.touching {
                let (q, v) = (self.height_m + self.preload_m, self.speed_m_s);
                self.height_m = map[0] * q + map[1] * v - self.preload_m;
                self.speed_m_s = map[2] * q + map[3] * v;
                if self.height_m <= z {
                    sums.normal += m * (zd - self.speed_m_s).max(0.0); // the landing's impulse
                    self.touching = true;
                }
            }
            self.rub(contact, pressed, dt, &mut sums);
        }
        self.balanced(contact, &sums, 0.3)
    }

    /// Takes what presses at the end of a step, and what it drags along, into the sums of the cycle.
    pub(super) fn rub(&mut self, contact: &Contact, pressed: f64, dt: f64, sums: &mut Sums) {
        let (force, side) = if self.touching {
            sums.touched += 1;
            let force = pressed.max(0.0);
            (force, self.spring.touch(contact, force, contact.speed_m_s, dt))
        } else {
            self.spring.release(contact.recovery, dt);
            (0.0, 0.0)
        };
        sums.normal += 0.5 * (self.last_normal_n + force) * dt;
        sums.lateral += 0.5 * (self.last_lateral_n + side) * dt;
        (self.last_normal_n, self.last_lateral_n) = (force, side);
    }

    /// The means of a cycle; the static compression goes a share of the way to where the load is carried.
    pub(super) fn balanced(&mut self, contact: &Contact, sums: &Sums, share: f64) -> ContactMeans {
        let cycle = ContactMeans {
            lateral_n: sums.lateral * contact.frequency_hz,
            normal_n: sums.normal * contact.frequency_hz,
            contact: sums.touched as f64 / self.steps as f64,
        };
        let slope = contact.normal_stiffness_n_per_m * cycle.contact.max(0.15);
        self.preload_m += share * (contact.normal_force_n - cycle.normal_n) / slope;
        cycle
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_light_ridge_is_the_massless_one() {
        let mut contact = Contact::ideal(3.9e6, 1.5e6, 0.5, 0.25, 1e-6, 27_500.0, 0.05);
        let exact = contact.steady();
        contact.ridge.mass_kg = 1e-8;
        contact.ridge.damping_n_s_per_m = 0.02;
        let marched = steady(&contact, MarchSettings { steps: 2000, ..MarchSettings::default() });
        assert!((marched.normal_force_n / 0.25 - 1.0).abs() < 2e-3, "{marched:?}");
        let (got, expected) = (marched.steady.lateral_force_n, exact.lateral_force_n);
        assert!((got / expected - 1.0).abs() < 0.02, "{got} against {expected}");
    }

    #[test]
    fn the_free_ridge_rings_at_its_own_frequency_and_decays() {
        let period = 2.0 * PI * (8e-6_f64 / 1e6).sqrt();
        let map = transition(1e6, 0.0, 8e-6, period);
        assert!((map[0] - 1.0).abs() < 1e-9 && map[2].abs() < 1.0, "{map:?}");
        // Damping ratio 0.1: one period shrinks the swing by exp(-2 pi 0.1 / sqrt(0.99)).
        let damping = 0.1 * 2.0 * (1e6_f64 * 8e-6).sqrt();
        let damped = transition(1e6, damping, 8e-6, period / 0.99_f64.sqrt());
        assert!((damped[0] - (-2.0 * PI * 0.1 / 0.99_f64.sqrt()).exp()).abs() < 1e-9);
    }

    #[test]
    fn the_mean_normal_force_is_the_one_pressed_with() {
        for mass in [0.5e-6, 2e-6, 8e-6] {
            let mut contact = Contact::ideal(1e6, 0.4e6, 0.5, 0.25, 1e-6, 27_500.0, 0.02);
            contact.ridge.mass_kg = mass;
            contact.ridge.damping_n_s_per_m = 0.6 * (1e6 * mass).sqrt();
            let marched = steady(&contact, MarchSettings::default());
            assert!((marched.normal_force_n / 0.25 - 1.0).abs() < 0.03, "{mass}: {marched:?}");
        }
    }
}
