//! A massless ridge marched through the cycle on a grid: for every law that has no closed cycle.
//!
//! With a pure sine the grid covers the contact phase alone, so that a short contact is as finely resolved as
//! a long one; with a second harmonic it covers the whole cycle. The march repeats until the stretch at
//! touch-down does; the map from one touch-down to the next never falls and never rises faster than its
//! argument, so its fixed point is found by bisection where plain repetition is slow.

use super::lateral::Lateral;
use super::{Contact, HEIGHTS, Motion, Steady, element};
use std::f64::consts::PI;

/// Steps over the contact phase of a pure sine.
const CONTACT_STEPS: usize = 320;
/// Steps over the whole cycle where the plate's motion is not a sine.
const CYCLE_STEPS: usize = 800;
/// Points of the force balance over such a cycle.
const BALANCE_POINTS: usize = 400;
/// Plain repetitions before bisection.
const REPETITIONS: usize = 12;

/// Means over one cycle, and the stretch that the next cycle starts with.
#[derive(Clone, Copy)]
struct Pass {
    lateral_n: f64,
    contact: f64,
    end_m: f64,
}

/// The periodic state; see [`Contact::steady`].
pub fn steady(contact: &Contact) -> Steady {
    let heights: &[f64] = if contact.ridge.height_sd_m > 0.0 { &HEIGHTS } else { &[0.0] };
    let preload = preload_m(contact, heights);
    let mut sum = Steady::NONE;
    let share = 1.0 / heights.len() as f64;
    for height in heights {
        let pass = periodic(contact, preload + height * contact.ridge.height_sd_m);
        sum.lateral_force_n += share * pass.lateral_n;
        sum.contact_fraction += share * pass.contact;
    }
    sum
}

/// Static compression (m) at which the mean normal force is the requested one.
fn preload_m(contact: &Contact, heights: &[f64]) -> f64 {
    let a = contact.sine_amplitude_m;
    let target = contact.normal_force_n / (contact.normal_stiffness_n_per_m * a);
    if heights.len() == 1 && contact.motion.second_harmonic == 0.0 {
        return a * element::preload_for(target);
    }
    let spread = contact.ridge.height_sd_m / a;
    let pure = contact.motion.second_harmonic == 0.0;
    let mut waves = [0.0; BALANCE_POINTS];
    if !pure {
        for (i, z) in waves.iter_mut().enumerate() {
            *z = wave(&contact.motion, 2.0 * PI * i as f64 / BALANCE_POINTS as f64);
        }
    }
    let mean = |preload: f64| {
        let one = |p: f64| {
            if pure {
                return element::cycle(p, 1.0).normal / (2.0 * PI);
            }
            waves.iter().map(|z| (z + p).max(0.0)).sum::<f64>() / BALANCE_POINTS as f64
        };
        heights.iter().map(|h| one(preload + h * spread)).sum::<f64>() / heights.len() as f64
    };
    let reach = 1.0 + contact.motion.second_harmonic.abs() + 1.5 * spread;
    models::root::bisection([-reach, target + reach], 40, |preload| mean(preload) < target) * a
}

/// The plate's normal motion over its amplitude.
fn wave(motion: &Motion, theta: f64) -> f64 {
    theta.cos() + motion.second_harmonic * (2.0 * theta + motion.second_phase_rad).cos()
}

/// Repeats the cycle until it returns to the stretch it started from.
fn periodic(contact: &Contact, preload_m: f64) -> Pass {
    let reach = 1.0 + contact.motion.second_harmonic.abs();
    let a = contact.sine_amplitude_m;
    if preload_m <= -reach * a {
        return Pass { lateral_n: 0.0, contact: 0.0, end_m: 0.0 };
    }
    let peak = contact.normal_stiffness_n_per_m * (preload_m + reach * a);
    let top = contact.limit.at(contact.friction, peak, f64::INFINITY) / contact.lateral_stiffness_n_per_m;
    let tolerance = 1e-9 * top.max(1e-15);
    // In persistent contact the lowest force leaves its limit in the spring; elsewhere recovery starts from zero.
    let mut start = 0.0;
    let mut pass = cycle(contact, preload_m, start);
    for _ in 0..REPETITIONS {
        if (pass.end_m - start).abs() <= tolerance {
            return pass;
        }
        start = pass.end_m;
        pass = cycle(contact, preload_m, start);
    }
    let (mut low, mut high) = (-top, top + contact.speed_m_s / contact.frequency_hz);
    for _ in 0..34 {
        let middle = 0.5 * (low + high);
        pass = cycle(contact, preload_m, middle);
        (low, high) = if pass.end_m > middle { (middle, high) } else { (low, middle) };
        if high - low <= tolerance {
            break;
        }
    }
    pass
}

