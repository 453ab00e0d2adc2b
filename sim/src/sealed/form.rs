//! Form uncertainty: what a hypothesis may claim when a cause of its name need not have exactly its formula.
//!
//! A hypothesis is a model m and its change D net of recalibration. Its forces are m + D delta, where delta
//! is a smooth function of the operating point: a Gaussian process of no mean, with a length of 1.5 standard
//! deviations of each covariate and a standard deviation of 0.05, 0.15 or 0.35 (weights 0.4, 0.4, 0.2). Truth
//! and imitator are granted the same. What is compared is twice the expected negative log likelihood over the
//! noise of the table, at noise-free forces, so no draw of the noise decides.

use super::oracle::{Case, ImitationFit};
use crate::defects::Defects;
use crate::world::Point;

/// Standard deviations of the departure from form, and their weights.
const SCALES: [(f64, f64); 3] = [(0.05, 0.4), (0.15, 0.4), (0.35, 0.2)];
/// Length of the departure in standard deviations of a covariate.
const LENGTH: f64 = 1.5;

/// The smooth kernel over the passes of a table, row by row.
pub(super) struct Kernel {
    rows: Vec<Vec<f64>>,
}

impl Kernel {
    /// Covariates as they act: speed and force by their logarithms; those that do not vary drop out.
    pub(super) fn new(points: &[Point]) -> Self {
        let covariates: [fn(&Point) -> f64; 9] = [
            |p| p.known_pp_m,
            |p| p.speed_m_s.ln(),
            |p| p.at.normal_force_n.ln(),
            |p| p.at.frequency_hz.ln(),
            |p| p.at.direction,
            |p| p.at.position_m,
            |p| p.at.time_s,
            |p| p.at.ambient_pressure_pa,
            |p| p.at.temperature_c,
        ];
        let n = points.len() as f64;
        let mut columns: Vec<Vec<f64>> = Vec::new();
        for of in covariates {
            let values: Vec<f64> = points.iter().map(of).collect();
            let mean = values.iter().sum::<f64>() / n;
            let sd = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt();
            if sd > 1e-6 * mean.abs().max(1e-12) {
                columns.push(values.iter().map(|v| (v - mean) / (sd * LENGTH)).collect());
            }
        }
        let near =
            |i: usize, j: usize| (-0.5 * columns.iter().map(|c| (c[i] - c[j]).powi(2)).sum::<f64>()).exp();
        Self { rows: (0..points.len()).map(|i| (0..=i).map(|j| near(i, j)).collect()).collect() }
    }

    /// Twice the expected negative log likelihood, less that of an exact model without form uncertainty, of a
    /// residual and a net change in standard deviations; `prior` is what the stiffnesses cost.
    ///
    /// The second number is the departure's standard deviation that costs least.
    pub(super) fn cost(&self, residual: &[f64], change: &[f64], prior: f64) -> (f64, f64) {
        let n = residual.len();
        let costs = SCALES.map(|(s, weight)| {
            let l = self.root(change, s);
            let log_determinant: f64 = 2.0 * l.iter().enumerate().map(|(i, row)| row[i].ln()).sum::<f64>();
            let squares: f64 = solved(&l, residual, 0).iter().map(|x| x * x).sum();
            // Trace of the inverse: what the noise of the table costs on average.
            let mut unit = vec![0.0; n];
            let mut trace = 0.0;
            for k in 0..n {
                unit[k] = 1.0;
                trace += solved(&l, &unit, k).iter().map(|x| x * x).sum::<f64>();
                unit[k] = 0.0;
            }
            squares + trace - n as f64 + log_determinant - 2.0 * f64::ln(weight)
        });
        let least = costs.iter().copied().fold(f64::INFINITY, f64::min);
        let total = prior + least - 2.0 * costs.iter().map(|c| (-0.5 * (c - least)).exp()).sum::<f64>().ln();
        let best = costs.iter().position(|c| *c == least).map_or(SCALES[0].0, |i| SCALES[i].0);
        (total, best)
    }

