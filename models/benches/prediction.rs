//! The spring-slider's prediction with its uncertainty, beside the five separate solutions that it stands for.
//!
//! `cargo bench -p muprime-models --bench prediction`

use muprime_models::inverse::quick;
use muprime_models::law_table::LawTable;
use muprime_models::law_table::grid::LawGrid;
use muprime_models::prediction::{EmpiricalPsi, FrictionModel, SpringSlider};
use muprime_models::spring_slider::{half_contact_angle_rad, solve};
use muprime_models::{Condition, Finger, PeakToPeak, Surrogate};
use std::f64::consts::PI;
use std::hint::black_box;

fn main() {
    divan::main();
}

fn finger() -> Finger {
    Finger { stiffness_relative_sd: 0.05, ..Finger::paper() }
}

#[divan::bench]
fn spring_slider(bencher: divan::Bencher) {
    let law = SpringSlider::new(finger()).expect("a finger");
    bencher.bench_local(|| law.predict(black_box(&Condition::paper())));
}

#[divan::bench]
fn spring_slider_in_five_solutions(bencher: divan::Bencher) {
    bencher.bench_local(|| {
        [(1.0, 1.0), (1.05, 1.0), (0.95, 1.0), (1.0, 1.05), (1.0, 0.95)].map(|(kn, kl)| {
            let finger = Finger {
                normal_stiffness_n_per_m: kn * finger().normal_stiffness_n_per_m,
                lateral_stiffness_n_per_m: kl * finger().lateral_stiffness_n_per_m,
                ..finger()
            };
            solve(black_box(&Condition::paper()), &finger)
        })
    });
}

fn table() -> LawTable {
    let words =
        ["amplitude_pp_m=0.2e-6..6e-6:25:log", "frequency_hz=20e3..60e3:5", "speed_m_s=0.002..0.2:13:log"];
    let grid = LawGrid::parse(words.into_iter().chain(["normal_force_n=0.1..1:7:log", "mu0=0.2..1:3"]))
        .expect("a grid");
    let mu = |c: &Vec<f64>| [1.0 / (1.0 + c[0] * c[1] * c[4] / c[2]), 0.02];
    let answers: Vec<_> = grid.conditions(0).iter().map(mu).collect();
    LawTable::from_csv(&grid.table(0, &answers).expect("a table").csv).expect("a law")
}

/// A law table of five variables with its uncertainty, at scattered conditions: its time over the
/// spring-slider's is the ratio that counts.
#[divan::bench(sample_size = 200)]
fn law_table(bencher: divan::Bencher) {
    let law = table();
    let conditions: Vec<Condition> = (0..1024)
        .map(|k| {
            let part = |step: f64| (f64::from(k) * step).fract();
            Condition {
                amplitude: PeakToPeak::from_metres(0.3e-6 + 5e-6 * part(0.618)),
                frequency_hz: 21e3 + 38e3 * part(0.755),
                speed_m_s: 0.003 + 0.15 * part(0.570),
                normal_force_n: 0.15 + 0.8 * part(0.325),
                ..Condition::paper()
            }
        })
        .collect();
    let mut k = 0;
    bencher.bench_local(|| {
        k = (k + 1) & 1023;
        law.predict(black_box(&conditions[k]))
    });
}

/// The law turned round as the loop does it: a grating of 50 cycles a period, each answer warm from the one
/// before.
fn inverse(bencher: divan::Bencher, law: &dyn FrictionModel) {
    let wanted: Vec<f64> = (0..50).map(|k| 0.6 + 0.15 * (2.0 * PI * f64::from(k) / 50.0).sin()).collect();
    let (mut k, mut last) = (0, None);
    bencher.bench_local(|| {
        k = (k + 1) % wanted.len();
        let found = quick(
            law,
            black_box(&Condition::paper()),
            wanted[k],
            PeakToPeak::from_metres(8e-6),
            last.as_ref(),
        );
        last = found.or(last);
        found
    });
}

#[divan::bench(sample_size = 200)]
fn inverse_spring_slider(bencher: divan::Bencher) {
    inverse(bencher, &SpringSlider::new(finger()).expect("a finger"));
}

#[divan::bench(sample_size = 200)]
fn inverse_psi(bencher: divan::Bencher) {
    inverse(bencher, &EmpiricalPsi::paper(finger()).expect("a finger"));
}

#[divan::bench(sample_size = 200)]
fn inverse_surrogate(bencher: divan::Bencher) {
    inverse(bencher, &Surrogate::shipped().expect("the shipped table").for_finger(&finger()));
}

/// A finger that recovers slowly: each evaluation seeks a cycle that repeats itself.
#[divan::bench(sample_size = 200)]
fn inverse_recovering_spring_slider(bencher: divan::Bencher) {
    let finger = Finger { lateral_recovery_m_per_s: Some(5e-3), ..finger() };
    inverse(bencher, &SpringSlider::new(finger).expect("a finger"));
}

#[divan::bench(sample_size = 200)]
fn inverse_law_table(bencher: divan::Bencher) {
    inverse(bencher, &table());
}

#[divan::bench]
fn contact_angle(bencher: divan::Bencher) {
    bencher.bench_local(|| half_contact_angle_rad(black_box(0.064)));
}
