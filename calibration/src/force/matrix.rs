//! The calibration matrix from a dead-weight series.
//!
//! Loads are known and counts scatter, so counts are regressed on loads and the matrix is inverted for use:
//! `counts_i = o_i + sum_j (g_ij F_j + q_ij F_j^2) + d_i (t - t0) + h_ij b s_j + temperature`. Both channels
//! share the design; the scatter of their residuals may be correlated (Zellner 1962: with one design for all
//! channels ordinary least squares loses nothing). Errors that all loads share (gravity, masses, the
//! direction of the pull) cannot show in the residuals: they are added as type B.

mod judge;

use super::series::{LoadReading, Weighing};
use super::{AXES, Axis};
use crate::regression::{FitError, ends, linear};
use nalgebra::{DMatrix, DVector, Matrix2};

/// What the model may contain.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Linearity {
    /// A straight line on each axis.
    #[default]
    Linear,
    /// With the square of each load.
    Quadratic,
}

/// How a series is judged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Straight or with squares.
    pub linearity: Linearity,
    /// Counts at which the converter ends, where known.
    pub count_limits: Option<[f64; 2]>,
    /// A zero that drifts by more than this fraction of the span over the series is refused.
    pub zero_drift_limit: f64,
    /// A temperature spread from which on the temperature coefficients are fitted, in K.
    pub temperature_spread_k: f64,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            linearity: Linearity::Linear,
            count_limits: None,
            zero_drift_limit: 0.01,
            temperature_spread_k: 2.0,
        }
    }
}

/// Why a series gives no calibration.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the message of an error says what its fields are")]
pub enum ForceError {
    /// Not enough different loads on an axis.
    #[error("{axis} axis: {found} different loads are too few for this model, {needed} are needed")]
    TooFewLoads { axis: Axis, found: usize, needed: usize },
    /// Not enough zero readings.
    #[error("{found} zero readings are too few: take one before, one after and one between (3 or more)")]
    TooFewZeros { found: usize },
    /// A reading at the end of the converter's range.
    #[error("reading {row} ({axis} axis, {load_n:.4} N) is saturated: use smaller weights or a larger range")]
    Saturated { row: usize, axis: Axis, load_n: f64 },
    /// Each channel answers the other axis' weights.
    #[error("the axes are swapped: lateral weights move the normal channel, normal weights the lateral one")]
    SwappedAxes,
    /// One channel answers the wrong axis.
    #[error(
        "the {axis} channel answers {axis} weights less than the other channel does ({own:.4} against \
         {other:.4} counts/N): check the direction of the pull and the wiring"
    )]
    AxisBlind { axis: Axis, own: f64, other: f64 },
    /// The zero moved too far while weights were read.
    #[error(
        "the zero of the {axis} channel drifted by {counts:.1} +- {sd:.1} counts over the series ({percent:.2} % of the \
         span, {limit:.2} % are allowed): {remedy}"
    )]
    DriftingZero { axis: Axis, counts: f64, sd: f64, percent: f64, limit: f64, remedy: &'static str },
    /// Neighbouring readings err alike.
    #[error(
        "neighbouring readings of the {axis} channel err alike (correlation {correlation:.2}): the zero wanders \
         more slowly than you read; wait longer between readings or average longer"
    )]
    Correlated { axis: Axis, correlation: f64 },
    /// The model does not describe the readings within their own repeatability.
    #[error("the {axis} channel does not follow the model (lack of fit p = {p:.1e}): {remedy}")]
    LackOfFit { axis: Axis, p: f64, remedy: &'static str },
    /// The regression itself failed.
    #[error(transparent)]
    Fit(#[from] FitError),
}

/// A term of the model, the same for both channels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Term {
    /// Reading without load.
    Offset,
    /// Counts per newton of the load on that axis.
    Gain(Axis),
    /// Counts per newton squared.
    Square(Axis),
    /// Counts per second.
    Drift,
    /// Half opening of the loop in counts, at half of that axis' largest load.
    Hysteresis(Axis),
    /// Counts per kelvin.
    ZeroTemperature,
    /// Counts per newton and kelvin.
    GainTemperature(Axis),
}

