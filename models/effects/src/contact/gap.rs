//! Attraction that reaches across the gap: it pulls the finger down while the plate is away, too.

use crate::contact::{Contact, STILL_PLATE_M, half_contact_angle};
use std::f64::consts::PI;

/// Places in the gap at which the attraction is looked at.
const PLACES: usize = 16;
/// Share of the load by which the balance may be off.
const SETTLED: f64 = 1e-9;

/// Mean force with which the surfaces press on each other, N: the normal force and the mean of an attraction
/// of `force` (N) in contact, which falls as `1/(1 + gap/reach)^2` (`reach` in m).
pub fn carried(c: &Contact, force: f64, reach: f64) -> f64 {
    if force.is_nan() || force <= 0.0 {
        return c.normal_force;
    }
    if c.amplitude_pp < STILL_PLATE_M {
        return c.normal_force + force;
    }
    let unit = c.normal_stiffness * c.half_amplitude() / c.solid_share;
    let span = reach / c.half_amplitude();
    let open = |load: f64| c.normal_force + force * pull(load / unit, span) - load;
    let all = c.normal_force + force;
    models::root::secant(open, [c.normal_force, all], all, SETTLED * all)
}

/// Mean over a cycle of the attraction's share of its value in contact, at a load and a reach in units of the
/// amplitude.
fn pull(load: f64, reach: f64) -> f64 {
    if load >= 1.0 {
        return 1.0;
    }
    let phi = half_contact_angle(load, 0.0);
    let deepest = phi.cos();
    // Equal steps of the root of the phase since lift-off: the attraction falls fast at first.
    let apart: f64 = (0..PLACES)
        .map(|k| {
            let s = (k as f64 + 0.5) / PLACES as f64;
            let gap = deepest - (phi + (PI - phi) * s * s).cos();
            2.0 * s / (1.0 + gap / reach).powi(2)
        })
        .sum();
    (phi + (PI - phi) * apart / PLACES as f64) / PI
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A plate that hardly touches: the mean of `b^2/(b + 1 - cos)^2` is `b^2 (1 + b)/((1 + b)^2 - 1)^(3/2)`
    /// (Gradshteyn and Ryzhik 3.661.4). In full contact, or with a reach without end, all of it is there.
    #[test]
    fn the_mean_across_the_gap_is_the_tabulated_integral() {
        for reach in [0.1, 0.5, 1.0, 3.0, 30.0] {
            let (a, found) = (1.0_f64 + reach, pull(1e-9, reach));
            let closed = reach.powi(2) * a / (a * a - 1.0).powf(1.5);
            assert!((found / closed - 1.0).abs() < 0.01, "{reach}: {found} {closed}");
        }
        assert!(pull(1.0, 0.1) == 1.0 && pull(0.2, 1e9) > 0.999_999);
    }

    /// What is carried balances the normal force and the attraction; in full contact and at rest it is their
    /// sum.
    #[test]
    fn what_is_carried_balances_load_and_attraction() {
        let c = crate::contact::example();
        for (amplitude_pp, reach) in [(3e-6, 3e-7), (6e-6, 1e-6), (2e-6, 1e-8)] {
            let c = Contact { amplitude_pp, ..c };
            let load = carried(&c, 0.2, reach);
            let share = pull(load / (1e6 * c.half_amplitude()), reach / c.half_amplitude());
            assert!((c.normal_force + 0.2 * share - load).abs() < 1e-6, "{load}");
        }
        for amplitude_pp in [0.0, 1e-8] {
            assert!((carried(&Contact { amplitude_pp, ..c }, 0.2, 3e-7) - c.normal_force - 0.2).abs() < 1e-6);
        }
    }
}
