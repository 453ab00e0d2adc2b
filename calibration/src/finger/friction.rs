//! Friction without vibration: mu0 with its dependence on load, speed and time since contact.
//!
//! `ln mu0 = ln m + (n - 1) ln(F/F0) + s ln(U/U0) + ln(1 + g (1 - exp(-t/tau)))`: the load exponent of a
//! non-Coulombic contact , rate dependence, and occlusion or ageing with time.

use super::{FingerError, enough};
use crate::regression::nonlinear::{best, fit};
use crate::regression::{Fit, ends};
use crate::uncertainty::student::coverage_factor;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::io::Read;

/// One steady pass without vibration.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
pub struct FrictionPoint {
    /// Normal force in N.
    pub normal_force_n: f64,
    /// Sliding speed in m/s.
    pub speed_m_s: f64,
    /// Lateral force along the sliding in N, positive.
    pub lateral_force_n: f64,
    /// Time since the finger touched down in s.
    pub contact_time_s: Option<f64>,
}

/// The fitted law.
#[derive(Clone, Debug, PartialEq)]
pub struct FrictionFit {
    /// Reference load `F0` in N: the geometric mean of the data.
    pub reference_force_n: f64,
    /// Reference speed `U0` in m/s: the geometric mean of the data.
    pub reference_speed_m_s: f64,
    /// Parameters: ln m, n - 1, s, and with time dependence g, ln tau.
    pub fit: Fit,
    bounds: [[f64; 2]; 3],
}

/// Reads `normal_force_n,speed_m_s,lateral_force_n[,contact_time_s]`; unknown columns are ignored.
///
/// # Errors
/// The first row that cannot be read or cannot be.
pub fn read(input: impl Read) -> Result<Vec<FrictionPoint>, FingerError> {
    let rows =
        crate::rows::read(input).map_err(|(line, reason)| FingerError::Bad { row: line as usize, reason })?;
    Ok(rows.into_iter().map(|(_, point)| point).collect())
}

/// Fits the law. The scatter of ln mu0 is taken as equal everywhere. The time dependence is fitted where
/// every point has a time and the times span a factor of five.
///
/// # Errors
/// Too few points, loads or speeds; values that are not positive; no convergence.
pub fn friction(points: &[FrictionPoint]) -> Result<FrictionFit, FingerError> {
    for (i, p) in points.iter().enumerate() {
        let positive =
            [p.normal_force_n, p.speed_m_s, p.lateral_force_n].iter().all(|x| x.is_finite() && *x > 0.0);
        if !positive || p.contact_time_s.is_some_and(|t| !(t.is_finite() && t >= 0.0)) {
            let reason = "force, speed and friction must be above zero, time not negative".into();
            return Err(FingerError::Bad { row: i + 1, reason });
        }
    }
    let distinct = |f: &dyn Fn(&FrictionPoint) -> f64| {
        let mut v: Vec<f64> = points.iter().map(f).collect();
        v.sort_by(f64::total_cmp);
        v.dedup_by(|a, b| (*a / *b - 1.0).abs() < 0.05);
        v.len()
    };
    enough("different loads", distinct(&|p| p.normal_force_n), 3)?;
    enough("different speeds", distinct(&|p| p.speed_m_s), 3)?;
    let mean_ln = |f: &dyn Fn(&FrictionPoint) -> f64| {
        points.iter().map(|p| f(p).ln()).sum::<f64>() / points.len() as f64
    };
    let (f0, u0) = (mean_ln(&|p| p.normal_force_n), mean_ln(&|p| p.speed_m_s));
    let times: Option<Vec<f64>> = points.iter().map(|p| p.contact_time_s).collect();
    let span = |v: &[f64]| ends(v.iter().copied());
    let timed = times.filter(|t| {
        let [low, high] = span(t);
        high >= 5.0 * low.max(0.1)
    });
    let y: Vec<f64> = points.iter().map(|p| (p.lateral_force_n / p.normal_force_n).ln()).collect();
    let straight = |i: usize, b: &[f64], g: &mut [f64]| {
        g[0] = 1.0;
        g[1] = points[i].normal_force_n.ln() - f0;
        g[2] = points[i].speed_m_s.ln() - u0;
        b[0] + b[1] * g[1] + b[2] * g[2]
    };
    let start = y.iter().sum::<f64>() / y.len() as f64;
    let fit = match &timed {
        None => fit(&straight, &y, &[start, 0.0, 0.0])?,
        Some(times) => {
            let model = |i: usize, b: &[f64], g: &mut [f64]| {
                let base = straight(i, b, g);
                base + grown(times[i], b, g).max(1e-9).ln()
            };
            let [low, high] = span(times);
            // The time constant may lie anywhere in the record: the best of several starts counts.
            let tau = |x: f64| low.max(0.1) * (high / low.max(0.1)).powf(x);
            let starts = [0.1, 0.3, 0.7].map(|x| [start, 0.0, 0.0, 0.3, tau(x).ln()]);
            // No time dependence to be seen: its time constant is then not determined.
            best(&model, &y, starts, |_| true).or_else(|_| fit(&straight, &y, &[start, 0.0, 0.0]))?
        }
    };
    let bound = |f: &dyn Fn(&FrictionPoint) -> f64| ends(points.iter().map(f));
    Ok(FrictionFit {
        reference_force_n: f0.exp(),
        reference_speed_m_s: u0.exp(),
        fit,
        bounds: [
            bound(&|p| p.normal_force_n),
            bound(&|p| p.speed_m_s),
            timed.as_deref().map_or([f64::NAN; 2], span),
        ],
    })
}