impl Term {
    /// Name and unit in a certificate, for one channel.
    pub fn name(self, channel: Axis) -> (String, &'static str) {
        match self {
            Term::Offset => (format!("{channel}.offset"), "counts"),
            Term::Gain(axis) => (format!("{channel}.gain_{axis}"), "counts/N"),
            Term::Square(axis) => (format!("{channel}.square_{axis}"), "counts/N^2"),
            Term::Drift => (format!("{channel}.drift"), "counts/s"),
            Term::Hysteresis(axis) => (format!("{channel}.hysteresis_{axis}"), "counts"),
            Term::ZeroTemperature => (format!("{channel}.zero_temperature"), "counts/K"),
            Term::GainTemperature(axis) => (format!("{channel}.gain_{axis}_temperature"), "counts/(N K)"),
        }
    }
}

/// A fitted series. Parameters are ordered channel by channel, within a channel as `terms`.
#[derive(Clone, Debug, PartialEq)]
pub struct ForceFit {
    /// Terms of each channel.
    pub terms: Vec<Term>,
    /// Estimates, lateral channel first.
    pub estimates: DVector<f64>,
    /// Covariance by statistics of the residuals.
    pub type_a: DMatrix<f64>,
    /// Covariance of what all loads share.
    pub type_b: DMatrix<f64>,
    /// Residual covariance of one reading, lateral and normal, in counts squared.
    pub scatter: Matrix2<f64>,
    /// Degrees of freedom of the scatter.
    pub degrees_of_freedom: f64,
    /// Residuals in counts, row by row.
    pub residuals: Vec<[f64; 2]>,
    /// Lack-of-fit p value of the worse channel, where there are replicates.
    pub lack_of_fit_p: Option<f64>,
    /// Range of the loads of each axis in N.
    pub range_n: [[f64; 2]; 2],
    /// Mean temperature and its range, where measured.
    pub temperature_c: Option<[f64; 3]>,
    /// Number of readings.
    pub readings: usize,
}

impl ForceFit {
    /// Index of a term of a channel in estimates and covariances.
    pub fn index(&self, channel: Axis, term: Term) -> Option<usize> {
        self.terms.iter().position(|t| *t == term).map(|k| channel as usize * self.terms.len() + k)
    }

    /// Estimate of a term, zero where the model lacks it.
    pub fn value(&self, channel: Axis, term: Term) -> f64 {
        self.index(channel, term).map_or(0.0, |i| self.estimates[i])
    }

    /// Type A and B together.
    pub fn covariance(&self) -> DMatrix<f64> {
        &self.type_a + &self.type_b
    }

    /// Effective degrees of freedom of each parameter (Welch-Satterthwaite; type B taken as known).
    pub fn effective_degrees_of_freedom(&self) -> Vec<f64> {
        (0..self.estimates.len())
            .map(|i| {
                let (a, b) = (self.type_a[(i, i)], self.type_b[(i, i)]);
                if a > 0.0 { self.degrees_of_freedom * ((a + b) / a).powi(2) } else { f64::INFINITY }
            })
            .collect()
    }
}

