//! Both stiffnesses of the spring-slider from passes with and without vibration, and above all their ratio
//! `k_l / k_n`, which decides the law of friction (Eq. 16).
//!
//! Least squares on the forces in `ln k_n`, `ln (k_l / k_n)` and `ln mu_0` with no prior: each pass weighs by
//! what the rig repeats to. The interval of the ratio is its profile, `k_n` and `mu_0` sought again at each
//! value. Where the passes scatter more than stated, the interval is as much wider.

use super::{FingerError, enough};
use models::pass::{Pass, coulomb_coefficient};
use models::{Condition, Finger, PassNoise, PeakToPeak, spring_slider};
use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

/// Range of the ratio that is searched.
pub const RATIO_RANGE: [f64; 2] = [0.02, 5.0];
/// Range of the normal stiffness that is searched, N/m.
const STIFFNESS_RANGE_N_PER_M: [f64; 2] = [2e4, 2e8];
/// Passes with vibration that it takes: three quantities, and something to judge them by.
const FEWEST: usize = 6;

/// Probability below which the slider does not explain the passes: one good run in a thousand is refused.
const LACK_OF_FIT_P: f64 = 1e-3;

/// What passes say of the springs.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Springs {
    /// `k_n`, N/m.
    pub normal_stiffness_n_per_m: f64,
    /// `k_l`, N/m.
    pub lateral_stiffness_n_per_m: f64,
    /// `k_l / k_n`.
    pub lateral_over_normal: f64,
    /// Its 95 % profile interval.
    pub ratio_ci95: [f64; 2],
    /// Whether each end was found within the range searched.
    pub ratio_closed: [bool; 2],
    /// The 95 % profile interval of `k_n`, N/m.
    pub normal_ci95_n_per_m: [f64; 2],
    /// Whether each of its ends was found.
    pub normal_closed: [bool; 2],
    /// Coefficient of friction without vibration.
    pub mu0: f64,
    /// Passes with vibration.
    pub passes: usize,
    /// Passes that were left out: without a force, or at a condition that the slider does not take.
    pub left_out: usize,
    /// Chi-square over its degrees of freedom: 1 where the slider explains the passes to what the rig repeats to.
    pub reduced_chi2: f64,
    /// Probability of such a misfit or a larger one where the slider holds and the rig repeats as stated.
    pub lack_of_fit_p: f64,
    /// Root mean square of the residuals, N.
    pub residual_rms_n: f64,
    /// Largest residual without its sign, N.
    pub residual_largest_n: f64,
}

struct Row {
    condition: Condition,
    force_n: f64,
    sd_n: f64,
}

/// One search: its place in (ln k_n, ln ratio, ln mu_0), and chi-square there.
#[derive(Clone, Copy)]
struct Trial {
    at: [f64; 3],
    chi2: f64,
}

/// Fits the springs to passes.
///
/// # Errors
/// Fewer than six passes with vibration and a force, or none without vibration.
pub fn springs(passes: &[Pass], noise: &PassNoise) -> Result<Springs, FingerError> {
    let mu0 = coulomb_coefficient(passes).filter(|mu0| *mu0 > 0.0).ok_or(FingerError::TooFew {
        what: "passes without vibration",
        found: 0,
        needed: 1,
    })?;
    let rows: Vec<Row> = passes
        .iter()
        .filter_map(|p| {
            let force_n = p.friction_force_n()?;
            let sd_n = (noise.pass_relative_sd * force_n).hypot(noise.force_sd_n);
            Some(Row { condition: p.condition(mu0), force_n, sd_n })
        })
        // A reference needs no frequency.
        .filter(|r| r.condition.amplitude == PeakToPeak::ZERO || r.condition.check().is_ok())
        .collect();
    let vibrating = rows.iter().filter(|r| r.condition.amplitude != PeakToPeak::ZERO).count();
    enough("passes with vibration", vibrating, FEWEST)?;
    // A coarse look at the whole range, then the best three places.
    let [ratios, stiffnesses] = [RATIO_RANGE, STIFFNESS_RANGE_N_PER_M].map(|range| range.map(f64::ln));
    let place = |range: [f64; 2], k: usize, n: usize| range[0] + (range[1] - range[0]) * k as f64 / n as f64;
    let of = |k| (0..=12).map(move |r| [place(stiffnesses, k, 16), place(ratios, r, 12), mu0.ln()]);
    let looked = (0..=16).flat_map(of).map(|at| Trial { at, chi2: chi2(&rows, at) });
    let mut starts: Vec<Trial> = looked.collect();
    starts.sort_by(|a, b| a.chi2.total_cmp(&b.chi2));
    let searched = starts[..3].iter().map(|s| search(&rows, *s, [true; 3]));
    let best = searched.min_by(|a, b| a.chi2.total_cmp(&b.chi2)).unwrap_or(starts[0]);
    let dof = rows.len() as f64 - 3.0;
    let reduced_chi2 = best.chi2 / dof;
    // One quantity against the scatter of the passes, which is not believed to be less than stated.
    let f95 = FisherSnedecor::new(1.0, dof).map_or(3.84, |f| f.inverse_cdf(0.95));
    let allowed = best.chi2 + f95 * reduced_chi2.max(1.0);
    let profile = |axis: usize, range: [f64; 2]| -> ([f64; 2], [bool; 2]) {
        let ends = [(range[0], -1.0), (range[1], 1.0)];
        let ends = ends.map(|(end, outwards)| profile_end(&rows, best, axis, end, outwards, allowed));
        (ends.map(|e| e.0.exp()), ends.map(|e| e.1))
    };
    let (ratio_ci95, ratio_closed) = profile(1, ratios);
    let (normal_ci95_n_per_m, normal_closed) = profile(0, stiffnesses);
    let [normal, ratio, mu0] = best.at.map(f64::exp);
    let left: Vec<f64> = rows.iter().map(|r| (residual(r, best.at) * r.sd_n).abs()).collect();
    Ok(Springs {
        normal_stiffness_n_per_m: normal,
        lateral_stiffness_n_per_m: normal * ratio,
        lateral_over_normal: ratio,
        ratio_ci95,
        ratio_closed,
        normal_ci95_n_per_m,
        normal_closed,
        mu0,
        passes: vibrating,
        left_out: passes.len() - rows.len(),
        reduced_chi2,
        lack_of_fit_p: ChiSquared::new(dof).map_or(1.0, |c| 1.0 - c.cdf(best.chi2)),
        residual_rms_n: (left.iter().map(|r| r * r).sum::<f64>() / rows.len() as f64).sqrt(),
        residual_largest_n: left.iter().fold(0.0, |a: f64, b| a.max(*b)),
    })
}