/// The factor `1 + g (1 - exp(-t/tau))` of a time since contact; its logarithm's derivatives by g and ln tau.
fn grown(t: f64, b: &[f64], g: &mut [f64]) -> f64 {
    let tau = b[4].exp();
    let e = (-t / tau).exp();
    let inner = 1.0 + b[3] * (1.0 - e);
    g[3] = (1.0 - e) / inner;
    g[4] = -b[3] * e * (t / tau) / inner;
    inner
}

impl FrictionFit {
    /// Names and units of the parameters.
    pub fn names(&self) -> Vec<(String, &'static str)> {
        ["ln_mu0", "load_exponent_minus_1", "speed_exponent", "growth", "ln_growth_time_s"]
            .iter()
            .take(self.fit.estimates.len())
            .map(|n| (format!("friction.{n}"), "1"))
            .collect()
    }

    /// Whether the time since contact is part of the law.
    pub fn timed(&self) -> bool {
        self.fit.estimates.len() == 5
    }

    /// mu0 at a load, a speed and (where fitted) a time since contact, with its standard uncertainty.
    /// Without a time, the value right after contact.
    pub fn mu0(&self, normal_force_n: f64, speed_m_s: f64, contact_time_s: f64) -> [f64; 2] {
        let b = &self.fit.estimates;
        let mut g = vec![0.0; b.len()];
        g[0] = 1.0;
        g[1] = (normal_force_n / self.reference_force_n).ln();
        g[2] = (speed_m_s / self.reference_speed_m_s).ln();
        let mut ln = b[0] + b[1] * g[1] + b[2] * g[2];
        if self.timed() {
            ln += grown(contact_time_s, b.as_slice(), &mut g).ln();
        }
        let mu = ln.exp();
        [mu, mu * self.fit.standard_uncertainty_along(&g)]
    }

    pub(super) fn range(&self) -> BTreeMap<String, [f64; 2]> {
        let mut range = BTreeMap::from([
            ("friction.normal_force_n".to_string(), self.bounds[0]),
            ("friction.speed_m_s".to_string(), self.bounds[1]),
        ]);
        if self.timed() {
            range.insert("friction.contact_time_s".to_string(), self.bounds[2]);
        }
        range
    }

    pub(super) fn remarks(&self) -> Vec<String> {
        let [mu, u] = self.mu0(self.reference_force_n, self.reference_speed_m_s, 0.0);
        // The law is one of ln mu0: so is the interval, which then stays above zero.
        let reach = coverage_factor(0.95, self.fit.degrees_of_freedom) * u / mu;
        let mut remarks = vec![format!(
            "mu0 = {mu:.4}, 95 %: {:.4} to {:.4} at {:.3} N and {:.4} m/s, right after contact",
            mu * (-reach).exp(),
            mu * reach.exp(),
            self.reference_force_n,
            self.reference_speed_m_s
        )];
        if !self.timed() {
            remarks.push("the dependence on time since contact was not determined".into());
        }
        remarks
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(law: impl Fn(f64, f64, f64) -> f64) -> Vec<FrictionPoint> {
        let mut out = Vec::new();
        for (i, f) in [0.1, 0.25, 0.5, 1.0].iter().enumerate() {
            for (j, u) in [0.01, 0.03, 0.1].iter().enumerate() {
                for (k, t) in [0.5, 3.0, 10.0, 60.0].iter().enumerate() {
                    let noise = 1.0 + 5e-3 * ((i * 12 + j * 4 + k) as f64 * 2.399).sin();
                    out.push(FrictionPoint {
                        normal_force_n: *f,
                        speed_m_s: *u,
                        lateral_force_n: f * law(*f, *u, *t) * noise,
                        contact_time_s: Some(*t),
                    });
                }
            }
        }
        out
    }

    #[test]
    fn a_known_law_comes_back() {
        let law = |f: f64, u: f64, t: f64| {
            0.5 * (f / 0.3).powf(-0.2) * (u / 0.03).powf(0.1) * (1.0 + 0.8 * (1.0 - (-t / 15.0f64).exp()))
        };
        let found = friction(&points(law)).unwrap();
        for (i, truth) in [(1, -0.2), (2, 0.1), (3, 0.8), (4, 15f64.ln())] {
            let (got, u) = (found.fit.estimates[i], found.fit.standard_uncertainty(i));
            assert!((got - truth).abs() < 3.0 * u, "parameter {i}: {got} +- {u}, {truth}");
        }
        let [mu, u] = found.mu0(0.25, 0.02, 20.0);
        assert!((mu - law(0.25, 0.02, 20.0)).abs() < 3.0 * u && u < 0.01 * mu);
    }

    #[test]
    fn one_load_is_not_enough() {
        let same: Vec<FrictionPoint> =
            points(|_, _, _| 0.5).into_iter().filter(|p| p.normal_force_n == 0.5).collect();
        assert!(friction(&same).unwrap_err().to_string().contains("different loads"));
    }
}
