//! The inverse analysis on the finite element model: phases made by a finer mesh and a smaller step, with
//! 5 degrees of noise on each reading and ten readings a point as in the paper (section 2.2).

use models::PeakToPeak;
use models::ridge::{PhaseCurves, RidgeCase, RunSettings, Skin, SkinGrid, run};
use muprime_calibration::identify::{Search, identify};
use muprime_calibration::phase::table::PhasePoint;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;

const TRUTH_PA: f64 = 28.3e6;
const NOISE_DEG: f64 = 5.0;
const REPEATS: u32 = 10;
const TRIALS: usize = 100;

fn amplitudes() -> Vec<PeakToPeak> {
    [0.4, 0.6, 0.9, 1.0, 1.1, 1.2, 1.3, 1.45, 1.6, 1.8, 2.1, 2.5]
        .map(|um| PeakToPeak::from_metres(um * 1e-6))
        .into()
}

/// A standard normal number (Box and Muller).
fn normal(random: &mut ChaCha12Rng) -> f64 {
    let (a, b): (f64, f64) = (random.random(), random.random());
    (-2.0 * (1.0 - a).ln()).sqrt() * (2.0 * std::f64::consts::PI * b).cos()
}

#[test]
fn the_modulus_is_found_and_its_interval_covers_the_truth() {
    let amplitudes = amplitudes();
    let base = RidgeCase { elements: 500, ..RidgeCase::paper() };
    let curves =
        PhaseCurves::compute(base, &amplitudes, SkinGrid::elastic((18e6, 45e6), 6), || {}).expect("computed");
    // The data: another mesh, another step.
    let exact: Vec<f64> = amplitudes
        .iter()
        .map(|amplitude| {
            let case = RidgeCase {
                amplitude: *amplitude,
                speed_m_s: 0.0,
                young_modulus_pa: TRUTH_PA,
                elements: 800,
                ..RidgeCase::paper()
            };
            let settings = RunSettings { step_s: Some(5e-9), energy: false, ..RunSettings::default() };
            let phase = run(&case, &settings).expect("runs").phase_shift_deg.expect("it vibrates");
            if phase > 270.0 { phase - 360.0 } else { phase }
        })
        .collect();
    let mesh: Vec<f64> =
        amplitudes.iter().zip(&exact).map(|(w, p)| curves.at(&Skin::elastic(TRUTH_PA), *w) - p).collect();
    println!("phases of the data {exact:.1?}\nmodel less data at the truth {mesh:.1?}");
    let search = Search { lowest_pa: 18e6, highest_pa: 45e6, model_sd_deg: 2.0 };
    let rows = |noise: &mut dyn FnMut() -> f64| -> Vec<PhasePoint> {
        let with = |(amplitude, phase): (&PeakToPeak, &f64)| PhasePoint {
            amplitude: *amplitude,
            phase_shift_deg: (phase + noise()).rem_euclid(360.0),
            phase_shift_sd_deg: Some(NOISE_DEG),
            repeats: Some(REPEATS),
            condition: None,
            frequency_hz: None,
            normal_force_n: None,
        };
        amplitudes.iter().zip(&exact).map(with).collect()
    };
    let (mut covered, mut found) = (0, Vec::new());
    for seed in 0..TRIALS as u64 {
        let mut random = ChaCha12Rng::seed_from_u64(20_260_000 + seed);
        let sd = NOISE_DEG / f64::from(REPEATS).sqrt();
        let data = rows(&mut || sd * normal(&mut random));
        let answer = identify(&data, &search, |e, w| curves.at(&Skin::elastic(e), w)).expect("identified");
        covered += usize::from(answer.ci95_pa[0] <= TRUTH_PA && TRUTH_PA <= answer.ci95_pa[1]);
        found.push(answer.young_modulus_pa / TRUTH_PA - 1.0);
    }
    found.sort_by(f64::total_cmp);
    println!(
        "relative error of the modulus: median {:+.3}, 16 to 84 % {:+.3} to {:+.3}; the 95 % interval covers {covered} of {TRIALS}",
        found[TRIALS / 2],
        found[16 * TRIALS / 100],
        found[84 * TRIALS / 100]
    );
    assert!(covered >= 87, "{covered}");
    assert!(found[TRIALS / 2].abs() < 0.05, "{}", found[TRIALS / 2]);
}
