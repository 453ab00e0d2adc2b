//! Resonance frequency and quality factor from a frequency sweep at constant drive.

use super::{AmplitudeError, AmplitudePoint, check, relative_scatter};
use crate::regression::nonlinear::{Scatter, fit};
use crate::regression::{Fit, FitError};

/// The resonance that a sweep shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resonance {
    /// Resonance frequency in Hz with its standard uncertainty.
    pub frequency_hz: [f64; 2],
    /// Quality factor with its standard uncertainty.
    pub quality_factor: [f64; 2],
    /// Peak-to-peak amplitude at resonance in m with its standard uncertainty.
    pub peak_pp_m: [f64; 2],
    /// What the two forms of the resonance differ by, in Hz and in Q; it is in the uncertainties as type B.
    pub form_difference: [f64; 2],
    /// Relative residual standard deviation.
    pub residual_relative_sd: f64,
    /// Degrees of freedom.
    pub degrees_of_freedom: f64,
}

/// Which curve is fitted.
#[derive(Clone, Copy, PartialEq)]
enum Curve {
    /// `w0 / sqrt(1 + (2 Q (f - f0) / f0)^2)`, physics.md 4.13.
    Lorentzian,
    /// Displacement of a driven oscillator: `w0 / (Q sqrt((1 - r^2)^2 + (r / Q)^2))`, `r = f / f0`.
    Oscillator,
}

/// Fits a sweep: `at` is the frequency in Hz. A real plate is neither curve exactly; half their difference
/// in either direction is taken as the form's own uncertainty (rectangular).
///
/// # Errors
/// Fewer than seven frequencies, a sweep that does not hold the resonance, no convergence.
pub fn sweep(points: &[AmplitudePoint]) -> Result<Resonance, AmplitudeError> {
    check(points, "frequencies", 7)?;
    let top = points.iter().max_by(|a, b| a.amplitude_pp_m.total_cmp(&b.amplitude_pp_m)).copied();
    let Some(top) = top else {
        return Err(AmplitudeError::TooFew { what: "frequencies", found: 0, needed: 7 });
    };
    for (end, beyond) in
        [("lower", points.iter().all(|p| p.at >= top.at)), ("upper", points.iter().all(|p| p.at <= top.at))]
    {
        if beyond {
            return Err(AmplitudeError::OffRange(end));
        }
    }
    let width = {
        let wide = points.iter().filter(|p| p.amplitude_pp_m > 0.707 * top.amplitude_pp_m);
        let [low, high] = wide.fold([top.at, top.at], |[a, b], p| [a.min(p.at), b.max(p.at)]);
        (high - low).max(1e-5 * top.at)
    };
    let lorentz = best(points, Curve::Lorentzian, &top, width)?;
    let oscillator = best(points, Curve::Oscillator, &top, width)?;
    let quality = |f: &Fit| f.estimates[1].exp();
    let difference =
        [oscillator.estimates[0] - lorentz.estimates[0], quality(&oscillator) - quality(&lorentz)];
    let form = |i: usize| difference[i].abs() / 12f64.sqrt();
    let middle = |i: usize, value: f64| value + 0.5 * difference[i];
    let q = quality(&lorentz);
    Ok(Resonance {
        frequency_hz: [middle(0, lorentz.estimates[0]), lorentz.standard_uncertainty(0).hypot(form(0))],
        quality_factor: [middle(1, q), (q * lorentz.standard_uncertainty(1)).hypot(form(1))],
        peak_pp_m: [lorentz.estimates[2].exp(), lorentz.estimates[2].exp() * lorentz.standard_uncertainty(2)],
        form_difference: difference,
        residual_relative_sd: lorentz.residual_sd(),
        degrees_of_freedom: lorentz.degrees_of_freedom,
    })
}

/// Parameters: f0, ln Q, ln w0; amplitudes weighted by their scatter.
fn best(points: &[AmplitudePoint], curve: Curve, top: &AmplitudePoint, width: f64) -> Result<Fit, FitError> {
    let scatter = relative_scatter(points);
    let y: Vec<f64> = points.iter().zip(&scatter).map(|(p, s)| p.amplitude_pp_m / s).collect();
    let model = |i: usize, b: &[f64], g: &mut [f64]| {
        let (f, f0, q) = (points[i].at, b[0], b[1].exp());
        let w = b[2].exp() / scatter[i];
        // y = w D^(-1/2); derivatives of D by f0 and by ln Q.
        let (d, d_f0, d_q) = match curve {
            Curve::Lorentzian => {
                let x = 2.0 * q * (f - f0) / f0;
                (1.0 + x * x, 2.0 * x * (-2.0 * q * f / (f0 * f0)), 2.0 * x * x)
            }
            Curve::Oscillator => {
                let r = f / f0;
                let a = 1.0 - r * r;
                // Q^2 ((1 - r^2)^2 + r^2 / Q^2)
                (q * q * a * a + r * r, (-4.0 * q * q * a * r + 2.0 * r) * (-r / f0), 2.0 * q * q * a * a)
            }
        };
        let value = w / d.sqrt();
        g[0] = -0.5 * value / d * d_f0;
        g[1] = -0.5 * value / d * d_q;
        g[2] = value;
        value
    };
    let mut found: Option<Fit> = None;
    for factor in [1.0, 0.5, 2.0] {
        let start = [top.at, (factor * top.at / width).ln(), top.amplitude_pp_m.ln()];
        if let Ok(f) = fit(&model, &y, Scatter::Unknown, &start)
            && found.as_ref().is_none_or(|b| f.residual_sum_of_squares < b.residual_sum_of_squares)
        {
            found = Some(f);
        }
    }
    found.ok_or(FitError::NotConverged { iterations: 0 })
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
}
