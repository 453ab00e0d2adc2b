//! One prediction of the surrogate: the loop's budget is 500 ns, and nothing may be allocated.
//!
//! `cargo bench -p muprime-models --bench surrogate`

use muprime_models::{Condition, FrictionModel, PeakToPeak, Surrogate};
use std::hint::black_box;

#[global_allocator]
static ALLOCATIONS: divan::AllocProfiler = divan::AllocProfiler::system();

fn main() {
    divan::main();
}

#[divan::bench(sample_size = 200)]
fn predict_scattered(bencher: divan::Bencher) {
    let surrogate = Surrogate::shipped().expect("reads");
    // Scattered conditions, so that the table is not all in the first-level cache.
    let conditions: Vec<Condition> = (0..1024)
        .map(|k| {
            let part = |step: f64| (f64::from(k) * step).fract();
            Condition {
                amplitude: PeakToPeak::from_metres(5e-6 * part(0.618)),
                frequency_hz: 10e3 + 90e3 * part(0.755),
                speed_m_s: 0.1 * part(0.570),
                normal_force_n: 0.1 + 0.9 * part(0.325),
                ..Condition::paper()
            }
        })
        .collect();
    let mut k = 0;
    bencher.bench_local(|| {
        k = (k + 1) & 1023;
        surrogate.predict(black_box(&conditions[k]))
    });
}
