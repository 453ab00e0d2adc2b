//! Amplitude under load: `w = w_free / (1 + d F^p)`.

use super::{AmplitudeError, AmplitudePoint, check, lack_of_fit, weighted};
use crate::regression::Fit;
use crate::regression::nonlinear::fit;

/// Exponent of the load: the finger's impedance goes with its contact area.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Exponent {
    /// 2/3, the area of a Hertz contact.
    #[default]
    Hertz,
    /// 1.
    Linear,
}

impl Exponent {
    /// Its value.
    pub fn value(self) -> f64 {
        match self {
            Exponent::Hertz => 2.0 / 3.0,
            Exponent::Linear => 1.0,
        }
    }
}

/// A fitted droop.
#[derive(Clone, Debug, PartialEq)]
pub struct Droop {
    /// `d` in 1/N^p with its standard uncertainty.
    pub coefficient: [f64; 2],
    /// The exponent.
    pub exponent: Exponent,
    /// The fit; parameters ln w_free and d.
    pub fit: Fit,
    /// Largest load in N.
    pub largest_n: f64,
}

/// Fits amplitudes at one set-point under loads: `at` is the normal force in N.
///
/// # Errors
/// Fewer than four loads, points that do not follow the form.
pub fn droop(points: &[AmplitudePoint], exponent: Exponent) -> Result<Droop, AmplitudeError> {
    check(points, "loads", 4)?;
    if let Some(i) = points.iter().position(|p| p.at < 0.0 || p.amplitude_pp_m == 0.0) {
        let reason = "droop needs loads that press and amplitudes above zero".into();
        return Err(AmplitudeError::Bad { row: i + 1, reason });
    }
    let top = points.iter().fold(0f64, |m, p| m.max(p.amplitude_pp_m));
    let fit = weighted(points, |scatter| {
        let y: Vec<f64> = points.iter().zip(scatter).map(|(p, s)| p.amplitude_pp_m / s).collect();
        let model = |i: usize, b: &[f64], g: &mut [f64]| {
            let power = points[i].at.powf(exponent.value());
            let value = b[0].exp() / (1.0 + b[1] * power) / scatter[i];
            g[0] = value;
            g[1] = -value * power / (1.0 + b[1] * power);
            value
        };
        fit(&model, &y, &[top.ln(), 0.05])
    })?;
    if let Some(p) = lack_of_fit(points, fit.residuals.as_slice(), 2).filter(|p| *p < 1e-3) {
        let remedy = "try the other exponent, and check the drive's limit";
        return Err(AmplitudeError::LackOfFit { p, remedy });
    }
    Ok(Droop {
        coefficient: [fit.estimates[1], fit.standard_uncertainty(1)],
        exponent,
        largest_n: points.iter().fold(0f64, |m, p| m.max(p.at)),
        fit,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_known_droop_comes_back() {
        let points: Vec<AmplitudePoint> = (0..24)
            .map(|i| {
                let f = f64::from(i / 3) * 0.2;
                let noise = [1.002, 0.998, 1.0][i as usize % 3];
                AmplitudePoint { at: f, amplitude_pp_m: noise * 2e-6 / (1.0 + 0.15 * f.powf(2.0 / 3.0)) }
            })
            .collect();
        let found = droop(&points, Exponent::Hertz).unwrap();
        assert!((found.coefficient[0] - 0.15).abs() < 3.0 * found.coefficient[1], "{found:?}");
        assert!(found.coefficient[1] < 5e-3);
    }
}
