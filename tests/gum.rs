//! Worked examples of the GUM (JCGM 100:2008, annex H) and of its Supplement 1 (JCGM 101:2008).
//!
//! The numbers on the right of each assertion are printed in those documents; they are met to half a unit
//! of their last digit.

use calibration::regression::linear;
use calibration::uncertainty::monte_carlo::monte_carlo;
use calibration::uncertainty::student::coverage_factor;
use calibration::uncertainty::{Budget, Distribution, Input, degrees_of_freedom_of_reliability};
use nalgebra::{DMatrix, DVector};
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;

fn assert_close(got: f64, printed: f64, half_a_digit: f64) {
    assert!((got - printed).abs() <= half_a_digit, "got {got}, printed {printed}");
}

/// H.1, end gauge against a standard, in nanometres and degrees Celsius.
fn end_gauge() -> (Budget, impl Fn(&[f64]) -> f64) {
    let inputs = vec![
        // H.1.3.1: calibration of the standard, U = 0.075 um with k = 3, 18 degrees of freedom.
        Input::normal("standard", 50_000_623.0, 25.0).with_degrees_of_freedom(18.0),
        // H.1.3.2: mean of five comparisons, pooled sd 13 nm over 25 observations; then the comparator's
        // random (0.01 um, t95 over 6 replications) and systematic (0.02 um at 3 sigma, to 25 %) effects.
        Input::normal("difference", 215.0, 5.8).with_degrees_of_freedom(24.0),
        Input::normal("comparator random", 0.0, 3.9).with_degrees_of_freedom(5.0),
        Input::normal("comparator systematic", 0.0, 6.7)
            .with_degrees_of_freedom(degrees_of_freedom_of_reliability(0.25)),
        Input::rectangular("expansion of the standard", 11.5e-6, 2e-6),
        Input::normal("mean bed temperature", -0.1, 0.2),
        Input::arcsine("cyclic temperature", 0.0, 0.5),
        Input::rectangular("difference in expansion", 0.0, 1e-6)
            .with_degrees_of_freedom(degrees_of_freedom_of_reliability(0.10)),
        Input::rectangular("difference in temperature", 0.0, 0.05)
            .with_degrees_of_freedom(degrees_of_freedom_of_reliability(0.50)),
    ];
    // Eq. H.2 with the terms of the temperature split as in H.1.3.4.
    let model = |x: &[f64]| {
        let (theta, d) = (x[5] + x[6], x[1] + x[2] + x[3]);
        x[0] + d - x[0] * (x[7] * theta + x[4] * x[8])
    };
    (Budget::independent(inputs), model)
}

#[test]
fn gum_h1_end_gauge() {
    let (budget, model) = end_gauge();
    let l = budget.propagate(&model);
    assert_close(l.value, 50_000_838.0, 0.5);
    assert_close(l.standard_uncertainty, 32.0, 0.5);
    // H.1.6: 16 effective degrees of freedom, t_99(16) = 2.92, U_99 = 93 nm.
    assert_eq!(l.degrees_of_freedom.floor(), 16.0);
    // (H.1.6 multiplies the rounded 32 nm; unrounded it is 92.5 nm.)
    assert_close(l.expanded(0.99), 93.0, 0.6);
    // Table H.1's last column.
    let part =
        |name: &str| l.contributions.iter().find(|c| c.name == name).map(|c| c.standard_uncertainty).unwrap();
    assert_close(part("standard"), 25.0, 0.5);
    let d = ["difference", "comparator random", "comparator systematic"].map(part);
    assert_close(d.iter().map(|u| u * u).sum::<f64>().sqrt(), 9.7, 0.05);
    assert_close(part("difference in expansion"), 2.9, 0.05);
    assert_close(part("difference in temperature"), 16.6, 0.25); // the GUM rounds u to 0.029 C first
    assert_close(part("expansion of the standard"), 0.0, 1e-3);
    // H.1.7: with the second-order terms 34 nm.
    let second = (l.standard_uncertainty.powi(2) + budget.second_order_variance(&model)).sqrt();
    assert_close(second, 34.0, 0.5);
}

#[test]
fn gum_h1_by_monte_carlo_meets_the_second_order() {
    let (mut budget, model) = end_gauge();
    // The note's formula is for Gaussian inputs, so both sides are given those.
    let gaussian =
        budget.inputs().iter().map(|x| Input { distribution: Distribution::Normal, ..x.clone() }).collect();
    budget = Budget::independent(gaussian);
    let mut rng = ChaCha12Rng::seed_from_u64(1);
    let sampled = monte_carlo(&budget, &model, 400_000, &mut rng).unwrap();
    let first = budget.propagate(&model).standard_uncertainty;
    let expected = (first * first + budget.second_order_variance(&model)).sqrt();
    // The sd of 4e5 draws is itself known to about 0.1 %.
    assert_close(sampled.standard_uncertainty() / expected, 1.0, 0.005);
}

const VOLTS: [f64; 5] = [5.007, 4.994, 5.005, 4.990, 4.999];
const AMPERES: [f64; 5] = [19.663e-3, 19.639e-3, 19.640e-3, 19.685e-3, 19.678e-3];
const RADIANS: [f64; 5] = [1.0456, 1.0438, 1.0468, 1.0428, 1.0433];