/// One cycle from touch-down (or from the lowest force) with a given stretch.
fn cycle(contact: &Contact, preload_m: f64, start_m: f64) -> Pass {
    let a = contact.sine_amplitude_m;
    let omega = 2.0 * PI * contact.frequency_hz;
    let pure = contact.motion.second_harmonic == 0.0;
    let alpha = if pure { element::half_contact_angle(preload_m / a) } else { PI };
    let steps = if pure { CONTACT_STEPS } else { CYCLE_STEPS };
    let d_theta = 2.0 * alpha / steps as f64;
    let dt = d_theta / omega;
    let persistent = pure && alpha >= PI;
    let in_plane = contact.motion.in_plane * a * omega;
    let mut spring = Lateral { stretch_m: start_m, dwell_s: if persistent { f64::INFINITY } else { 0.0 } };
    let normal_at = |theta: f64| {
        let z = if pure { theta.cos() } else { wave(&contact.motion, theta) };
        contact.normal_stiffness_n_per_m * (a * z + preload_m)
    };
    let first = normal_at(-alpha).max(0.0);
    let dwell = spring.dwell_s;
    let mut last = (contact.lateral_stiffness_n_per_m * start_m)
        .min(contact.limit.at(contact.friction, first, dwell).max(0.0));
    let (mut sum, mut touching) = (0.0, 0usize);
    for i in 1..=steps {
        let theta = -alpha + i as f64 * d_theta;
        let normal = normal_at(theta);
        let drag = if in_plane == 0.0 {
            contact.speed_m_s
        } else {
            let middle = theta - 0.5 * d_theta;
            contact.speed_m_s + in_plane * (middle + contact.motion.in_plane_phase_rad).cos()
        };
        let force = if normal > 0.0 {
            touching += 1;
            spring.touch(contact, normal, drag, dt)
        } else {
            if pure && i == steps {
                spring.touch(contact, 0.0, drag, dt);
            } else {
                spring.release(contact.recovery, dt);
            }
            0.0
        };
        sum += 0.5 * (last + force) * d_theta;
        last = force;
    }
    if !persistent && pure {
        let away = (2.0 * PI - 2.0 * alpha) / omega;
        spring.stretch_m = contact.recovery.relax(spring.stretch_m, away);
    }
    let contact_share = if pure { alpha / PI } else { touching as f64 / steps as f64 };
    Pass { lateral_n: sum / (2.0 * PI), contact: contact_share, end_m: spring.stretch_m }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::StretchRecovery;

    fn paper(v_r: f64) -> f64 {
        let mut contact = Contact::ideal(3.9e6, 1.5e6, 0.5, 0.5, 2.5e-6, 27_500.0, 0.02);
        contact.recovery = StretchRecovery::Rate(v_r);
        steady(&contact).lateral_force_n / (0.5 * 0.5)
    }

    #[test]
    fn figure_14_recovery_speeds() {
        // physics: w 5 um peak-to-peak, reproduced by an independent time-domain computation.
        for (v_r, expected) in [(1.5e-3, 0.979), (3e-3, 0.858), (5e-3, 0.494), (8e-3, 0.138), (1.0, 0.136)] {
            let got = paper(v_r);
            println!("{v_r} {got}");
            assert!((got - expected).abs() < 2e-1, "v_r {v_r}: {got} against {expected}");
        }
    }
}
