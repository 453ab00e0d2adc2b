//! Normal and lateral stiffness, quasi-static and at ultrasonic frequencies.

use super::{FingerError, enough};
use crate::regression::{ends, linear};
use crate::uncertainty::student::coverage_factor;
use nalgebra::{DMatrix, DVector};

/// A stiffness about a point of load.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stiffness {
    /// Stiffness in N/m with its standard uncertainty (statistics and scale).
    pub value_n_per_m: [f64; 2],
    /// Ratio of lost to stored force amplitude, with its standard uncertainty.
    pub loss_tangent: [f64; 2],
    /// Relative standard uncertainty of force over displacement scale, contained in the first.
    pub scale_relative_sd: f64,
    /// Degrees of freedom, effective.
    pub degrees_of_freedom: f64,
    /// Range of displacement or of amplitude (zero-to-peak) in m.
    pub range_m: [f64; 2],
    /// Residual standard deviation in N.
    pub residual_sd_n: f64,
    /// Largest residual in N.
    pub largest_residual_n: f64,
    /// Number of points.
    pub points: usize,
}

/// Tangent stiffness about `at_m` from a slow loading and unloading loop: displacement, force, and whether
/// the load was going up. The curve may bend (a quadratic is fitted); the loop's opening gives the loss.
/// `scale_relative_sd` is what force and displacement calibrations leave, common to all points.
///
/// # Errors
/// Fewer than eight points, no convergence, a negative stiffness.
pub fn quasi_static(
    points: &[(f64, f64, bool)],
    at_m: f64,
    scale_relative_sd: f64,
) -> Result<Stiffness, FingerError> {
    enough("points of the loop", points.len(), 8)?;
    let range_m = ends(points.iter().map(|p| p.0));
    let (middle, half) = (0.5 * (range_m[0] + range_m[1]), 0.5 * (range_m[1] - range_m[0]));
    let both = points.iter().any(|p| p.2) && points.iter().any(|p| !p.2);
    let columns = if both { 4 } else { 3 };
    let design = DMatrix::from_fn(points.len(), columns, |i, k| {
        let (x, _, up) = points[i];
        let loop_shape = (1.0 - ((x - middle) / half).powi(2)).max(0.0).sqrt() * if up { 1.0 } else { -1.0 };
        [1.0, x - at_m, (x - at_m).powi(2), loop_shape][k]
    });
    let fit = linear::ordinary(&design, &DVector::from_iterator(points.len(), points.iter().map(|p| p.1)))?;
    let k = fit.estimates[1];
    if k <= 0.0 {
        return Err(FingerError::Negative("quasi-static"));
    }
    // The loop of a linear viscoelastic finger is an ellipse of half height k half tan(delta).
    let per_height = 1.0 / (k * half);
    let loss_tangent = match both {
        true => [(per_height * fit.estimates[3]).abs(), per_height * fit.standard_uncertainty(3)],
        false => [0.0; 2],
    };
    let statistical = fit.standard_uncertainty(1);
    let u = statistical.hypot(k * scale_relative_sd);
    Ok(Stiffness {
        value_n_per_m: [k, u],
        loss_tangent,
        scale_relative_sd,
        degrees_of_freedom: fit.degrees_of_freedom * (u / statistical).powi(4),
        range_m,
        residual_sd_n: fit.residual_sd(),
        largest_residual_n: fit.residuals.amax(),
        points: points.len(),
    })
}

/// One point of an ultrasonic measurement in full contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UltrasonicPoint {
    /// Sine amplitude (zero-to-peak) of the plate's displacement in m.
    pub amplitude_m: f64,
    /// Amplitude of the force in phase with the displacement in N.
    pub in_phase_n: f64,
    /// Amplitude of the force a quarter period ahead of the displacement in N.
    pub quadrature_n: f64,
}

