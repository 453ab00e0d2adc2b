//! The amplitude for a wanted friction, sought in the contact angle instead of the amplitude.
//!
//! With instant recovery the half contact angle `alpha` gives the amplitude in closed form (Eq. 15, `a = pi h
//! / A` with `A = sin(alpha) - alpha cos(alpha)`), the growth of the stretch `kappa = K A`, and with the
//! phase of slip `mu'` and its slope. Force is continuous where stick ends, so `mu'` does not change with
//! that phase to first order. For short contact all of it is `mu' = 1 - (1 - q)^3` with `q = K alpha^2 / 3`:
//! in `ln q` and `ln alpha` a line, where Newton's method begins.

use super::{contact_area, static_compression_m};
use crate::condition::Condition;
use crate::finger::Finger;
use crate::quantity::PeakToPeak;
use crate::root;
use std::f64::consts::PI;

/// Step of `ln alpha`, and of the phase of slip in rad, at which Newton's method ends: its square is left.
const CLOSE: f64 = 1e-6;
/// The search ends this far from the angle at which contact is never lost.
const UP_TO: f64 = 1.0 - 1e-6;

/// The amplitude at which the slider has a wanted `mu'`, and the slope `d mu'/dw` there in 1/m. The
/// condition's own amplitude does not count; condition and finger are in the model's domain.
///
/// `None` where contact is never lost at that amplitude, where the finger recovers at a finite speed, and
/// for a `mu'` outside (0, 1).
pub fn amplitude_for(c: &Condition, finger: &Finger, wanted: f64) -> Option<(PeakToPeak, f64)> {
    if finger.lateral_recovery_m_per_s.is_some() || !(wanted > 0.0 && wanted < 1.0) {
        return None;
    }
    let kn = finger.normal_stiffness_n_per_m;
    let compression = static_compression_m(c.normal_force_n, kn);
    let stretch = finger.lateral_stiffness_n_per_m * c.speed_m_s / (2.0 * PI * c.frequency_hz * c.mu0 * kn);
    let k = stretch / (PI * compression);
    let (most, start) = ((PI * UP_TO).ln(), 0.5 * (3.0 * short_contact(wanted).0 / k).ln());
    let target = short_contact(wanted).0.ln();
    let (mut slip, mut last) = (None, (0.0, 0.0));
    let miss = |ln_alpha: f64| {
        let alpha = ln_alpha.exp();
        let Some(cycle) = Friction::at(alpha, k, &mut slip) else { return (-target, 2.0) };
        let (q, slope) = short_contact(cycle.mu);
        last = (cycle.mu, cycle.per_alpha * alpha);
        (q.ln() - target, slope * cycle.per_alpha * alpha / q)
    };
    // Far below the start contact is short, and `mu'` as small as one wants.
    let ln_alpha = root::newton_between(miss, true, [start.min(most) - 6.0, most], start, CLOSE);
    let alpha = ln_alpha.exp();
    let area = contact_area(alpha);
    let met = (last.0 - wanted).abs() < 1e-3 && ln_alpha < most - CLOSE;
    // d ln w / d ln alpha = -alpha A' / A, with A' = alpha sin(alpha).
    let w = 2.0 * PI * compression / area;
    let slope = -last.1 * area / (alpha * alpha * alpha.sin() * w);
    met.then(|| (PeakToPeak::from_metres(w), slope))
}

/// `q` of a short contact with this `mu'`, and `dq/dmu'`.
fn short_contact(mu: f64) -> (f64, f64) {
    let left = (1.0 - mu).cbrt();
    (1.0 - left, 1.0 / (3.0 * left * left))
}

/// `mu'` at a half contact angle.
struct Friction {
    mu: f64,
    /// `d mu'/d alpha`.
    per_alpha: f64,
}

