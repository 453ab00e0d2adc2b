//! Worked examples of the GUM (JCGM 100:2008, annex H).
//!
//! The numbers on the right of each assertion are printed there, and are met to half a unit of their last
//! digit.

use calibration::regression::linear;
use calibration::uncertainty::Input;
use models::pass::{Pass, coulomb_coefficient};
use models::{Condition, PassNoise, PeakToPeak};
use nalgebra::{DMatrix, DVector};

fn assert_close(got: f64, printed: f64, half_a_digit: f64) {
    assert!((got - printed).abs() <= half_a_digit, "got {got}, printed {printed}");
}

const VOLTS: [f64; 5] = [5.007, 4.994, 5.005, 4.990, 4.999];
const AMPERES: [f64; 5] = [19.663e-3, 19.639e-3, 19.640e-3, 19.685e-3, 19.678e-3];
const RADIANS: [f64; 5] = [1.0456, 1.0438, 1.0468, 1.0428, 1.0433];

#[test]
fn gum_h2_type_a_of_repeated_observations() {
    // Table H.2.
    for (observations, mean, u, half) in [
        (VOLTS, 4.9990, 0.0032, 5e-5),
        (AMPERES, 19.6610e-3, 0.0095e-3, 5e-8),
        (RADIANS, 1.044_46, 0.000_75, 5e-6),
    ] {
        let found = Input::type_a(&observations);
        assert_close(found.value, mean, 5e-5 * mean);
        assert_close(found.standard_uncertainty, u, half);
        assert_eq!(found.degrees_of_freedom, 4.0);
    }
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
    let correlation = fit.covariance[(0, 1)] / (fit.standard_uncertainty(0) * fit.standard_uncertainty(1));
    assert_close(correlation, -0.930, 5e-4);
    assert_close(fit.residual_sd(), 0.0035, 5e-5);
    // H.3.4: the correction predicted at 30 C.
    assert_close(fit.estimates[0] + 10.0 * fit.estimates[1], -0.1494, 5e-5);
    assert_close(fit.standard_uncertainty_along(&[1.0, 10.0]), 0.0041, 5e-5);
    assert_eq!(fit.degrees_of_freedom, 9.0);
}

/// Propagation by draws (JCGM 101:2008) for `mu'` and `mu_0` of three references: the scatter of what
/// 20,000 such runs measure is what they state. Before, early passes of a run stated up to 42 % more, by
/// the `mu_0` of their time.
#[test]
fn stated_uncertainties_of_relative_friction_are_those_of_draws() {
    let noise = PassNoise { pass_relative_sd: 0.015, force_sd_n: 0.0008 };
    let mut draw = sim::noise::Noise::new(7, "gum");
    let mut pass = |amplitude_m: f64, load_n: f64, friction_n: f64| {
        let condition = Condition {
            amplitude: PeakToPeak::from_metres(amplitude_m),
            normal_force_n: load_n,
            ..Condition::paper()
        };
        let read =
            friction_n * (1.0 + noise.pass_relative_sd * draw.normal()) + noise.force_sd_n * draw.normal();
        let mut pass = Pass::at(0, &condition, Some(condition.direction.sign() * read));
        pass.normal_force_n = load_n + noise.force_sd_n * draw.normal();
        pass
    };
    let (mu0, mu, load) = (0.5, 0.4, 0.1);
    let (mut found, mut stated) = (Vec::new(), [0.0; 2]);
    let runs = 20_000;
    for _ in 0..runs {
        let still = [0.1, 0.25, 0.25].map(|load| pass(0.0, load, mu0 * load));
        let own = coulomb_coefficient(&still).unwrap();
        let driven = pass(1e-6, load, mu * mu0 * load);
        let relative = driven.friction_force_n().unwrap() / (own * driven.normal_force_n);
        let sd = noise.coulomb_coefficient_sd(own, &still);
        found.push([own, relative]);
        stated[0] += sd / f64::from(runs);
        stated[1] += noise.mu_relative_sd(relative, driven.normal_force_n, [own, sd]) / f64::from(runs);
    }
    for (i, stated) in stated.into_iter().enumerate() {
        let mean = found.iter().map(|f| f[i]).sum::<f64>() / found.len() as f64;
        let scatter = (found.iter().map(|f| (f[i] - mean).powi(2)).sum::<f64>() / found.len() as f64).sqrt();
        assert!((stated / scatter - 1.0).abs() < 0.03, "{i}: stated {stated}, by draws {scatter}");
    }
}