impl Springs {
    /// The springs, where the slider explains the passes: stiffnesses of a law that does not hold are no
    /// property of the finger, and a certificate would hand them on as one. The level is a force series'.
    ///
    /// # Errors
    /// A misfit beyond what the rig repeats to.
    pub fn of_a_law_that_holds(self) -> Result<Self, FingerError> {
        match self.lack_of_fit_p < LACK_OF_FIT_P {
            true => Err(FingerError::Misfit { reduced_chi2: self.reduced_chi2, passes: self.passes }),
            false => Ok(self),
        }
    }
}

/// Residual of a pass in its standard deviations.
fn residual(row: &Row, at: [f64; 3]) -> f64 {
    let [normal, ratio, mu0] = at.map(f64::exp);
    let condition = Condition { mu0, ..row.condition };
    let finger = Finger {
        normal_stiffness_n_per_m: normal,
        lateral_stiffness_n_per_m: normal * ratio,
        ..Finger::paper()
    };
    let mu_relative = if condition.amplitude == PeakToPeak::ZERO {
        1.0
    } else {
        spring_slider::solve(&condition, &finger).map_or(f64::NAN, |cycle| cycle.mu_relative)
    };
    (mu_relative * mu0 * condition.normal_force_n - row.force_n) / row.sd_n
}

fn chi2(rows: &[Row], at: [f64; 3]) -> f64 {
    let sum: f64 = rows.iter().map(|r| residual(r, at).powi(2)).sum();
    if sum.is_finite() { sum } else { f64::INFINITY }
}

/// Levenberg's search from a start in the quantities that are free.
fn search(rows: &[Row], start: Trial, free: [bool; 3]) -> Trial {
    let axes: Vec<usize> = (0..3).filter(|k| free[*k]).collect();
    let (mut here, mut damping) = (start, 1e-3);
    for _ in 0..60 {
        let base = DVector::from_iterator(rows.len(), rows.iter().map(|r| residual(r, here.at)));
        let mut slope = DMatrix::zeros(rows.len(), axes.len());
        for (column, axis) in axes.iter().enumerate() {
            const H: f64 = 1e-5;
            let (mut up, mut down) = (here.at, here.at);
            up[*axis] += H;
            down[*axis] -= H;
            for (i, row) in rows.iter().enumerate() {
                slope[(i, column)] = (residual(row, up) - residual(row, down)) / (2.0 * H);
            }
        }
        let (square, pull) = (slope.transpose() * &slope, slope.transpose() * &base);
        let mut gained = None;
        while damping < 1e9 {
            let mut matrix = square.clone();
            for k in 0..axes.len() {
                matrix[(k, k)] += damping * square[(k, k)].max(1e-12);
            }
            let mut next = here;
            if let Some(step) = matrix.cholesky().map(|c| c.solve(&pull)) {
                for (k, axis) in axes.iter().enumerate() {
                    next.at[*axis] -= step[k].clamp(-0.7, 0.7);
                }
                next.chi2 = chi2(rows, next.at);
                if next.chi2 < here.chi2 {
                    gained = Some(next);
                    break;
                }
            }
            damping *= 5.0;
        }
        let Some(next) = gained else { break };
        let small = here.chi2 - next.chi2 < 1e-8 * (1.0 + here.chi2);
        (here, damping) = (next, (damping / 10.0).max(1e-12));
        if small {
            break;
        }
    }
    here
}