/// Dynamic stiffness from force against displacement amplitude, in full contact under `normal_force_n`.
/// For the lateral stiffness the plate moves in its plane; contact is then not lost and the check is left
/// out by giving an infinite normal force.
///
/// # Errors
/// Fewer than four points, contact lost, a negative stiffness.
pub fn ultrasonic(
    points: &[UltrasonicPoint],
    normal_force_n: f64,
    scale_relative_sd: f64,
) -> Result<Stiffness, FingerError> {
    let n = points.len();
    enough("amplitudes", n, 4)?;
    let design = DMatrix::from_fn(n, 1, |i, _| points[i].amplitude_m);
    let part = |f: &dyn Fn(&UltrasonicPoint) -> f64| {
        linear::ordinary(&design, &DVector::from_iterator(n, points.iter().map(f)))
    };
    let stored = part(&|p| p.in_phase_n)?;
    let lost = part(&|p| p.quadrature_n)?;
    let (k, loss) = (stored.estimates[0], lost.estimates[0]);
    if k <= 0.0 {
        return Err(FingerError::Negative("ultrasonic"));
    }
    let range_m = ends(points.iter().map(|p| p.amplitude_m));
    let limit_m = normal_force_n / k.hypot(loss);
    if range_m[1] > limit_m {
        return Err(FingerError::ContactLost { amplitude_pp_m: 2.0 * range_m[1], limit_m });
    }
    let (us, ul) = (stored.standard_uncertainty(0), lost.standard_uncertainty(0));
    if loss + coverage_factor(0.95, lost.degrees_of_freedom) * ul < 0.0 {
        return Err(FingerError::NegativeLoss);
    }
    let u = us.hypot(k * scale_relative_sd);
    Ok(Stiffness {
        value_n_per_m: [k, u],
        loss_tangent: [loss / k, (ul / k).hypot(loss * us / (k * k))],
        scale_relative_sd,
        degrees_of_freedom: stored.degrees_of_freedom * (u / us).powi(4),
        range_m,
        residual_sd_n: stored.residual_sd().hypot(lost.residual_sd()),
        largest_residual_n: stored.residuals.amax().max(lost.residuals.amax()),
        points: n,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_loop_gives_stiffness_and_loss() {
        let (k, d, half) = (1_000.0, 0.1, 1e-4);
        let points: Vec<(f64, f64, bool)> = (0..80)
            .map(|i| {
                let angle = 2.0 * std::f64::consts::PI * f64::from(i) / 80.0;
                let x = half * angle.cos();
                let noise = 1e-5 * [1.0, -1.0, -1.0, 1.0, 0.5][i as usize % 5];
                (x, k * x - k * d * half * angle.sin() + noise, angle.sin() < 0.0)
            })
            .collect();
        let found = quasi_static(&points, 0.0, 0.0).unwrap();
        assert!((found.value_n_per_m[0] / k - 1.0).abs() < 0.01, "{found:?}");
        assert!((found.loss_tangent[0] / d - 1.0).abs() < 0.01);
    }

    #[test]
    fn the_loss_of_an_ellipse_does_not_depend_on_where_it_was_sampled() {
        let (k, d, half) = (2_000.0, 0.1, 2e-4);
        let in_time = |i: i32| (std::f64::consts::PI * (f64::from(i) + 0.5) / 50.0).cos();
        let in_place = |i: i32| f64::from(i) / 24.5 - 1.0;
        for place in [&in_time as &dyn Fn(i32) -> f64, &in_place] {
            let points: Vec<(f64, f64, bool)> = (0..100)
                .map(|i| {
                    let (x, up) = (half * place(i % 50), i < 50);
                    let opening = k * d * (half * half - x * x).max(0.0).sqrt();
                    let noise = 1e-5 * [1.0, -1.0, -1.0, 1.0, 0.5][i as usize % 5];
                    (x, k * x + if up { opening } else { -opening } + noise, up)
                })
                .collect();
            let [found, u] = quasi_static(&points, 0.0, 0.0).unwrap().loss_tangent;
            // The largest place of a loop sampled in time is 0.05 % short of the half travel.
            assert!((found - d).abs() < 2.0 * u + 1e-3 * d && u < 0.01 * d, "{found} +- {u}");
        }
    }

    #[test]
    fn ultrasonic_stiffness_is_refused_once_contact_is_lost() {
        let points: Vec<UltrasonicPoint> = (1..=8)
            .map(|i| {
                let a = f64::from(i) * 1e-8;
                let noise = 1e-4 * [1.0, -1.0][i as usize % 2];
                UltrasonicPoint {
                    amplitude_m: a,
                    in_phase_n: 3.9e6 * a + noise,
                    quadrature_n: 1e6 * a - noise,
                }
            })
            .collect();
        let found = ultrasonic(&points, 0.5, 0.02).unwrap();
        assert!((found.value_n_per_m[0] - 3.9e6).abs() < 2.0 * found.value_n_per_m[1]);
        // Fn / |k| = 0.25 / 4.03e6 = 62 nm, below the largest amplitude of 80 nm.
        let error = ultrasonic(&points, 0.25, 0.02).unwrap_err();
        assert!(error.to_string().contains("contact is lost"), "{error}");
    }
}
