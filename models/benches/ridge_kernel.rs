//! The element kernel on one core beside the roofline of the same run.
//!
//! `cargo bench -p muprime-models --bench ridge_kernel`. Items are element updates (kernel), elements of the three
//! vectors (triad) or multiply-adds (fma). Compare within one run: the machine may be shared.
#![allow(clippy::disallowed_methods, reason = "it measures time")]

use muprime_models::ridge::{Body, FrictionRule, Material, Plate, RidgeGeometry, Strain, stability};
use pulp::{Simd, WithSimd};
use std::hint::black_box;

fn main() {
    divan::main();
    print_ratios();
}

/// Operations and bytes (fields of nodes and elements once each way) of one update, counted in `kernel.rs`.
const OBJECTIVE: (f64, f64) = (156.0, 184.0);
const SMALL_STRAIN: (f64, f64) = (121.0, 240.0);

/// Least time in s of 60 runs, each short enough to fall between two interruptions.
fn least_seconds(mut run: impl FnMut()) -> f64 {
    let time = |run: &mut dyn FnMut()| {
        let start = std::time::Instant::now();
        run();
        start.elapsed().as_secs_f64()
    };
    (0..60).map(|_| time(&mut run)).fold(f64::INFINITY, f64::min)
}

/// The kernel beside both roofs, all measured here and now.
fn print_ratios() {
    let fma = {
        let rate = (FMA_ROUNDS * FMA_CHAINS * lanes()) as f64;
        2.0 * rate
            / least_seconds(|| {
                black_box(pulp::Arch::new().dispatch(Fma(black_box(0.999_999))));
            })
    };
    let triad = {
        let n = 16 * 1024;
        let (mut a, b, c) = (vec![0.0; n], vec![1.0; n], vec![2.0; n]);
        let seconds = least_seconds(|| pulp::Arch::new().dispatch(Triad(&mut a, &b, &c, 16)));
        24.0 * (16 * n) as f64 / seconds
    };
    println!("roofs: {:.0} GFLOP/s, {:.0} GB/s (triad in the second-level cache)", fma / 1e9, triad / 1e9);
    for (name, strain, (flop, bytes)) in
        [("small strain", Strain::Small, SMALL_STRAIN), ("objective", Strain::Objective, OBJECTIVE)]
    {
        let (mut body, mut plate, dt) = ridge(strain, false);
        let seconds = least_seconds(|| {
            body.advance(dt, 3e5, STEPS, &mut |mut s| {
                plate.touch(&mut s, 1e-8, 0.02);
            });
        });
        let rate = (body.mesh().elements() * STEPS) as f64 / seconds;
        println!(
            "{name}, contact included: {:.0} million updates/s, {:.2} of the multiply-add roof, {:.2} of the triad roof",
            rate / 1e6,
            rate * flop / fma,
            rate * bytes / triad
        );
    }
}

const STEPS: usize = 200;

fn ridge(strain: Strain, viscous: bool) -> (Body, Plate, f64) {
    let mut corneum = Material::elastic(28.3e6, 0.33, 750.0);
    if viscous {
        corneum.retardation_time_s = 1e-6;
    }
    let soft = |young| Material::elastic(young, 0.33, 750.0);
    let built = RidgeGeometry::TABLE_1.mesh(corneum, soft(1.5e6), soft(0.02e6), 1500).expect("Table 1");
    let surface = built.mesh.nx;
    let mut body = Body::new(built.mesh, strain);
    body.hold_top();
    let plate = Plate::new(vec![93e6; surface], FrictionRule::Global, 0.5).expect("valid");
    let dt = stability::stable_step_s(stability::highest_frequency_rad_s(&body, plate.penalty()));
    (body, plate, dt)
}

fn steps(bencher: divan::Bencher, strain: Strain, viscous: bool) {
    let (mut body, mut plate, dt) = ridge(strain, viscous);
    let updates = body.mesh().elements() * STEPS;
    bencher.counter(divan::counter::ItemsCount::new(updates)).bench_local(|| {
        body.advance(dt, 3e5, STEPS, &mut |mut s| {
            plate.touch(&mut s, 1e-8, 0.02);
        });
    });
}

#[divan::bench]
fn kernel_small_strain(bencher: divan::Bencher) {
    steps(bencher, Strain::Small, false);
}

#[divan::bench]
fn kernel_objective(bencher: divan::Bencher) {
    steps(bencher, Strain::Objective, false);
}

#[divan::bench]
fn kernel_objective_viscous(bencher: divan::Bencher) {
    steps(bencher, Strain::Objective, true);
}

/// a = b + s c with all three in the first-level cache: 16 bytes read and 8 written an item.
#[divan::bench]
fn roofline_triad_l1(bencher: divan::Bencher) {
    triad(bencher, 1024);
}

/// The same in the second-level cache, where the fields of 1500 elements live.
#[divan::bench]
fn roofline_triad_l2(bencher: divan::Bencher) {
    triad(bencher, 16 * 1024);
}

fn triad(bencher: divan::Bencher, n: usize) {
    let (mut a, b, c) = (vec![0.0; n], vec![1.0; n], vec![2.0; n]);
    let repeats = (1 << 20) / n;
    bencher.counter(divan::counter::ItemsCount::new(n * repeats)).bench_local(|| {
        pulp::Arch::new().dispatch(Triad(&mut a, &b, &c, repeats));
        black_box(&a);
    });
}

/// Independent multiply-adds from registers: the peak of arithmetic. Two operations an item.
#[divan::bench]
fn roofline_fma(bencher: divan::Bencher) {
    let lanes = lanes();
    bencher
        .counter(divan::counter::ItemsCount::new(FMA_ROUNDS * FMA_CHAINS * lanes))
        .bench_local(|| pulp::Arch::new().dispatch(Fma(black_box(0.999_999))));
}

struct Triad<'a>(&'a mut [f64], &'a [f64], &'a [f64], usize);
impl WithSimd for Triad<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let scale = simd.splat_f64s(1.000_1);
        for _ in 0..self.3 {
            let a = S::as_mut_simd_f64s(black_box(&mut *self.0)).0;
            let (b, c) = (S::as_simd_f64s(self.1).0, S::as_simd_f64s(self.2).0);
            for ((a, b), c) in a.iter_mut().zip(b).zip(c) {
                *a = simd.mul_add_f64s(scale, *c, *b);
            }
        }
    }
}

const FMA_ROUNDS: usize = 20_000;
const FMA_CHAINS: usize = 12;
struct Fma(f64);
impl WithSimd for Fma {
    type Output = f64;
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f64 {
        let (m, c) = (simd.splat_f64s(self.0), simd.splat_f64s(1e-9));
        let mut chain = [simd.splat_f64s(1.0); FMA_CHAINS];
        for _ in 0..FMA_ROUNDS {
            for v in &mut chain {
                *v = simd.mul_add_f64s(*v, m, c);
            }
        }
        chain.iter().map(|v| simd.reduce_sum_f64s(*v)).sum()
    }
}
/// Values in a vector.
fn lanes() -> usize {
    struct Width;
    impl WithSimd for Width {
        type Output = usize;
        #[inline(always)]
        fn with_simd<S: Simd>(self, _: S) -> usize {
            S::F64_LANES
        }
    }
    pulp::Arch::new().dispatch(Width)
}