/// Fits a series and judges it.
///
/// # Errors
/// Anything that makes the series unfit for a certificate, with what to do about it.
pub fn fit(readings: &[LoadReading], weighing: &Weighing, options: &Options) -> Result<ForceFit, ForceError> {
    judge::refuse_unfit(readings, options)?;
    let design = Design::of(readings, options);
    let x = DMatrix::from_fn(readings.len(), design.terms.len(), |i, k| {
        design.entry(&readings[i], design.terms[k])
    });
    let counts = |a: Axis| DVector::from_fn(readings.len(), |i, _| readings[i].counts[a as usize]);
    let channel = |a: Axis| linear::ordinary(&x, &counts(a));
    let fits = [channel(Axis::Lateral)?, channel(Axis::Normal)?];
    let dof = fits[0].degrees_of_freedom;
    let scatter = Matrix2::from_fn(|a, b| fits[a].residuals.dot(&fits[b].residuals) / dof);
    let p = design.terms.len();
    // (X'X)^-1 from channel 0, whose covariance is that times its own scatter.
    let unscaled = linear::unit_variance(&x, &DVector::zeros(readings.len()))?.covariance;
    let type_a = DMatrix::from_fn(2 * p, 2 * p, |i, j| scatter[(i / p, j / p)] * unscaled[(i % p, j % p)]);
    let mut result = ForceFit {
        estimates: DVector::from_iterator(2 * p, fits.iter().flat_map(|f| f.estimates.iter().copied())),
        type_b: DMatrix::zeros(2 * p, 2 * p),
        type_a,
        scatter,
        degrees_of_freedom: dof,
        residuals: (0..readings.len()).map(|i| [fits[0].residuals[i], fits[1].residuals[i]]).collect(),
        lack_of_fit_p: None,
        range_n: AXES
            .map(|a| ends(readings.iter().filter(|r| r.axis == Some(a)).map(|r| r.load_n).chain([0.0]))),
        temperature_c: design.temperature_c,
        readings: readings.len(),
        terms: design.terms.clone(),
    };
    result.type_b = type_b(&result, weighing);
    judge::judge(&mut result, readings, options)?;
    Ok(result)
}

struct Design {
    terms: Vec<Term>,
    mean_time_s: f64,
    largest_n: [f64; 2],
    temperature_c: Option<[f64; 3]>,
}

impl Design {
    fn of(readings: &[LoadReading], options: &Options) -> Self {
        let mut terms = vec![Term::Offset, Term::Gain(Axis::Lateral), Term::Gain(Axis::Normal)];
        if options.linearity == Linearity::Quadratic {
            terms.extend(AXES.map(Term::Square));
        }
        terms.push(Term::Drift);
        for axis in AXES {
            let on =
                |branch| readings.iter().filter(|r| r.axis == Some(axis) && r.branch == Some(branch)).count();
            if on(super::series::Branch::Up) >= 2 && on(super::series::Branch::Down) >= 2 {
                terms.push(Term::Hysteresis(axis));
            }
        }
        let temperatures: Option<Vec<f64>> = readings.iter().map(|r| r.temperature_c).collect();
        let temperature_c = temperatures.map(|t| {
            let [low, high] = ends(t.iter().copied());
            [t.iter().sum::<f64>() / t.len() as f64, low, high]
        });
        if temperature_c.is_some_and(|[_, low, high]| high - low >= options.temperature_spread_k) {
            terms.push(Term::ZeroTemperature);
            terms.extend(AXES.map(Term::GainTemperature));
        }
        let largest =
            |a| readings.iter().filter(|r| r.axis == Some(a)).fold(0f64, |m, r| m.max(r.load_n.abs()));
        Design {
            terms,
            mean_time_s: readings.iter().map(|r| r.time_s).sum::<f64>() / readings.len() as f64,
            largest_n: AXES.map(largest),
            temperature_c,
        }
    }

    fn entry(&self, r: &LoadReading, term: Term) -> f64 {
        let load = |axis| if r.axis == Some(axis) { r.load_n } else { 0.0 };
        let kelvin = || r.temperature_c.unwrap_or(0.0) - self.temperature_c.map_or(0.0, |t| t[0]);
        match term {
            Term::Offset => 1.0,
            Term::Gain(axis) => load(axis),
            Term::Square(axis) => load(axis).powi(2),
            Term::Drift => r.time_s - self.mean_time_s,
            Term::Hysteresis(axis) => {
                // A lag opposes the change of the load: under a pull to the other side it turns its sign.
                let x = load(axis) / self.largest_n[axis as usize];
                r.branch.map_or(0.0, |b| b.sign() * 4.0 * x * (1.0 - x.abs()))
            }
            Term::ZeroTemperature => kelvin(),
            Term::GainTemperature(axis) => load(axis) * kelvin(),
        }
    }
}

