//! Resonance frequency and quality factor from a frequency sweep at constant drive.

use super::{AmplitudeError, AmplitudePoint, FitResult, check, weighted};
use crate::regression::{ends, nonlinear};

/// The resonance that a sweep shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resonance {
    /// Resonance frequency in Hz with its standard uncertainty.
    pub frequency_hz: [f64; 2],
    /// Quality factor with its standard uncertainty.
    pub quality_factor: [f64; 2],
    /// Degrees of freedom.
    pub degrees_of_freedom: f64,
}

/// Fits a sweep: `at` is the frequency in Hz.
///
/// The curve is a Lorentzian with a tilt,
/// `w0 (1 + a (f - f0) / f0) / sqrt(1 + (2 Q (f - f0) / f0)^2)`. Without the tilt the answer would depend on
/// whether displacement, velocity or current is driven and measured (by about a hertz at Q 100): fitted, it
/// costs a somewhat wider interval and leaves no such bias.
///
/// # Errors
/// Fewer than seven frequencies, a sweep that does not hold the resonance, no convergence.
pub fn sweep(points: &[AmplitudePoint]) -> Result<Resonance, AmplitudeError> {
    check(points, "frequencies", 7)?;
    let highest = points.iter().max_by(|a, b| a.amplitude_pp_m.total_cmp(&b.amplitude_pp_m));
    let top = *highest.unwrap_or(&points[0]);
    for (end, at) in ["lower", "upper"].into_iter().zip(ends(points.iter().map(|p| p.at))) {
        if top.at == at {
            return Err(AmplitudeError::OffRange(end));
        }
    }
    let wide = points.iter().filter(|p| p.amplitude_pp_m > 0.707 * top.amplitude_pp_m);
    let [low, high] = ends(wide.map(|p| p.at));
    let width = (high - low).max(1e-5 * top.at);
    let fit = weighted(points, |scatter| best(points, scatter, &top, width))?;
    let q = fit.estimates[1].exp();
    Ok(Resonance {
        frequency_hz: [fit.estimates[0], fit.standard_uncertainty(0)],
        quality_factor: [q, q * fit.standard_uncertainty(1)],
        degrees_of_freedom: fit.degrees_of_freedom,
    })
}

/// Parameters: f0, ln Q, ln w0, tilt (near -1/2 where a constant force drives a displacement, 0 for a pure
/// Lorentzian); amplitudes weighted by their scatter.
fn best(points: &[AmplitudePoint], scatter: &[f64], top: &AmplitudePoint, width: f64) -> FitResult {
    let y: Vec<f64> = points.iter().zip(scatter).map(|(p, s)| p.amplitude_pp_m / s).collect();
    let model = |i: usize, b: &[f64], g: &mut [f64]| {
        let (f0, q) = (b[0], b[1].exp());
        let delta = (points[i].at - f0) / f0;
        let x = 2.0 * q * delta;
        let lorentz = b[2].exp() / scatter[i] / (1.0 + x * x).sqrt();
        let value = lorentz * (1.0 + b[3] * delta);
        let delta_f0 = -points[i].at / (f0 * f0);
        g[0] = (-value * x * 2.0 * q / (1.0 + x * x) + lorentz * b[3]) * delta_f0;
        g[1] = -value * x * x / (1.0 + x * x);
        g[2] = value;
        g[3] = lorentz * delta;
        value
    };
    let start = |factor: f64| [top.at, (factor * top.at / width).ln(), top.amplitude_pp_m.ln(), 0.0];
    nonlinear::best(&model, &y, [1.0, 0.5, 2.0].map(start), |_| true)?.better_than_a_constant(&y)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exact_lorentzian_comes_back() {
        let points: Vec<AmplitudePoint> = (-20..=20)
            .map(|i| {
                let f = 27_500.0 + 20.0 * f64::from(i) + 3.0;
                let x = 2.0 * 150.0 * (f - 27_480.0) / 27_480.0;
                AmplitudePoint { at: f, amplitude_pp_m: 2e-6 / (1.0f64 + x * x).sqrt() }
            })
            .collect();
        let found = sweep(&points).unwrap();
        assert!((found.frequency_hz[0] - 27_480.0).abs() < 2.0 * found.frequency_hz[1] + 1e-3, "{found:?}");
        assert!((found.quality_factor[0] - 150.0).abs() < 2.0 * found.quality_factor[1]);
        assert!(found.frequency_hz[1] < 0.5 && found.quality_factor[1] < 0.5);
        assert!(matches!(sweep(&points[25..]), Err(AmplitudeError::OffRange("lower"))));
    }

    #[test]
    fn a_driven_oscillator_has_its_resonance_where_it_is() {
        // Displacement under constant force: 1 / sqrt((1 - r^2)^2 + (r / Q)^2), Q 100.
        let points: Vec<AmplitudePoint> = (-20..=20)
            .map(|i| {
                let r = 1.0 + f64::from(i) * 8e-4;
                let d = (1.0 - r * r).hypot(r / 100.0);
                AmplitudePoint { at: 27_500.0 * r, amplitude_pp_m: 2e-8 / d }
            })
            .collect();
        let found = sweep(&points).unwrap();
        assert!((found.frequency_hz[0] - 27_500.0).abs() < 0.7, "a hundredth of the bandwidth: {found:?}");
        assert!((found.quality_factor[0] - 100.0).abs() < 0.1);
    }
}
