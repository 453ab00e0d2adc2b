//! Scatter that lasts beyond what is stated: an autoregression in the order of measurement, by its slow part.
//!
//! The slowest cosines have columns of their own, with the power of the autoregression, beside the
//! independent scatter; what is beyond them is not added. Why they are needed: `serial`.

use crate::constants::Constants;
use crate::data::Table;
use nalgebra::DMatrix;
use std::f64::consts::PI;

/// Largest places on the grids of size and correlation that the runs of a table are long enough for.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Bounds {
    /// Place on `slow_sizes`.
    pub size: usize,
    /// Place on `slow_correlations`.
    pub correlation: usize,
}

/// What lasts has to pass within a run: what wanders for longer, as in running in, is a drift and no scatter.
/// Short runs cannot tell the two apart, so there is none.
pub fn bounds(k: &Constants, table: &Table) -> Bounds {
    let mut lengths = vec![0usize; table.run_count.max(1)];
    table.runs.iter().for_each(|&run| lengths[run] += 1);
    lengths.sort_unstable();
    let length = lengths[lengths.len() / 2];
    let passes = |rho: f64| -1.0 / rho.ln();
    let fits = |rho: &&f64| k.slow_within * passes(**rho) <= length as f64;
    let correlations = k.slow_correlations.iter().take_while(fits).count();
    let size = if correlations > 0 && length >= k.slow_long_run { k.slow_sizes.len() - 1 } else { 0 };
    Bounds { size, correlation: correlations.saturating_sub(1) }
}

/// Number of cosines that a table of n passes has.
pub fn modes(k: &Constants, n: usize) -> usize {
    k.slow_modes.min(n / 3)
}

/// The slowest cosines over the passes in the order of measurement; none of a table too short for them.
pub fn cosines(k: &Constants, table: &Table) -> DMatrix<f64> {
    let place = places(table);
    DMatrix::from_fn(table.len(), modes(k, table.len()), |i, j| (PI * j as f64 * place[i]).cos())
}

/// Place of each pass in the order of measurement, 0 to 1.
pub(super) fn places(table: &Table) -> Vec<f64> {
    let mut place = vec![0.0; table.len()];
    for (at, i) in table.order().into_iter().enumerate() {
        place[i] = (at as f64 + 0.5) / table.len() as f64;
    }
    place
}

/// Power of a cosine of an autoregression over n passes, in units of independent scatter (Priestley 1981,
/// section 6.2).
pub(super) fn power(rho: f64, n: usize, mode: usize) -> f64 {
    (1.0 - rho * rho) / (1.0 - 2.0 * rho * (PI * mode as f64 / n as f64).cos() + rho * rho)
}

/// Variance of each cosine of an autoregression of unit variance over n passes.
pub fn powers(rho: f64, n: usize, modes: usize) -> Vec<f64> {
    (0..modes).map(|j| power(rho, n, j) * if j == 0 { 1.0 } else { 2.0 } / n as f64).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{Deviates, table};

    /// The variance of the mean of all passes is that of an autoregression: `(1 + rho) / (1 - rho)` of
    /// independent ones.
    #[test]
    fn the_columns_have_the_power_of_an_autoregression() {
        let small = table(&mut Deviates(6), 0.0);
        let rows: Vec<usize> = (0..small.len()).cycle().take(180).collect();
        let long = small.select(&rows);
        let cosines = cosines(&Constants::default(), &long);
        let powers = powers(0.7, 180, cosines.ncols());
        let of_mean: f64 = cosines.row_sum().iter().zip(&powers).map(|(s, p)| (s / 180.0).powi(2) * p).sum();
        assert!((of_mean * 180.0 / (1.7 / 0.3) - 1.0).abs() < 0.05, "{of_mean}");
        let whole: f64 =
            (0..180).map(|i| cosines.row(i).iter().zip(&powers).map(|(c, p)| c * c * p).sum::<f64>()).sum();
        assert!((0.7..1.01).contains(&(whole / 180.0)), "{whole}");
    }
}
