//! Amplitude over position: the nodal pattern of the plate, `w = w0 |cos(2 pi (x - x0) / lambda)|` (physics.md 4.14).

use super::{AmplitudeError, AmplitudePoint, check};
use crate::regression::nonlinear::{Scatter, fit};
use crate::regression::{Fit, FitError};
use std::f64::consts::PI;

/// A fitted mode shape.
#[derive(Clone, Debug, PartialEq)]
pub struct ModeShape {
    /// Peak-to-peak amplitude at an antinode in m with its standard uncertainty.
    pub antinode_pp_m: [f64; 2],
    /// Position of the antinode next to the middle of the map in m with its standard uncertainty.
    pub antinode_at_m: [f64; 2],
    /// Wavelength in m (twice the distance of two nodes) with its standard uncertainty.
    pub wavelength_m: [f64; 2],
    /// The fit, parameters in this order.
    pub fit: Fit,
    /// First and last position.
    pub range_m: [f64; 2],
}

impl ModeShape {
    /// Amplitude at a position relative to that at the antinode.
    pub fn relative(&self, position_m: f64) -> f64 {
        (2.0 * PI * (position_m - self.antinode_at_m[0]) / self.wavelength_m[0]).cos().abs()
    }
}

/// Fits a map: `at` is the position in m; the scatter is taken as equal everywhere.
/// The wavelength is sought from a third of the mapped length (over three points at least) to twenty times it.
///
/// # Errors
/// Fewer than eight positions, or no convergence.
pub fn mode_shape(points: &[AmplitudePoint]) -> Result<ModeShape, AmplitudeError> {
    check(points, "positions", 8)?;
    let range_m =
        points.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], p| [a.min(p.at), b.max(p.at)]);
    let (length, middle) = (range_m[1] - range_m[0], 0.5 * (range_m[0] + range_m[1]));
    let top = points.iter().fold(0f64, |m, p| m.max(p.amplitude_pp_m));
    let y: Vec<f64> = points.iter().map(|p| p.amplitude_pp_m / top).collect();
    let model = |i: usize, b: &[f64], g: &mut [f64]| {
        let angle = 2.0 * PI * (points[i].at - b[1]) / b[2];
        let (s, c) = angle.sin_cos();
        let sign = c.signum();
        g[0] = c.abs();
        g[1] = b[0] * sign * s * 2.0 * PI / b[2];
        g[2] = b[0] * sign * s * angle / b[2];
        b[0] * c.abs()
    };
    // |cos| has a minimum for every wavelength that fits a few nodes: all of them are tried.
    let shortest = (length / 10.0).max(4.0 * length / points.len() as f64);
    let mut best: Option<Fit> = None;
    let mut wavelength = shortest;
    while wavelength < 20.0 * length {
        let start = (0..8)
            .map(|k| [1.0, middle + wavelength * (f64::from(k) / 8.0 - 0.5) / 2.0, wavelength])
            .min_by(|a, b| misfit(&model, &y, a).total_cmp(&misfit(&model, &y, b)));
        if let Some(start) = start
            && let Ok(f) = fit(&model, &y, Scatter::Unknown, &start)
            && best.as_ref().is_none_or(|b| f.residual_sum_of_squares < b.residual_sum_of_squares)
            && f.estimates[2] > 0.0
        {
            best = Some(f);
        }
        wavelength *= 1.12;
    }
    let mut fit = best.ok_or(FitError::NotConverged { iterations: 0 })?;
    // The antinode nearest to the middle: the same curve, a position that can be compared.
    let half = fit.estimates[2] / 2.0;
    let steps = ((middle - fit.estimates[1]) / half).round();
    fit.estimates[1] += steps * half;
    let to_antinode = nalgebra::Matrix3::new(top, 0.0, 0.0, 0.0, 1.0, steps / 2.0, 0.0, 0.0, 1.0);
    let c = nalgebra::Matrix3::from_fn(|i, j| fit.covariance[(i, j)]);
    let c = to_antinode * c * to_antinode.transpose();
    fit.covariance = nalgebra::DMatrix::from_fn(3, 3, |i, j| c[(i, j)]);
    fit.estimates[0] *= top;
    fit.residuals *= top;
    fit.residual_sum_of_squares *= top * top;
    let pair = |k: usize| [fit.estimates[k], fit.standard_uncertainty(k)];
    Ok(ModeShape { antinode_pp_m: pair(0), antinode_at_m: pair(1), wavelength_m: pair(2), range_m, fit })
}

fn misfit(model: &impl Fn(usize, &[f64], &mut [f64]) -> f64, y: &[f64], b: &[f64; 3]) -> f64 {
    let mut g = [0.0; 3];
    y.iter().enumerate().map(|(i, y)| (y - model(i, b, &mut g)).powi(2)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_waves_of_14_mm_on_a_40_mm_stroke() {
        // physics.md 4.14: glass of 2 mm at 25 kHz has a half-wave of 14 mm.
        let points: Vec<AmplitudePoint> = (0..41)
            .map(|i| {
                let x = f64::from(i) * 1e-3 - 0.02;
                let w = 2e-6 * (2.0 * PI * (x - 0.003) / 0.028).cos().abs();
                AmplitudePoint {
                    at: x,
                    amplitude_pp_m: (w + [1e-8, -1e-8, -1e-8, 1e-8, 0.0][i as usize % 5]).max(0.0),
                }
            })
            .collect();
        let found = mode_shape(&points).unwrap();
        assert!((found.wavelength_m[0] - 0.028).abs() < 3.0 * found.wavelength_m[1], "{found:?}");
        assert!((found.antinode_at_m[0] - 0.003).abs() < 3.0 * found.antinode_at_m[1]);
        assert!(found.wavelength_m[1] < 1e-4);
    }
}
