//! The march over a compliant, lossy skin: landings last, and give back part of what they took.
//!
//! Between ridge and plate stands a spring and dashpot that push but never pull. Free or touching, the ridge
//! is a linear oscillator: its swing about the forced response is advanced by the exact transition matrix, so
//! a step need only be short against the landing. With a stiff skin and full loss this is the rigid landing
//! of [`super::resolved`]; without loss a ridge bounces, and its friction falls much further.

use super::Contact;
use super::resolved::{ContactMeans, LIGHTEST_KG, March, Sums, transition};
use std::f64::consts::PI;

impl March {
    /// One period over a compliant skin, from the plate's top; then the static compression is corrected.
    pub(super) fn compliant_cycle(&mut self, contact: &Contact) -> ContactMeans {
        let omega = 2.0 * PI * contact.frequency_hz;
        let dt = 1.0 / (contact.frequency_hz * self.steps as f64);
        let m = contact.ridge.mass_kg.max(LIGHTEST_KG);
        let (k, c) = (contact.normal_stiffness_n_per_m, contact.ridge.damping_n_s_per_m);
        let ks = contact.ridge.skin_ratio * k;
        let cs = contact.ridge.skin_loss * 2.0 * (ks * m).sqrt();
        let a = contact.sine_amplitude_m;
        let free = transition(k, c, m, dt);
        let touch = transition(k + ks, c + cs, m, dt);
        // Forced response while touching: (ks + i w cs) a / (k + ks - m w^2 + i w (c + cs)).
        let (nr, ni) = (ks * a, omega * cs * a);
        let (dr, di) = (k + ks - m * omega * omega, omega * (c + cs));
        let norm = dr * dr + di * di;
        let (fr, fi) = ((nr * dr + ni * di) / norm, (ni * dr - nr * di) / norm);
        let rest = -k * self.preload_m / (k + ks);
        let (turn_s, turn_c) = (omega * dt).sin_cos();
        let (mut cos, mut sin) = (1.0_f64, 0.0_f64);
        let mut sums = Sums::default();
        for _ in 0..self.steps {
            let forced = |cos: f64, sin: f64| (fr * cos - fi * sin + rest, -omega * (fr * sin + fi * cos));
            if self.touching {
                let (y0, v0) = forced(cos, sin);
                let (q, v) = (self.height_m - y0, self.speed_m_s - v0);
                (cos, sin) = (cos * turn_c - sin * turn_s, sin * turn_c + cos * turn_s);
                let (y1, v1) = forced(cos, sin);
                self.height_m = y1 + touch[0] * q + touch[1] * v;
                self.speed_m_s = v1 + touch[2] * q + touch[3] * v;
            } else {
                (cos, sin) = (cos * turn_c - sin * turn_s, sin * turn_c + cos * turn_s);
                let (q, v) = (self.height_m + self.preload_m, self.speed_m_s);
                self.height_m = free[0] * q + free[1] * v - self.preload_m;
                self.speed_m_s = free[2] * q + free[3] * v;
            }
            let (depth, closing) = (a * cos - self.height_m, -a * omega * sin - self.speed_m_s);
            let pressed = ks * depth + cs * closing;
            self.touching = depth > 0.0 && pressed > 0.0;
            self.rub(contact, pressed, dt, &mut sums);
        }
        self.balanced(contact, &sums, 0.2)
    }
}

#[cfg(test)]
mod tests {
    use crate::contact::{Contact, resolved};

    #[test]
    fn a_ridge_with_mass_against_an_independent_march() {
        // 2 um peak-to-peak, 27.5 kHz, 20 mm/s, 0.25 N, k_n 1 MN/m; a plain explicit march of 4000 steps a
        // cycle, skin 30 times stiffer than the ridge: mu' for mass [kg], damping ratio, skin loss.
        let mut contact = Contact::ideal(1e6, 1e6 / 2.66, 0.5, 0.25, 1e-6, 27_500.0, 0.02);
        contact.ridge.skin_ratio = 30.0;
        for (mass, zeta, loss, expected) in [
            (2e-6, 0.3, 0.0, 0.1162),
            (2e-6, 1.0, 0.0, 0.1462),
            (8e-6, 1.0, 0.0, 0.0609),
            (2e-6, 0.3, 0.3, 0.1695),
            (8e-6, 1.0, 0.3, 0.0921),
            (8e-6, 0.3, 0.3, 0.1151),
        ] {
            contact.ridge.mass_kg = mass;
            contact.ridge.damping_n_s_per_m = 2.0 * zeta * f64::sqrt(1e6 * mass);
            contact.ridge.skin_loss = loss;
            for steps in [240, 2000] {
                let settings = resolved::MarchSettings { steps, settle: 160, average: 40 };
                let got = resolved::steady(&contact, settings).steady.lateral_force_n / 0.125;
                println!("{mass:e} kg, zeta {zeta}, loss {loss}, {steps} steps: {got:.4} against {expected}");
                let tolerance = if steps == 240 { 0.006 } else { 0.002 };
                assert!((got - expected).abs() < tolerance, "{mass} {zeta} {loss}: {got} against {expected}");
            }
        }
    }
}
