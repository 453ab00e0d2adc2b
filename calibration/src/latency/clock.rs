//! A device's clock against the host's.

use crate::regression::{FitError, linear};
use nalgebra::{DMatrix, DVector};

/// A clock compared over a record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockFit {
    /// Device seconds gained per host second, with its standard uncertainty.
    pub rate_error: [f64; 2],
    /// Scatter of the arrivals in s.
    pub arrival_sd_s: f64,
    /// Degrees of freedom, the correlation of neighbouring arrivals taken off.
    pub degrees_of_freedom: f64,
}

/// Fits `device = offset + (1 + rate_error) host` to time stamps of samples as they arrived.
/// Arrivals jitter alike for a while (a busy host): the uncertainty is widened by the integrated
/// autocorrelation time of the residuals.
///
/// # Errors
/// Fewer than 32 stamps, or all at one time.
pub fn compare(host_s: &[f64], device_s: &[f64]) -> Result<ClockFit, FitError> {
    let n = host_s.len().min(device_s.len());
    if n < 32 {
        return Err(FitError::TooFew { observations: n, parameters: 2 });
    }
    let (h0, d0) = (host_s[0], device_s[0]);
    let middle = host_s[..n].iter().map(|h| h - h0).sum::<f64>() / n as f64;
    // Only the small difference is fitted: stamps of hours in nanoseconds keep their digits.
    let difference = DVector::from_fn(n, |i, _| (device_s[i] - d0) - (host_s[i] - h0));
    let design = DMatrix::from_fn(n, 2, |i, k| if k == 0 { 1.0 } else { host_s[i] - h0 - middle });
    let fit = linear::ordinary(&design, &difference)?;
    let tau = crate::force::noise::integrated_autocorrelation_time(fit.residuals.as_slice());
    Ok(ClockFit {
        rate_error: [fit.estimates[1], fit.standard_uncertainty(1) * tau.sqrt()],
        arrival_sd_s: fit.residual_sd(),
        degrees_of_freedom: ((n as f64 - 2.0) / tau).max(1.0),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn twenty_parts_in_a_million_are_seen_through_a_millisecond_of_jitter() {
        let host: Vec<f64> = (0..20_000).map(|i| 1_000.0 + f64::from(i) * 5e-3).collect();
        let device: Vec<f64> = host
            .iter()
            .enumerate()
            // A sequence without correlation and with known spread: golden-ratio fractions.
            .map(|(i, h)| {
                (h - 1_000.0) * (1.0 + 20e-6) - 1e-3 * ((i as f64 * 0.618_033_988_75).fract() - 0.5)
            })
            .collect();
        let found = compare(&host, &device).unwrap();
        assert!((found.rate_error[0] - 20e-6).abs() < 3.0 * found.rate_error[1], "{found:?}");
        assert!(found.rate_error[1] < 1e-6);
    }
}
