//! The comparison against passes whose truth is known.
#![allow(clippy::disallowed_types)]

use super::*;
use models::{Direction, Finger, PeakToPeak, SpringSlider};

const NOISE: PassNoise = PassNoise { pass_relative_sd: 0.015, force_sd_n: 0.0008 };
const MU0: f64 = 0.5;

/// Normal deviates of a linear congruential generator, by the sum of twelve.
struct Deviates(u64);

impl Deviates {
    fn normal(&mut self) -> f64 {
        let mut uniform = || {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 11) as f64 / (1u64 << 53) as f64
        };
        (0..12).map(|_| uniform()).sum::<f64>() - 6.0
    }
}

/// Passes over amplitudes and directions, with a reference without vibration before every sixth.
fn sweep(passes: u32) -> Vec<Condition> {
    let amplitudes = [1e-6, 2e-6, 3e-6, 0.6e-6, 1.5e-6, 2.5e-6];
    (0..passes)
        .flat_map(|i| {
            let direction = if i % 2 == 0 { Direction::Forward } else { Direction::Backward };
            let with = |amplitude| Condition { amplitude, direction, ..Condition::paper() };
            let reference = (i % 6 == 0).then(|| with(PeakToPeak::ZERO));
            reference.into_iter().chain([with(PeakToPeak::from_metres(amplitudes[(i % 6) as usize]))])
        })
        .collect()
}

/// The comparisons of a sweep whose friction is `force(prediction of mu', amplitude)`, with the stated noise.
fn compared(
    conditions: &[Condition],
    seed: u64,
    mu_relative: impl Fn(f64, PeakToPeak) -> f64,
) -> Vec<PassComparison> {
    compared_with(Finger::paper(), conditions, seed, mu_relative)
}

fn compared_with(
    finger: Finger,
    conditions: &[Condition],
    seed: u64,
    mu_relative: impl Fn(f64, PeakToPeak) -> f64,
) -> Vec<PassComparison> {
    let model = SpringSlider::new(finger).unwrap();
    let mut comparator = Comparator::new(&model, 0.45, NOISE);
    let mut draw = Deviates(seed);
    conditions
        .iter()
        .map(|c| {
            let predicted = model.predict(c).unwrap().mu_relative;
            let force = MU0 * c.normal_force_n * mu_relative(predicted, c.amplitude);
            let measured =
                force * (1.0 + NOISE.pass_relative_sd * draw.normal()) + NOISE.force_sd_n * draw.normal();
            comparator.pass(&model, c, measured).unwrap()
        })
        .collect()
}

/// On the old code the first such pass had z = 73, the filter took it up, and the run ended with 'agrees'.
#[test]
fn friction_that_never_falls_is_a_departure_at_the_first_passes_with_vibration() {
    let passes = compared(&sweep(6), 1, |_, _| 1.0);
    let first = passes.iter().position(|p| p.departed).expect("a departure");
    assert!(first <= 3, "departed at pass {first} only");
    assert_eq!(Agreement::of(passes.last(), true), Agreement::Departed);
}

#[test]
fn a_model_that_holds_agrees_after_enough_passes_and_not_before() {
    for seed in 0..40 {
        let passes = compared(&sweep(24), 100 + seed, |mu, _| mu);
        let after = |n: usize, complete| Agreement::of(passes[..n].last(), complete);
        assert!(matches!(after(28, true), Agreement::Agrees { judged: 24, .. }), "{:?}", after(28, true));
        assert!(matches!(after(28, false), Agreement::TooLittle { why: Lack::Unfinished, .. }));
        assert!(matches!(after(4, true), Agreement::TooLittle { why: Lack::Passes, .. }));
    }
    assert!(matches!(Agreement::of(None, true), Agreement::TooLittle { why: Lack::Passes, judged: 0, .. }));
}

#[test]
fn scatter_beyond_the_stated_noise_is_no_agreement() {
    let mut draw = Deviates(77);
    let jitter: Vec<f64> = (0..64).map(|_| 1.0 + 0.04 * draw.normal()).collect();
    let next = std::cell::Cell::new(0);
    let passes = compared(&sweep(24), 5, |mu, _| {
        next.set(next.get() + 1);
        mu * jitter[next.get()]
    });
    assert!(!matches!(Agreement::of(passes.last(), true), Agreement::Agrees { .. }));
}

/// The departure that is reported as visible is seen nine times in ten; a third of it much more rarely.
#[test]
fn the_stated_power_is_what_simulated_departures_show() {
    power_of(&sweep(24), Finger::paper());
}

/// Stiffnesses that are known to 5 % take up a part of a common deviation, and what is left of it changes
/// its sign with the amplitude: the bet on a common shift alone saw 0.052 here, and half of runs showed a
/// third of it.
#[test]
fn the_power_is_that_of_the_bet_that_sees_most() {
    let finger = Finger { stiffness_relative_sd: 0.05, ..Finger::paper() };
    let conditions: Vec<Condition> = [0.005, 0.01, 0.03, 0.08]
        .iter()
        .flat_map(|speed| sweep(12).into_iter().map(|c| Condition { speed_m_s: *speed, ..c }))
        .collect();
    power_of(&conditions, finger);
}

fn power_of(conditions: &[Condition], finger: Finger) {
    let visible = compared_with(finger, conditions, 1, |mu, _| mu).last().unwrap().visible_departure.unwrap();
    assert!(visible < VISIBLE_DEPARTURE, "{visible}");
    let seen = |departure: f64| {
        let run = |seed: u64| {
            let with = |mu, w: PeakToPeak| if w > PeakToPeak::ZERO { mu + departure } else { mu };
            compared_with(finger, conditions, 1000 + seed, with).last().is_some_and(|p| p.departed)
        };
        (0..400u64).filter(|s| run(*s)).count() as f64 / 400.0
    };
    let (whole, third, none) = (seen(visible), seen(visible / 3.0), seen(0.0));
    println!("a departure of {visible:.4}: seen in {whole:.3}; a third of it {third:.3}; none {none:.4}");
    assert!(whole >= 0.87, "{whole}");
    assert!(third < 0.6 && none <= 0.0125, "{third} {none}");
}
