//! Order of convergence of mu' with the mesh and with the time step, by Richardson's method on three levels.
//!
//! One case is not enough: single contact nodes that switch move mu' by some 0.003, as much as the step from the middle
//! mesh to the fine one. So the differences of several cases are pooled (root mean square: with the step their sign
//! varies) before the order is formed; its standard uncertainty is the jackknife's over the cases.

use muprime_models::ridge::{RidgeCase, RunSettings, run};
use rayon::prelude::*;

/// Two moduli and four amplitudes at which contact is lost and won again, each with its own contact width.
fn cases() -> Vec<RidgeCase> {
    let with = |young_modulus_pa: f64, um: f64| {
        RidgeCase { young_modulus_pa, ..RidgeCase::paper() }.with_amplitude_pp_m(um * 1e-6)
    };
    let all = [100e6, 200e6].iter().flat_map(|e| [1.2, 1.9, 2.7, 3.6].map(|um| with(*e, um)));
    // By default four of the eight, each amplitude once: the finest levels take most of the time.
    let long = std::env::var_os("MUPRIME_LONG").is_some();
    all.enumerate().filter(|(i, _)| long || [0, 2, 5, 7].contains(i)).map(|(_, case)| case).collect()
}

/// mu' of the steady state, the elements and the step of the run.
fn mu(case: &RidgeCase, settings: &RunSettings) -> (f64, usize, f64) {
    let result = run(case, settings).expect("runs");
    assert!(result.steady, "not steady: {case:?}");
    (result.mu_relative, result.elements, result.step_s)
}

/// Three levels of one case, printed.
fn printed(case: &RidgeCase, levels: [f64; 3]) -> [f64; 3] {
    let (mpa, um) = (case.young_modulus_pa / 1e6, case.amplitude.micrometres());
    println!("{mpa:.0} MPa, {um:.1} um: mu' {:.5} {:.5} {:.5}", levels[0], levels[1], levels[2]);
    levels
}

/// What three levels of several cases say.
struct Order {
    /// Order, and its jackknife deviation.
    value: f64,
    sd: f64,
    /// Root mean square of the finer difference.
    finer: f64,
    /// What Richardson's extrapolation leaves to the limit, from the coarse, the middle and the fine level.
    left: [f64; 3],
}

/// From levels whose sizes have the ratio `ratio`.
fn order(levels: &[[f64; 3]], ratio: f64) -> Order {
    let pooled = |without: Option<usize>| {
        let rest: Vec<_> = levels.iter().enumerate().filter(|(i, _)| Some(*i) != without).collect();
        let rms = |k: usize| {
            (rest.iter().map(|(_, l)| (l[k] - l[k + 1]).powi(2)).sum::<f64>() / rest.len() as f64).sqrt()
        };
        (rms(0), rms(1))
    };
    let of = |(coarse, fine): (f64, f64)| (coarse / fine).ln() / ratio.ln();
    let n = levels.len() as f64;
    let parts: Vec<f64> = (0..levels.len()).map(|i| of(pooled(Some(i)))).collect();
    let mean = parts.iter().sum::<f64>() / n;
    let sd = ((n - 1.0) / n * parts.iter().map(|p| (p - mean).powi(2)).sum::<f64>()).sqrt();
    let (value, finer) = (of(pooled(None)), pooled(None).1);
    let growth = ratio.powf(value);
    let left = [2, 1, 0].map(|k| finer * growth.powi(k) / (growth - 1.0));
    Order { value, sd, finer, left }
}

#[test]
fn order_with_the_mesh() {
    let mut ratio = f64::NAN;
    let cases = cases();
    let at = |case: &RidgeCase| {
        [200, 800, 3200].map(|elements| mu(&RidgeCase { elements, ..*case }, &RunSettings::default()))
    };
    let runs: Vec<_> = cases.par_iter().map(at).collect();
    let mut levels = Vec::new();
    for (case, runs) in cases.iter().zip(runs) {
        // Of the element's size, which goes with the root of their number.
        ratio = (runs[2].1 as f64 / runs[0].1 as f64).powf(0.25);
        levels.push(printed(case, runs.map(|run| run.0)));
    }
    let found = order(&levels, ratio);
    println!(
        "order with the mesh: {:.2} +- {:.2} (size ratio {ratio:.3}); finer difference {:.4} rms; left to the limit {:.4} \
         at 3200 elements, {:.4} at 800",
        found.value, found.sd, found.finer, found.left[2], found.left[1]
    );
    // Faster than first order, and no faster than the element and the switching of single nodes let one see.
    assert!(found.value - 2.0 * found.sd > 1.0 && found.value < 4.0, "{} +- {}", found.value, found.sd);
    assert!(found.left[1] < 0.01);
}

#[test]
fn order_with_the_step() {
    let levels: Vec<[f64; 3]> = cases()
        .par_iter()
        .map(|case| {
            let case = RidgeCase { elements: 200, ..*case };
            // One step for all layers: the longer ones and the added mass are compared with it elsewhere.
            let plain = RunSettings { one_step: true, added_mass: 0.0, ..RunSettings::default() };
            let (own, _, step) = mu(&case, &plain);
            let with = |part: f64| mu(&case, &RunSettings { step_s: Some(part * step), ..plain }).0;
            printed(&case, [own, with(0.5), with(0.25)])
        })
        .collect();
    let found = order(&levels, 2.0);
    println!(
        "order with the step: {:.2} +- {:.2}; finer difference {:.5} rms; left to the limit {:.5} at the default step",
        found.value, found.sd, found.finer, found.left[0]
    );
    assert!(found.value - 2.0 * found.sd > 0.0, "{} +- {}", found.value, found.sd);
    assert!(found.finer < 5e-4, "the step is nothing beside the mesh");
}
