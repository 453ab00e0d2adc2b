//! Creep: how a reading goes on changing under a load that does not.

use crate::regression::FitError;
use crate::regression::nonlinear::best;

/// Creep of one channel after a load: `c(t) = c_0 (1 + a (1 - exp(-t / tau)))`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Creep {
    /// Relative creep `a` in the end, with its standard uncertainty.
    pub relative: [f64; 2],
    /// Time constant in s with its standard uncertainty.
    pub time_constant_s: [f64; 2],
    /// Reading right after the load, net of the zero, in counts.
    pub counts: f64,
    /// Standard deviation of what the fit left, and the largest of it, in counts.
    pub residual: [f64; 2],
}

impl Creep {
    /// Fits creep to net counts (zero taken off) at times after the load was put on.
    ///
    /// # Errors
    /// Too few readings, or a record too short or too quiet to tell the time constant: there is then no
    /// creep to be seen within its noise.
    pub fn fit(time_s: &[f64], net_counts: &[f64]) -> Result<Self, FitError> {
        let (first, last) =
            (net_counts.first().copied().unwrap_or(0.0), net_counts.last().copied().unwrap_or(0.0));
        let end = time_s.last().copied().unwrap_or(0.0);
        let model = |i: usize, b: &[f64], g: &mut [f64]| {
            let (t, tau) = (time_s[i], b[2].exp());
            let e = (-t / tau).exp();
            g[0] = 1.0;
            g[1] = 1.0 - e;
            g[2] = -b[1] * e * t / tau;
            b[0] + b[1] * (1.0 - e)
        };
        let start = |share: f64| [first, last - first, (share * end).ln()];
        let best = best(&model, net_counts, [0.05, 0.2, 0.6].map(start), |_| true)?;
        let (c0, amount, tau) = (best.estimates[0], best.estimates[1], best.estimates[2].exp());
        let relative = amount / c0;
        let u = best.standard_uncertainty_along(&[-relative / c0, 1.0 / c0, 0.0]);
        Ok(Creep {
            relative: [relative, u],
            time_constant_s: [tau, tau * best.standard_uncertainty(2)],
            counts: c0,
            residual: [best.residual_sd(), best.residuals.amax()],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_known_creep_comes_back_within_its_uncertainty() {
        let time: Vec<f64> = (0..120).map(|i| f64::from(i) * 5.0).collect();
        // Noise of alternating sign, so that the truth is known and nothing is random.
        let counts: Vec<f64> = time
            .iter()
            .enumerate()
            .map(|(i, t)| {
                9_000.0 * (1.0 + 1.5e-3 * (1.0 - (-t / 80.0).exp())) + [0.3, -0.3, -0.3, 0.3][i % 4]
            })
            .collect();
        let creep = Creep::fit(&time, &counts).unwrap();
        assert!((creep.relative[0] - 1.5e-3).abs() < 2.0 * creep.relative[1]);
        assert!((creep.time_constant_s[0] - 80.0).abs() < 2.0 * creep.time_constant_s[1]);
        assert!(creep.relative[1] < 2e-5);
    }
}