fn type_b(fit: &ForceFit, weighing: &Weighing) -> DMatrix<f64> {
    let n = fit.estimates.len();
    let common = DVector::from_fn(n, |i, _| match fit.terms[i % fit.terms.len()] {
        Term::Gain(_) | Term::GainTemperature(_) => fit.estimates[i],
        Term::Square(_) => 2.0 * fit.estimates[i],
        _ => 0.0,
    });
    let mut covariance = &common * common.transpose() * weighing.relative_sd().powi(2);
    // A pull that is off by a small angle loads the other axis by that share.
    for axis in AXES {
        let other = AXES[1 - axis as usize];
        let mut turned = DVector::zeros(n);
        for channel in AXES {
            if let Some(i) = fit.index(channel, Term::Gain(axis)) {
                turned[i] = fit.value(channel, Term::Gain(other));
            }
        }
        covariance += &turned * turned.transpose() * weighing.alignment_sd_rad[axis as usize].powi(2);
    }
    covariance
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::series::Branch;
    use super::*;

    /// Weights up and down on both axes, laterally both ways, with a lag of `lag` counts. The zero moves by 3
    /// counts/K on the lateral and by -2 counts/K on the normal channel.
    pub(crate) fn series(lag: f64) -> Vec<LoadReading> {
        let largest = 2.0;
        let up = [0.2, 0.5, 1.0, 1.5, 2.0].map(|load| (load, Branch::Up));
        let down = [1.5, 1.0, 0.5, 0.2].map(|load| (load, Branch::Down));
        let zero = (None, 1.0, 0.0, None);
        let mut order = vec![zero];
        for _ in 0..3 {
            for (axis, side) in [(Axis::Lateral, 1.0), (Axis::Lateral, -1.0), (Axis::Normal, 1.0)] {
                let loads = up.iter().chain(&down);
                order.extend(loads.map(|(load, branch)| (Some(axis), side, *load, Some(*branch))));
                order.push(zero);
            }
        }
        let read = |(i, (axis, side, load, branch)): (usize, (Option<Axis>, f64, f64, Option<Branch>))| {
            let x = load / largest;
            let lagging = branch.map_or(0.0, |b: Branch| -b.sign() * lag * 4.0 * x * (1.0 - x) * side);
            let on = |a: Axis| if axis == Some(a) { side * load } else { 0.0 };
            let moved = |a: Axis| if axis == Some(a) { lagging } else { 0.0 };
            let kelvin = [-2.0, 1.0, 2.0, -1.0, 0.0, 1.5, -1.5][i % 7];
            let noise = [1.0, -1.0, 0.5, -0.5, -1.0, 1.0, 0.0, 0.5, -0.5, 0.2, -0.2][i % 11];
            let lateral =
                118.0 + 8_000.0 * on(Axis::Lateral) + 90.0 * on(Axis::Normal) + moved(Axis::Lateral);
            let normal =
                3_300.0 - 120.0 * on(Axis::Lateral) + 8_100.0 * on(Axis::Normal) + moved(Axis::Normal);
            LoadReading {
                time_s: 20.0 * i as f64,
                axis,
                load_n: side * load,
                counts: [lateral + 3.0 * kelvin + noise, normal - 2.0 * kelvin - noise],
                branch,
                temperature_c: Some(22.0 + kelvin),
                saturated: false,
            }
        };
        order.into_iter().enumerate().map(read).collect()
    }

    #[test]
    fn a_lag_under_lateral_weights_both_ways_is_found() {
        for lag in [2.0, 8.0] {
            let found = fit(&series(lag), &Weighing::default(), &Options::default()).unwrap();
            for axis in AXES {
                let k = found.index(axis, Term::Hysteresis(axis)).unwrap();
                let (value, sd) = (found.estimates[k], found.type_a[(k, k)].sqrt());
                assert!((value + lag).abs() < 3.0 * sd && sd < 0.5, "{axis}: {value} +- {sd}, not -{lag}");
            }
        }
    }
}
