//! One massless elastic element on the vibrating plate: the exact, event-driven cycle.
//!
//! The plate rises and falls as `cos theta`, in units of the sine's amplitude; `theta = 0` is its top. An
//! element pre-pressed by `preload` (same unit) is in contact where `cos theta + preload > 0`. There it sticks,
//! its lateral stretch growing by `drag` a radian, until the friction limit is reached; then it slides, its
//! stretch equal to the limit, until the limit again rises faster than the plate drags. Lost contact unloads the
//! stretch at once. Every event is found by its own equation, so nothing here depends on a step size.
//!
//! Units: normal force in `k_n a`, lateral stretch in `mu k_n a / k_l`. So `drag = k_l U / (mu k_n a omega)`.

use models::root::newton_or_half;
use std::f64::consts::PI;

/// Integrals of one element over one cycle, in radians times the units of this module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Integrals {
    /// Of the normal force.
    pub normal: f64,
    /// Of the lateral force, in units of the friction limit.
    pub lateral: f64,
    /// Angle spent in contact (rad), 0 to 2 pi.
    pub contact: f64,
}

/// Half the angle spent in contact (rad): 0 where the plate never reaches the element, pi where it never leaves.
pub fn half_contact_angle(preload: f64) -> f64 {
    (-preload).clamp(-1.0, 1.0).acos()
}

/// One element's cycle.
///
/// `preload`: static compression over the sine's amplitude. `drag`: see the module; not negative.
pub fn cycle(preload: f64, drag: f64) -> Integrals {
    if preload <= -1.0 {
        return Integrals { normal: 0.0, lateral: 0.0, contact: 0.0 };
    }
    let alpha = half_contact_angle(preload);
    // Integral of the friction limit over [0, theta], and the limit itself.
    let area = |theta: f64| theta.sin() + preload * theta;
    let limit = |theta: f64| theta.cos() + preload;
    let normal = 2.0 * area(alpha);
    let whole = Integrals { normal, lateral: normal, contact: 2.0 * alpha };
    if drag >= 1.0 {
        return whole; // The limit never rises faster than the plate drags.
    }
    let turn = drag.asin(); // The limit's slope equals the drag at -turn and at -pi + turn.
    // Where sticking begins: at touch-down if the limit rises steeply there, else once it does.
    let (start, stretch) = if -alpha >= -turn {
        return whole;
    } else if -alpha > -PI + turn {
        (-alpha, 0.0)
    } else {
        let first = -PI + turn;
        (first, limit(first).max(0.0))
    };
    let slipped_before = area(start) + area(alpha); // area is odd
    let slip = slip_angle(start, stretch, drag, preload, -turn, alpha);
    let stuck = (slip - start) * (stretch + 0.5 * drag * (slip - start));
    let slid = area(alpha) - area(slip);
    Integrals { normal, lateral: slipped_before + stuck + slid, contact: 2.0 * alpha }
}

/// The angle at which a stretch that grows by `drag` from `start` meets the falling excess of the limit.
fn slip_angle(start: f64, stretch: f64, drag: f64, preload: f64, crest: f64, end: f64) -> f64 {
    let excess = |theta: f64| theta.cos() + preload - stretch - drag * (theta - start);
    if excess(end) >= 0.0 {
        return end; // Stuck to the end (only by rounding, or without any drag).
    }
    let look = |theta: f64| {
        let value = excess(theta);
        let sticks = value > 0.0;
        (!sticks, theta + value / (theta.sin() + drag))
    };
    newton_or_half([crest, end], 0.5 * (crest + end), |_| 1e-13, look)
}

/// The preload at which the mean normal force is `mean` (in `k_n a`): root of the cycle's force balance.
pub fn preload_for(mean: f64) -> f64 {
    if mean >= 1.0 {
        return mean; // Never loses contact: the sine averages out.
    }
    if mean <= 0.0 {
        return -1.0;
    }
    // sin(alpha) - alpha cos(alpha) = pi * mean, by Newton from the small-angle solution, in a bracket.
    let target = PI * mean;
    let look = |alpha: f64| {
        let (sin, cos) = alpha.sin_cos();
        let value = sin - alpha * cos - target;
        let light = value < 0.0;
        (!light, alpha - value / (alpha * sin))
    };
    let alpha = newton_or_half([0.0, PI], (3.0 * target).cbrt().min(0.98 * PI), |_| 1e-14, look);
    -alpha.cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_force_balance_is_met_from_grazing_to_full_contact() {
        for mean in [1e-5, 1e-3, 0.05, 0.3, 0.7, 0.999, 1.0, 2.5] {
            let preload = preload_for(mean);
            let got = cycle(preload, 0.3).normal / (2.0 * PI);
            assert!((got / mean - 1.0).abs() < 1e-9, "mean {mean}: {got}");
        }
    }

    #[test]
    fn full_slip_begins_where_the_drag_equals_the_steepest_rise() {
        // Half contact angle under a quarter turn: the steepest rise is at touch-down, sin(alpha).
        let preload = -0.5_f64;
        let edge = half_contact_angle(preload).sin();
        assert_eq!(cycle(preload, edge * 1.000_001).lateral, cycle(preload, edge * 1.000_001).normal);
        assert!(cycle(preload, edge * 0.99).lateral < cycle(preload, 0.0).normal);
    }

    #[test]
    fn without_drag_nothing_is_carried() {
        assert_eq!(cycle(0.1, 0.0).lateral, 0.0);
    }

    #[test]
    fn persistent_contact_follows_popovs_static_limit() {
        // Popov 2020: mu_s = mu0 (1 - alpha) for vanishing speed, alpha the amplitude over the mean indentation.
        let mean = 1.6; // amplitude over indentation 1/1.6
        let got = cycle(preload_for(mean), 1e-7).lateral / cycle(preload_for(mean), 1e-7).normal;
        assert!((got - (1.0 - 1.0 / mean)).abs() < 1e-3, "{got}");
    }
}
