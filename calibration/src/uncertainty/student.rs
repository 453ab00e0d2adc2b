//! Coverage factors, and the F test.

use statrs::distribution::{ContinuousCDF, FisherSnedecor, Normal, StudentsT};

/// The factor `k` such that `value +- k u` has that coverage probability, for a t distribution.
/// Degrees of freedom below one are taken as one; infinite ones give the Gaussian.
pub fn coverage_factor(coverage: f64, degrees_of_freedom: f64) -> f64 {
    let p = 0.5 + 0.5 * coverage;
    if degrees_of_freedom > 1e6 {
        return Normal::standard().inverse_cdf(p);
    }
    StudentsT::new(0.0, 1.0, degrees_of_freedom.max(1.0)).map_or(f64::NAN, |t| t.inverse_cdf(p))
}

/// F test of a model with so many parameters by its residuals, a group for the replicates at each place: the
/// probability, where it holds, of such means beside the scatter within groups; `None` with too few replicates.
pub fn lack_of_fit(groups: &[Vec<f64>], parameters: usize) -> Option<f64> {
    let (mut between, mut within, mut count) = (0.0, 0.0, 0);
    for group in groups {
        let mean = group.iter().sum::<f64>() / group.len() as f64;
        between += group.len() as f64 * mean * mean;
        within += group.iter().map(|r| (r - mean).powi(2)).sum::<f64>();
        count += group.len();
    }
    let (b, w) = (groups.len() as f64 - parameters as f64, (count - groups.len()) as f64);
    let p_value = |ratio: f64| FisherSnedecor::new(b, w).map_or(f64::NAN, |f| f.sf(ratio.max(0.0)));
    (b >= 1.0 && w >= 3.0).then(|| p_value(between / b / (within / w)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coverage_factors_of_gum_table_g2() {
        // GUM Table G.2, columns 95 % and 99 %.
        for (nu, t95, t99) in [(1.0, 12.71, 63.66), (5.0, 2.57, 4.03), (16.0, 2.12, 2.92), (50.0, 2.01, 2.68)]
        {
            assert!((coverage_factor(0.95, nu) - t95).abs() < 0.006);
            assert!((coverage_factor(0.99, nu) - t99).abs() < 0.006);
        }
        assert!((coverage_factor(0.95, f64::INFINITY) - 1.960).abs() < 5e-4);
    }
}