impl Friction {
    /// `None` where the slider never sticks. `slip` is the phase at which stick ended at an angle nearby, as
    /// a share of that angle.
    fn at(alpha: f64, k: f64, slip: &mut Option<f64>) -> Option<Self> {
        let (sin, cos) = alpha.sin_cos();
        let area = contact_area(alpha);
        let kappa = k * area;
        let wide = alpha > 0.5 * PI;
        if kappa >= if wide { 1.0 } else { sin } {
            return None;
        }
        // Wide contact begins with slip where the force rises more slowly than the stretch would.
        let (from, at_from) = if kappa <= sin {
            (-alpha, 0.0)
        } else {
            let from = -PI + kappa.asin();
            (from, from.cos() - cos)
        };
        let top = -kappa.asin();
        let gap = |phi: f64| {
            let (s, c) = phi.sin_cos();
            (c - cos - at_from - kappa * (phi - from), -s - kappa)
        };
        let guess = slip.map_or(alpha * (1.0 - 2.0 * kappa / sin.max(kappa)), |share| share * alpha);
        let to = root::newton_between(gap, false, [top.max(-alpha), alpha], guess, CLOSE);
        *slip = Some(to / alpha);
        let under = |a: f64, b: f64| b.sin() - a.sin() - cos * (b - a);
        let stuck = to - from;
        let sum = under(-alpha, from) + stuck * (at_from + 0.5 * kappa * stuck) + under(to, alpha);
        let mu = sum / (2.0 * area);
        // Every force rises by sin(alpha), but that of a stick from touch-down, which begins earlier.
        let rise = if at_from == 0.0 { kappa * stuck + sin * (alpha - to) } else { 2.0 * alpha * sin };
        let steeper = 0.5 * stuck * stuck * k * alpha * sin;
        Some(Friction { mu, per_alpha: (rise + steeper - 2.0 * mu * alpha * sin) / (2.0 * area) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spring_slider::{critical_amplitude, solve};

    /// `mu' = 1 - (1 - q)^3` where contact is short: the closed form of the limit, by hand.
    #[test]
    fn short_contact_is_the_closed_form() {
        let k = 2e4;
        for q in [0.1f64, 0.5, 0.9] {
            let alpha = (3.0 * q / k).sqrt();
            let found = Friction::at(alpha, k, &mut None).expect("it sticks");
            assert!((found.mu - (1.0 - (1.0 - q).powi(3))).abs() < 1e-4, "{q}: {}", found.mu);
        }
    }

    /// The cycle's own solution, which marches the stretch piece by piece, at every regime of contact.
    #[test]
    fn the_cycle_at_that_amplitude_has_the_wanted_friction() {
        let finger = Finger::paper();
        let (mut found, mut greatest) = (0, 0.0f64);
        for k in 0..20_000 {
            let part = |step: f64| (f64::from(k) * step).fract();
            let condition = Condition {
                frequency_hz: 20e3 + 80e3 * part(0.618_034),
                speed_m_s: 1e-3 * 400f64.powf(part(0.754_878)),
                normal_force_n: 0.05 * 40f64.powf(part(0.569_840)),
                mu0: 0.2 + part(0.324_718),
                ..Condition::paper()
            };
            let wanted = 0.02 + 0.97 * part(0.819_173);
            let at = |w: f64| {
                let amplitude = PeakToPeak::from_metres(w);
                solve(&Condition { amplitude, ..condition }, &finger).expect("in the domain").mu_relative
            };
            let Some((amplitude, slope)) = amplitude_for(&condition, &finger, wanted) else {
                // Contact is not lost at the amplitude that would be needed.
                let kn = finger.normal_stiffness_n_per_m;
                let critical = critical_amplitude(condition.normal_force_n, kn).metres();
                assert!(at(1.001 * critical) < wanted, "{condition:?} {wanted}");
                continue;
            };
            let w = amplitude.metres();
            greatest = greatest.max((at(w) - wanted).abs());
            let by_difference = (at(w * 1.0001) - at(w * 0.9999)) / (2e-4 * w);
            assert!(
                (slope / by_difference - 1.0).abs() < 1e-2,
                "{condition:?} {wanted}: {slope} {by_difference}"
            );
            found += 1;
        }
        assert!(found > 12_000 && greatest < 1e-8, "{found} {greatest:e}");
    }
}