    /// Root of the covariance of noise and departure, in standard deviations of the noise.
    pub(super) fn root(&self, change: &[f64], s: f64) -> Vec<Vec<f64>> {
        let mut l: Vec<Vec<f64>> = (0..change.len())
            .map(|i| {
                let mut row: Vec<f64> =
                    (0..=i).map(|j| s * s * change[i] * change[j] * self.rows[i][j]).collect();
                row[i] += 1.0;
                row
            })
            .collect();
        cholesky(&mut l);
        l
    }
}

/// Lower triangular root, in place.
fn cholesky(l: &mut [Vec<f64>]) {
    for i in 0..l.len() {
        let (above, below) = l.split_at_mut(i);
        let row = &mut below[0];
        for j in 0..i {
            let dot: f64 = row[..j].iter().zip(&above[j][..j]).map(|(x, y)| x * y).sum();
            row[j] = (row[j] - dot) / above[j][j];
        }
        let square: f64 = row[..i].iter().map(|x| x * x).sum();
        // The unit diagonal of the noise bounds the root from below.
        row[i] = (row[i] - square).max(1e-12).sqrt();
    }
}

/// Forward substitution of a right side that is zero before `from`.
pub(super) fn solved(l: &[Vec<f64>], b: &[f64], from: usize) -> Vec<f64> {
    let mut x: Vec<f64> = Vec::with_capacity(b.len() - from);
    for i in from..b.len() {
        let dot: f64 = l[i][from..i].iter().zip(&x).map(|(p, q)| p * q).sum();
        x.push((b[i] - dot) / l[i][i]);
    }
    x
}

/// What a model costs once it may depart from its form.
pub(super) struct Departure {
    /// Twice the expected negative log likelihood.
    pub(super) cost: f64,
    /// Standard deviation of the departure that costs least.
    pub(super) scale: f64,
    /// The model's net change, in standard deviations.
    pub(super) change: Vec<f64>,
}

impl Case<'_> {
    /// Cost of a model of these forces (N), whose stiffnesses cost `prior`; `base` is the recalibrated baseline.
    pub(super) fn departure(
        &self,
        kernel: &Kernel,
        model: &[f64],
        prior: f64,
        base: &ImitationFit,
    ) -> Departure {
        let own = Case { lateral_n: model, ..*self }.fit_from(&base.finger, &Defects::none(), 4);
        let change: Vec<f64> = own.residual_n.iter().zip(self.sd_n).map(|(d, sd)| d / sd).collect();
        let (cost, scale) = kernel.cost(&self.standardised(model), &change, prior);
        Departure { cost, scale, change }
    }

    /// Data less model in standard deviations.
    pub(super) fn standardised(&self, model: &[f64]) -> Vec<f64> {
        self.lateral_n.iter().zip(model).zip(self.sd_n).map(|((y, m), sd)| (y - m) / sd).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two passes one unit apart, worked by hand.
    #[test]
    fn the_cost_of_two_passes_is_the_closed_form() {
        let k = (-0.5_f64).exp();
        let kernel = Kernel { rows: vec![vec![1.0], vec![k, 1.0]] };
        let (r, d) = ([0.7, -1.1], [3.0, 2.0]);
        let each = SCALES.map(|(s, weight)| {
            let (a, b, c) = (1.0 + s * s * 9.0, 1.0 + s * s * 4.0, s * s * 6.0 * k);
            let determinant = a * b - c * c;
            let squares = (b * r[0] * r[0] - 2.0 * c * r[0] * r[1] + a * r[1] * r[1]) / determinant;
            weight * (-0.5 * (squares + (a + b) / determinant - 2.0 + determinant.ln())).exp()
        });
        let expected = 0.4 - 2.0 * each.iter().sum::<f64>().ln();
        assert!((kernel.cost(&r, &d, 0.4).0 - expected).abs() < 1e-12);
    }
}