#[test]
fn gum_h2_resistance_and_reactance() {
    let budget = Budget::observed_together(&["V", "I", "phi"], &[&VOLTS, &AMPERES, &RADIANS]);
    // Table H.2.
    for (i, (mean, u, half)) in
        [(4.9990, 0.0032, 5e-5), (19.6610e-3, 0.0095e-3, 5e-8), (1.044_46, 0.000_75, 5e-6)].iter().enumerate()
    {
        assert_close(budget.inputs()[i].value, *mean, 5e-5 * mean.abs());
        assert_close(budget.inputs()[i].standard_uncertainty, *u, *half);
    }
    assert_close(budget.correlation()[(0, 1)], -0.36, 0.005);
    assert_close(budget.correlation()[(0, 2)], 0.86, 0.005);
    assert_close(budget.correlation()[(1, 2)], -0.65, 0.005);
    // Table H.3.
    let (results, covariance) =
        budget.propagate_jointly(&[&|x| x[0] / x[1] * x[2].cos(), &|x| x[0] / x[1] * x[2].sin(), &|x| {
            x[0] / x[1]
        }]);
    for (result, (value, u)) in results.iter().zip([(127.732, 0.071), (219.847, 0.295), (254.260, 0.236)]) {
        assert_close(result.value, value, 5e-4);
        // For X, propagation of the unrounded table gives 0.2956 and the direct evaluation of Table H.4
        // 0.2955; the GUM prints 0.295 for both: one unit of tolerance.
        assert_close(result.standard_uncertainty, u, 1e-3);
    }
    let r = |a: usize, b: usize| {
        covariance[(a, b)] / (results[a].standard_uncertainty * results[b].standard_uncertainty)
    };
    assert_close(r(0, 1), -0.588, 5e-4);
    assert_close(r(0, 2), -0.485, 5e-4);
    assert_close(r(1, 2), 0.993, 5e-4);
}

#[test]
fn gum_h3_thermometer() {
    // Table H.6: readings t_k and observed corrections b_k, in degrees Celsius.
    let t = [21.521, 22.012, 22.512, 23.003, 23.507, 23.999, 24.513, 25.002, 25.503, 26.010, 26.511];
    let b = [-0.171, -0.169, -0.166, -0.159, -0.164, -0.165, -0.156, -0.157, -0.159, -0.161, -0.160];
    let design = DMatrix::from_fn(11, 2, |i, j| if j == 0 { 1.0 } else { t[i] - 20.0 });
    let fit = linear::ordinary(&design, &DVector::from_column_slice(&b)).unwrap();
    assert_close(fit.estimates[0], -0.1712, 5e-5);
    assert_close(fit.standard_uncertainty(0), 0.0029, 5e-5);
    assert_close(fit.estimates[1], 0.002_18, 5e-6);
    assert_close(fit.standard_uncertainty(1), 0.000_67, 5e-6);
    assert_close(fit.correlation(0, 1), -0.930, 5e-4);
    assert_close(fit.residual_sd(), 0.0035, 5e-5);
    // H.3.4: the correction predicted at 30 C.
    assert_close(fit.estimates[0] + 10.0 * fit.estimates[1], -0.1494, 5e-5);
    assert_close(fit.standard_uncertainty_along(&[1.0, 10.0]), 0.0041, 5e-5);
    assert_eq!(fit.degrees_of_freedom, 9.0);
}

#[test]
fn supplement_1_mass_calibration() {
    // 9.3 of JCGM 101:2008: a weight against a reference in air; deviation from nominal in milligrams.
    let inputs = vec![
        Input::normal("reference mass", 100_000.0, 0.050),
        Input::normal("added mass", 1.234, 0.020),
        Input::rectangular("air density", 1.2, 0.1),
        Input::rectangular("density of the weight", 8_000.0, 1_000.0),
        Input::rectangular("density of the reference", 8_000.0, 50.0),
    ];
    let budget = Budget::independent(inputs);
    let model = |x: &[f64]| (x[0] + x[1]) * (1.0 + (x[2] - 1.2) * (1.0 / x[3] - 1.0 / x[4])) - 100_000.0;
    let first = budget.propagate(model);
    // Table 6, row GUF1.
    assert_close(first.value, 1.2340, 5e-5);
    assert_close(first.standard_uncertainty, 0.0539, 5e-5);
    let half = coverage_factor(0.95, f64::INFINITY) * first.standard_uncertainty;
    assert_close(first.value - half, 1.1285, 1e-4);
    assert_close(first.value + half, 1.3395, 1e-4);
    // Row GUF2: the next order of the Taylor series matters here.
    let second = (first.standard_uncertainty.powi(2) + budget.second_order_variance(model)).sqrt();
    assert_close(second, 0.0750, 1e-4);
    // Row MCM, with the scatter of two million draws.
    let mut rng = ChaCha12Rng::seed_from_u64(101);
    let sampled = monte_carlo(&budget, model, 2_000_000, &mut rng).unwrap();
    assert_close(sampled.mean(), 1.2341, 3e-4);
    assert_close(sampled.standard_uncertainty(), 0.0754, 3e-4);
    let [low, high] = sampled.shortest_interval(0.95);
    assert_close(low, 1.0834, 3e-3);
    assert_close(high, 1.3825, 3e-3);
}

#[test]
fn correlated_inputs_that_are_not_gaussian_are_refused() {
    let mut budget =
        Budget::independent(vec![Input::rectangular("a", 0.0, 1.0), Input::normal("b", 0.0, 1.0)]);
    budget.correlate(0, 1, 0.5);
    let mut rng = ChaCha12Rng::seed_from_u64(1);
    let error = monte_carlo(&budget, |x| x[0] + x[1], 10_000, &mut rng).unwrap_err();
    assert!(error.to_string().contains("`a` is correlated but not Gaussian"));
}
