//! The slider's quick roots against plain bisection and its uncertainty against separate solutions, over the
//! whole range of conditions: the same within 1e-10.

use muprime_models::spring_slider::{half_contact_angle_rad, solve};
use muprime_models::{Condition, Finger, FrictionModel, PeakToPeak, SpringSlider};
use std::f64::consts::PI;

/// Halves the bracket until nothing is left of it.
fn bisect(f: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if (f(middle) > 0.0) == (f(high) > 0.0) { high = middle } else { low = middle }
    }
    0.5 * (low + high)
}

/// Conditions and fingers spread evenly over the range of use (a Kronecker sequence).
fn scattered(count: u32) -> impl Iterator<Item = (Condition, Finger)> {
    (1..=count).map(|n| {
        let part = |d: i32| (0.5 + f64::from(n) / 1.096_982_0_f64.powi(d + 1)).fract();
        let between = |d: i32, low: f64, high: f64| low * (high / low).powf(part(d));
        let condition = Condition {
            amplitude: PeakToPeak::from_metres(between(0, 0.02e-6, 10e-6)),
            frequency_hz: between(1, 5e3, 200e3),
            speed_m_s: between(2, 1e-4, 2.0),
            normal_force_n: between(3, 0.02, 5.0),
            mu0: between(4, 0.05, 3.0),
            ..Condition::paper()
        };
        let finger = Finger {
            normal_stiffness_n_per_m: between(5, 0.2e6, 8e6),
            lateral_stiffness_n_per_m: between(6, 0.1e6, 4e6),
            stiffness_relative_sd: 0.05,
            lateral_recovery_m_per_s: (n % 3 == 0).then(|| between(7, 1e-4, 1.0)),
            ..Finger::paper()
        };
        (condition, finger)
    })
}

#[test]
fn contact_angles_are_those_of_bisection() {
    for k in 1..20_000 {
        // From contact of a thousandth of a turn to contact all but never lost.
        let ratio = (f64::from(k) / 20_000.0).powi(3);
        let exact = bisect(|a| a.sin() - a * a.cos() - PI * ratio, 0.0, PI);
        let angle = half_contact_angle_rad(ratio);
        // Below a hundredth of a radian the plain formula above loses its digits, not the solver.
        let tolerance = if angle < 0.05 { 1e-8 } else { 1e-10 };
        assert!((angle - exact).abs() < tolerance, "{ratio}: {angle} and {exact}");
    }
}

#[test]
fn friction_is_that_of_the_closed_form_with_bisected_roots() {
    let mut compared = 0;
    for (c, finger) in scattered(20_000).filter(|(_, f)| f.lateral_recovery_m_per_s.is_none()) {
        let a = c.amplitude.sine_amplitude_m();
        let ratio = c.normal_force_n / finger.normal_stiffness_n_per_m / a;
        if !(1e-4..1.0).contains(&ratio) {
            continue;
        }
        let alpha = bisect(|x| x.sin() - x * x.cos() - PI * ratio, 0.0, PI);
        let kappa = finger.lateral_stiffness_n_per_m * c.speed_m_s
            / (2.0 * PI * c.frequency_hz * c.mu0 * finger.normal_stiffness_n_per_m * a);
        // Sticks at touch-down and slips once: the lateral force is a line, then the limit (Eqs. 11 and 12).
        if alpha > PI / 2.0 || kappa > 0.999 * alpha.sin() {
            continue;
        }
        let below = |phi: f64| phi.cos() - alpha.cos() - kappa * (phi + alpha);
        let slip = bisect(below, -kappa.asin(), alpha);
        let stuck = 0.5 * kappa * (slip + alpha).powi(2);
        let slid = alpha.sin() - slip.sin() - alpha.cos() * (alpha - slip);
        let mu_relative = (stuck + slid) / (2.0 * PI * ratio);
        let cycle = solve(&c, &finger).expect("inside");
        assert!((cycle.mu_relative - mu_relative).abs() < 1e-10, "{c:?} {finger:?}: {mu_relative}");
        compared += 1;
    }
    assert!(compared > 1_000, "{compared}");
}

#[test]
fn the_uncertainty_is_that_of_separate_solutions() {
    let mut above_zero = 0;
    for (c, finger) in scattered(20_000) {
        let at = |kn: f64, kl: f64| {
            let finger = Finger {
                normal_stiffness_n_per_m: finger.normal_stiffness_n_per_m * kn,
                lateral_stiffness_n_per_m: finger.lateral_stiffness_n_per_m * kl,
                ..finger
            };
            solve(&c, &finger).expect("inside").mu_relative
        };
        let normal = 0.5 * (at(1.05, 1.0) - at(0.95, 1.0));
        let lateral = 0.5 * (at(1.0, 1.05) - at(1.0, 0.95));
        let prediction = SpringSlider::new(finger).expect("a finger").predict(&c).expect("inside");
        let apart = (prediction.mu_relative_sd - normal.hypot(lateral)).abs();
        assert!(apart < 1e-10, "{c:?} {finger:?}: {apart}");
        assert_eq!(prediction.mu_relative, at(1.0, 1.0));
        above_zero += u32::from(prediction.mu_relative_sd > 0.0);
    }
    assert!(above_zero > 10_000, "{above_zero}");
}