/// Where the profile along an axis passes what is allowed, towards `end` (`outwards` is 1 for the upper one,
/// -1 for the lower); and whether it does. A best value beyond the range has no end there.
fn profile_end(rows: &[Row], best: Trial, axis: usize, end: f64, outwards: f64, allowed: f64) -> (f64, bool) {
    if (end - best.at[axis]) * outwards <= 0.0 {
        return (best.at[axis], false);
    }
    let mut free = [true; 3];
    free[axis] = false;
    let at = |value: f64, from: Trial| {
        let mut start = from;
        start.at[axis] = value;
        start.chi2 = chi2(rows, start.at);
        search(rows, start, free)
    };
    let (mut inside, mut step) = (best, 0.01);
    loop {
        let next = inside.at[axis] + outwards * step;
        let is_last = (end - next) * outwards <= 0.0;
        let there = at(if is_last { end } else { next }, inside);
        if there.chi2 > allowed {
            let (mut low, mut high) = (inside, there.at[axis]);
            for _ in 0..20 {
                let middle = at(0.5 * (low.at[axis] + high), low);
                if middle.chi2 > allowed { high = middle.at[axis] } else { low = middle }
            }
            return (0.5 * (low.at[axis] + high), true);
        }
        if is_last {
            return (end, false);
        }
        (inside, step) = (there, 1.6 * step);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Passes of a finger, as the slider has them, with 1 % up and down by turns.
    fn passes(finger: &Finger) -> Vec<Pass> {
        let amplitudes = [0.0, 0.5e-6, 1e-6, 1.5e-6, 2e-6, 2.5e-6, 3e-6, 4e-6, 5e-6];
        let one = |(n, w): (usize, &f64)| {
            let condition = Condition { amplitude: PeakToPeak::from_metres(*w), ..Condition::paper() };
            let mu_relative = if *w == 0.0 {
                1.0
            } else {
                spring_slider::solve(&condition, finger).expect("a condition").mu_relative
            };
            let wobble = if n % 2 == 0 { 1.01 } else { 0.99 };
            Pass::at(
                n as u64,
                &condition,
                Some(wobble * mu_relative * condition.mu0 * condition.normal_force_n),
            )
        };
        amplitudes.iter().enumerate().map(one).collect()
    }

    #[test]
    fn what_is_left_out_is_counted_and_the_largest_residual_is_the_largest() {
        let mut passes = passes(&Finger::paper());
        let noise = PassNoise { pass_relative_sd: 0.01, force_sd_n: 1e-4 };
        let whole = springs(&passes, &noise).expect("springs");
        assert_eq!(whole.left_out, 0);
        assert!(whole.residual_largest_n > 1.05 * whole.residual_rms_n, "{whole:?}");
        // A reference without a frequency is a reference; a pass with vibration and none, or without a force, is neither.
        passes[0].frequency_hz = 0.0;
        passes[3].frequency_hz = 0.0;
        passes[5].lateral_force_n = None;
        let fewer = springs(&passes, &noise).expect("springs");
        assert_eq!((fewer.left_out, fewer.passes), (2, whole.passes - 2));
    }

    /// Passes of a finger with air under it, which the slider lacks: stiffnesses of no finger were certified.
    #[test]
    fn passes_that_the_slider_does_not_explain_give_no_springs() {
        let mut passes = passes(&Finger::paper());
        let noise = PassNoise { pass_relative_sd: 0.015, force_sd_n: 8e-4 };
        let fitted = |passes: &[Pass]| springs(passes, &noise).expect("springs").of_a_law_that_holds();
        assert!(fitted(&passes).is_ok_and(|s| s.lack_of_fit_p > 0.01));
        for pass in &mut passes {
            let vibrates = pass.amplitude != PeakToPeak::ZERO;
            let lifted = if vibrates && pass.amplitude.metres() < 2.2e-6 { 0.6 } else { 1.0 };
            pass.lateral_force_n = pass.lateral_force_n.map(|force| lifted * force);
        }
        let why = fitted(&passes).unwrap_err();
        assert!(
            matches!(why, FingerError::Misfit { reduced_chi2, passes: 8 } if reduced_chi2 > 4.0),
            "{why:?}"
        );
        assert!(
            why.to_string().contains("muprime diagnose") && why.to_string().contains("--pass-relative-sd")
        );
    }

    #[test]
    fn a_best_value_beyond_the_range_has_no_end_there() {
        let rows: Vec<Row> = Vec::new();
        let best = Trial { at: [0.0, 2.0, 0.0], chi2: 0.0 };
        assert_eq!(profile_end(&rows, best, 1, 1.0, 1.0, 4.0), (2.0, false));
        assert_eq!(profile_end(&rows, best, 1, 3.0, -1.0, 4.0), (2.0, false));
    }
}
