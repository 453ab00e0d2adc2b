//! What makes a series unfit for a certificate.

use super::{ForceError, ForceFit, Linearity, Options, Term};
use crate::force::series::LoadReading;
use crate::force::{AXES, Axis};
use crate::regression::ends;
use crate::uncertainty::student;

/// Before the fit: saturation, too few loads or zeros.
pub(super) fn refuse_unfit(readings: &[LoadReading], options: &Options) -> Result<(), ForceError> {
    for (i, r) in readings.iter().enumerate() {
        for axis in AXES {
            let counts = r.counts[axis as usize];
            let out = options.count_limits.is_some_and(|[low, high]| counts <= low || counts >= high);
            if out || (r.saturated && r.axis.unwrap_or(Axis::Normal) == axis) {
                return Err(ForceError::Saturated { row: i + 1, axis, load_n: r.load_n });
            }
        }
    }
    let needed = if options.linearity == Linearity::Linear { 3 } else { 4 };
    for axis in AXES {
        let mut loads: Vec<_> = readings.iter().filter(|r| r.axis == Some(axis)).map(|r| r.load_n).collect();
        loads.sort_by(f64::total_cmp);
        loads.dedup_by(|a, b| (*a - *b).abs() < 1e-9 + 1e-6 * b.abs());
        if loads.len() < needed {
            return Err(ForceError::TooFewLoads { axis, found: loads.len(), needed });
        }
    }
    let zeros = readings.iter().filter(|r| r.axis.is_none()).count();
    if zeros < 3 { Err(ForceError::TooFewZeros { found: zeros }) } else { plateau(readings) }
}

/// A converter that stands still while the load still grows, or that repeats its extreme value to the last
/// digit where every other mean has a fraction, is saturated even without the instrument's flag.
fn plateau(readings: &[LoadReading]) -> Result<(), ForceError> {
    for axis in AXES {
        let a = axis as usize;
        let fractions = readings.iter().any(|r| r.counts[a].fract() != 0.0);
        for sign in [1.0, -1.0] {
            let mut rows: Vec<(usize, &LoadReading)> = readings
                .iter()
                .enumerate()
                .filter(|r| r.1.axis == Some(axis) && r.1.load_n * sign > 0.0)
                .collect();
            rows.sort_by(|p, q| (q.1.load_n * sign).total_cmp(&(p.1.load_n * sign)));
            let Some(&(row, top)) = rows.first() else { continue };
            let saturated = Err(ForceError::Saturated { row: row + 1, axis, load_n: top.load_n });
            let lower = rows.iter().find(|r| (r.1.load_n - top.load_n).abs() > 0.02 * top.load_n.abs());
            if lower.is_some_and(|r| r.1.counts[a] == top.counts[a]) {
                return saturated;
            }
            let twins = rows.iter().filter(|r| r.1.counts[a] == top.counts[a]).count();
            if fractions && twins > 1 && top.counts[a].fract() == 0.0 {
                return saturated;
            }
        }
    }
    Ok(())
}

/// After the fit: swapped axes, drifting zero, lack of fit, wandering zero.
pub fn judge(fit: &mut ForceFit, readings: &[LoadReading], options: &Options) -> Result<(), ForceError> {
    let gain = |channel, axis| fit.value(channel, Term::Gain(axis));
    let blind = AXES.map(|a| gain(a, a).abs() <= gain(AXES[1 - a as usize], a).abs());
    if blind[0] && blind[1] {
        return Err(ForceError::SwappedAxes);
    }
    for axis in AXES {
        if blind[axis as usize] {
            let other = gain(AXES[1 - axis as usize], axis);
            return Err(ForceError::AxisBlind { axis, own: gain(axis, axis), other });
        }
    }
    let [start, end] = ends(readings.iter().map(|r| r.time_s));
    let mut worst = None;
    for axis in AXES {
        let p = lack_of_fit(fit, readings, axis);
        if let Some(p) = p.filter(|p| *p < 1e-3) {
            let remedy = match options.linearity {
                Linearity::Linear => "try the quadratic model, and check the weights",
                Linearity::Quadratic => "check the weights and the order of the readings",
            };
            return Err(ForceError::LackOfFit { axis, p, remedy });
        }
        worst = [worst, p].into_iter().flatten().reduce(f64::min);
        let [low, high] = ends(readings.iter().map(|r| r.counts[axis as usize]));
        let span = high - low;
        let drift = fit.value(axis, Term::Drift) * (end - start);
        let variance = fit.index(axis, Term::Drift).map_or(0.0, |i| fit.type_a[(i, i)]);
        let sd = variance.sqrt() * (end - start);
        if drift.abs() > options.zero_drift_limit * span {
            return Err(ForceError::DriftingZero {
                axis,
                counts: drift,
                sd,
                percent: 100.0 * drift.abs() / span,
                limit: 100.0 * options.zero_drift_limit,
                remedy: if drift.abs() > 2.0 * sd {
                    "let it warm up, then repeat"
                } else {
                    "the readings scatter too much to tell a drift; find the noise, average longer, then repeat"
                },
            });
        }
        let correlation = neighbours(fit, readings, axis);
        // For independent errors the lag-1 correlation has a standard deviation near 1 / sqrt(n).
        if correlation * (readings.len() as f64).sqrt() > 3.3 {
            return Err(ForceError::Correlated { axis, correlation });
        }
    }
    fit.lack_of_fit_p = worst;
    Ok(())
}

/// F test of the model against the scatter of readings at one load (and branch, and temperature).
fn lack_of_fit(fit: &ForceFit, readings: &[LoadReading], channel: Axis) -> Option<f64> {
    let mut groups: Vec<(&LoadReading, Vec<f64>)> = Vec::new();
    for (i, r) in readings.iter().enumerate() {
        let residual = fit.residuals[i][channel as usize];
        let same = |s: &LoadReading| {
            s.axis == r.axis
                && (s.load_n - r.load_n).abs() < 1e-9 + 1e-6 * r.load_n.abs()
                && s.branch == r.branch
        };
        match groups.iter_mut().find(|(first, _)| same(first)) {
            Some((_, members)) => members.push(residual),
            None => groups.push((r, vec![residual])),
        }
    }
    let groups: Vec<Vec<f64>> = groups.into_iter().map(|(_, members)| members).collect();
    student::lack_of_fit(&groups, fit.terms.len())
}

/// Correlation of the residuals of neighbouring readings in time.
fn neighbours(fit: &ForceFit, readings: &[LoadReading], channel: Axis) -> f64 {
    let mut order: Vec<usize> = (0..readings.len()).collect();
    order.sort_by(|a, b| readings[*a].time_s.total_cmp(&readings[*b].time_s));
    let r = |i: usize| fit.residuals[order[i]][channel as usize];
    let total: f64 = (0..order.len()).map(|i| r(i).powi(2)).sum();
    if total == 0.0 { 0.0 } else { (1..order.len()).map(|i| r(i) * r(i - 1)).sum::<f64>() / total }
}
