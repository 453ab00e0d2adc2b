//! The spring-slider's prediction with its uncertainty, beside the five separate solutions that it stands for.
//!
//! `cargo bench -p muprime-models --bench prediction`

use muprime_models::condition::Condition;
use muprime_models::finger::Finger;
use muprime_models::prediction::{FrictionModel, SpringSlider};
use muprime_models::spring_slider::{half_contact_angle_rad, solve};
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

#[divan::bench]
fn contact_angle(bencher: divan::Bencher) {
    bencher.bench_local(|| half_contact_angle_rad(black_box(0.064)));
}

/// The same root by the bracketing method, which needs no derivative.
#[divan::bench]
fn contact_angle_bracketed(bencher: divan::Bencher) {
    bencher.bench_local(|| {
        let target = PI * black_box(0.064);
        muprime_models::root::bracketed(|a| a.sin() - a * a.cos() - target, 0.0, PI)
    });
}
