//! Scatter of neighbours that is correlated: its correlation, and its slow part as columns.
//!
//! Independent passes would let the slow part look like a drift: at correlation 0.7 it has nearly six times
//! the power of independent scatter. So the slowest cosines have columns of their own, with the power of the
//! autoregression, and the rest counts as independent. The work stays linear in the number of passes.

use crate::constants::Constants;
use crate::data::Table;
use crate::regression::Problem;
use crate::scatter::lasting;
use nalgebra::DMatrix;
use std::f64::consts::PI;

/// Values of the correlation that are tried beside none.
const VALUES: [f64; 9] = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9];
/// Fewest differences for a search for correlation.
const FEWEST: usize = 24;

/// Correlation of the scatter of neighbours, from residuals in deviations of a pass; zero unless it is
/// probable.
///
/// Mean squared differences over one and two passes are `2 (1 - rho)` and `2 (1 - rho^2)` of the variance:
/// their ratio less one is the correlation, whatever drifts slowly beside it. Its deviation for independent
/// passes is the root of 2 / n. A priori the correlation is zero with probability one half.
pub fn correlation(k: &Constants, table: &Table, residual: &[f64]) -> f64 {
    let rows = table.order();
    let apart = |lag: usize| {
        let same =
            rows.windows(lag + 1).map(|w| (w[0], w[lag])).filter(|(a, b)| table.runs[*a] == table.runs[*b]);
        same.fold((0.0, 0usize), |(sum, n), (a, b)| (sum + (residual[a] - residual[b]).powi(2), n + 1))
    };
    let ((one, n), (two, m)) = (apart(1), apart(2));
    if m < FEWEST || one <= 0.0 {
        return 0.0;
    }
    let seen = (two / m as f64) / (one / n as f64) - 1.0;
    let sd = (2.0 / m as f64).sqrt();
    let likelihood = |rho: f64| (-0.5 * ((seen - rho) / sd).powi(2)).exp();
    let some: f64 = VALUES.iter().map(|&rho| likelihood(rho)).sum::<f64>() / VALUES.len() as f64;
    let mean = VALUES.iter().map(|&rho| rho * likelihood(rho)).sum::<f64>() / VALUES.len() as f64;
    // Far beyond the grid both vanish: then it is the grid's end.
    if some <= 0.0 {
        return if seen > 0.0 { VALUES[VALUES.len() - 1] } else { 0.0 };
    }
    if some / (some + likelihood(0.0)) > k.serial_probability { mean / some } else { 0.0 }
}

/// Share of the variance that counts as independent, and the columns of the slow part, N.
pub fn columns(rho: f64, table: &Table, problem: &Problem, inflation: &[f64]) -> (f64, DMatrix<f64>) {
    let n = table.len();
    let modes = problem.constants.serial_modes.min(n / 4);
    if rho <= 0.0 || modes == 0 {
        return (1.0, DMatrix::zeros(n, 0));
    }
    let power = |k: usize| lasting::power(rho, n, k);
    let slow: f64 = (0..modes).map(power).sum();
    let share = ((n as f64 - slow) / (n - modes) as f64).max(0.1);
    let place = lasting::places(table);
    let columns = DMatrix::from_fn(n, modes, |i, k| {
        let norm = if k == 0 { 1.0 } else { 2.0 } / n as f64;
        let excess = (power(k) - share).max(0.0);
        (problem.variance[i] / inflation[i] * norm * excess).sqrt() * (PI * k as f64 * place[i]).cos()
    });
    (share, columns)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{Deviates, rig, table};

    /// A slow drift is no correlation of the scatter; a correlation is found beside it; independent scatter
    /// has none.
    #[test]
    fn a_drift_is_no_correlation() {
        let k = Constants::default();
        let mut draw = Deviates(6);
        let small = table(&mut draw, 0.0);
        let rows: Vec<usize> = (0..small.len()).cycle().take(180).collect();
        let long = small.select(&rows);
        let mut last = 0.0;
        let mut scatter = |rho: f64| -> Vec<f64> {
            let next = |_| {
                last = rho * last + (1.0 - rho * rho).sqrt() * draw.normal();
                last
            };
            (0..180).map(next).collect()
        };
        let drift =
            |list: Vec<f64>| list.iter().enumerate().map(|(i, e)| e + 0.03 * i as f64).collect::<Vec<_>>();
        assert_eq!(correlation(&k, &long, &scatter(0.0)), 0.0);
        assert_eq!(correlation(&k, &long, &drift(scatter(0.0))), 0.0);
        let found = correlation(&k, &long, &drift(scatter(0.7)));
        assert!((found - 0.7).abs() < 0.2, "{found}");
    }

    /// Independent part and columns together have the variance of a pass, and what a run of passes has in
    /// common is more than independent scatter leaves, as an autoregression has it.
    #[test]
    fn the_columns_have_the_power_of_an_autoregression() {
        let small = table(&mut Deviates(6), 0.0);
        let rows: Vec<usize> = (0..small.len()).cycle().take(180).collect();
        let long = small.select(&rows);
        let mut problem = Problem::new(&long, &rig(), &Default::default());
        problem.variance = vec![4.0; 180];
        let (share, columns) = columns(0.7, &long, &problem, &[1.0; 180]);
        let mean = columns.norm_squared() / 180.0;
        assert!((share * 4.0 + mean - 4.0).abs() < 0.05, "{share} {mean}");
        // Variance of the mean of all passes: (1 + rho) / (1 - rho) of independent ones.
        let of_mean = columns.row_sum().norm_squared() / 180.0_f64.powi(2) + share * 4.0 / 180.0;
        assert!((of_mean / (4.0 / 180.0) / (1.7 / 0.3) - 1.0).abs() < 0.05, "{of_mean}");
    }
}
