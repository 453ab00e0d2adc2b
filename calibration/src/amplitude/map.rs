//! Amplitude over position: the nodal pattern of the plate.
//!
//! `w = w0 (1 - d + d |cos(2 pi (x - x0) / lambda)|)`: a standing wave with share `d`, on top of what travels
//! and leaves no node. `d = 1` is that of a pure standing wave.

use super::{AmplitudeError, AmplitudePoint, FitResult, check, weighted};
use crate::regression::{Fit, ends, nonlinear};
use std::f64::consts::PI;

/// A fitted mode shape.
#[derive(Clone, Debug, PartialEq)]
pub struct ModeShape {
    /// Position of the antinode next to the middle of the map in m with its standard uncertainty.
    pub antinode_at_m: [f64; 2],
    /// Wavelength in m (twice the distance of two nodes) with its standard uncertainty.
    pub wavelength_m: [f64; 2],
    /// Standing share `d` with its standard uncertainty.
    pub standing_share: [f64; 2],
    /// The fit, parameters in this order after the amplitude at an antinode in m; residuals relative to the
    /// amplitude.
    pub fit: Fit,
    /// First and last position.
    pub range_m: [f64; 2],
}

/// Fits a map: `at` is the position in m; the scatter is taken as proportional to the amplitude above a floor.
/// The wavelength is sought from a third of the mapped length (over three points at least) to twenty times it.
///
/// # Errors
/// Fewer than ten positions, or no convergence.
pub fn mode_shape(points: &[AmplitudePoint]) -> Result<ModeShape, AmplitudeError> {
    check(points, "positions", 10)?;
    let range_m = ends(points.iter().map(|p| p.at));
    let (length, middle) = (range_m[1] - range_m[0], 0.5 * (range_m[0] + range_m[1]));
    let top = points.iter().fold(0f64, |m, p| m.max(p.amplitude_pp_m));
    let mut fit = weighted(points, |scatter| best(points, scatter, top, [length, middle]))?;
    // The antinode nearest to the middle: the same curve, a position that can be compared.
    let half = fit.estimates[2] / 2.0;
    let steps = ((middle - fit.estimates[1]) / half).round();
    fit.estimates[1] += steps * half;
    let mut to_antinode = nalgebra::DMatrix::identity(4, 4);
    (to_antinode[(0, 0)], to_antinode[(1, 2)]) = (top, steps / 2.0);
    fit.covariance = &to_antinode * &fit.covariance * to_antinode.transpose();
    fit.estimates[0] *= top;
    let pair = |k: usize| [fit.estimates[k], fit.standard_uncertainty(k)];
    Ok(ModeShape { antinode_at_m: pair(1), wavelength_m: pair(2), standing_share: pair(3), range_m, fit })
}

/// Parameters: amplitude at an antinode over `top`, antinode, wavelength, standing share.
fn best(points: &[AmplitudePoint], scatter: &[f64], top: f64, [length, middle]: [f64; 2]) -> FitResult {
    let y: Vec<f64> = points.iter().zip(scatter).map(|(p, s)| p.amplitude_pp_m / s).collect();
    let model = |i: usize, b: &[f64], g: &mut [f64]| {
        let angle = 2.0 * PI * (points[i].at - b[1]) / b[2];
        let (s, c) = angle.sin_cos();
        let sign = c.signum();
        let shape = 1.0 - b[3] * (1.0 - c.abs());
        let weighted = b[0] * top / scatter[i];
        g[0] = shape * top / scatter[i];
        g[1] = weighted * b[3] * sign * s * 2.0 * PI / b[2];
        g[2] = weighted * b[3] * sign * s * angle / b[2];
        g[3] = -weighted * (1.0 - c.abs());
        weighted * shape
    };
    // |cos| has a local minimum for every wavelength that fits a few nodes: a grid of starts, then the best few.
    let lowest = points.iter().map(|p| p.amplitude_pp_m / top).fold(1.0, f64::min);
    let depth = (1.0 - lowest).clamp(0.05, 1.0);
    let shortest = (length / 10.0).max(4.0 * length / points.len() as f64);
    let steps = ((20.0 * length / shortest).ln() / 1.05f64.ln()) as i32;
    let misfit = |b: &[f64; 4]| -> f64 {
        y.iter().enumerate().map(|(i, y)| (y - model(i, b, &mut [0.0; 4])).powi(2)).sum()
    };
    let mut starts: Vec<(f64, [f64; 4])> = (0..steps)
        .flat_map(|k| (0..12).map(move |m| (shortest * 1.05f64.powi(k), f64::from(m) / 12.0 - 0.5)))
        .map(|(wavelength, share)| [1.0, middle + 0.5 * wavelength * share, wavelength, depth])
        .map(|start| (misfit(&start), start))
        .collect();
    starts.sort_by(|a, b| a.0.total_cmp(&b.0));
    let starts = starts.into_iter().take(8).map(|(_, start)| start);
    nonlinear::best(&model, &y, starts, |f| f.estimates[2] > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_waves_of_14_mm_on_a_40_mm_stroke() {
        // Glass of 2 mm at 25 kHz has a half-wave of 14 mm.
        let points: Vec<AmplitudePoint> = (0..41)
            .map(|i| {
                let x = f64::from(i) * 1e-3 - 0.02;
                let w = 2e-6 * (2.0 * PI * (x - 0.003) / 0.028).cos().abs();
                let noise = 0.005 * w.hypot(4e-7) * [1.0, -1.0, -1.0, 1.0, 0.0][i as usize % 5];
                AmplitudePoint { at: x, amplitude_pp_m: (w + noise).max(0.0) }
            })
            .collect();
        let found = mode_shape(&points).unwrap();
        assert!((found.wavelength_m[0] - 0.028).abs() < 3.0 * found.wavelength_m[1], "{found:?}");
        assert!((found.antinode_at_m[0] - 0.003).abs() < 3.0 * found.antinode_at_m[1]);
        assert!((found.standing_share[0] - 1.0).abs() < 3.0 * found.standing_share[1] + 0.01);
        assert!(found.wavelength_m[1] < 1e-4);
    }
}
