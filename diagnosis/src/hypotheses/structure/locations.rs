//! Where shapes may be: the places of each kind over each covariate of a table, and over its histories.

use super::axis::{Past, ShapeAxis};
use super::form::ShapeForm;
use super::shapes::ShapeKind;
use crate::data::range;
use crate::regression::Problem;
use crate::scatter::moments;
use models::covariate::{COVARIATES, CovariateRole, FREQUENCY, SPEED, Scale};
use std::f64::consts::PI;
use std::sync::Arc;

/// Places of a jump, and of a bump or a resonance; widths of these as shares of the range.
const PLACES: [usize; 2] = [60, 40];
const WIDTHS: [f64; 3] = [0.02, 0.05, 0.1];
/// Fewest passes on either side of a jump, or within a bump.
const FEWEST: f64 = 4.0;
/// Levels of a covariate from which a jump or a bump is not a law of it, and from which a function may be rough.
const LEVELS: usize = 8;
const ROUGH_LEVELS: usize = 24;
/// Periods over the range: fewest, most, and the step; phases of each in turns.
const PERIODS: (f64, f64, f64) = (3.0, 100.0, 0.5);
const PHASES: [f64; 4] = [0.0, 0.125, 0.25, 0.375];
/// Phases of a resonance.
const SEEN: [f64; 3] = [0.25 * PI, 0.5 * PI, 0.75 * PI];
/// Correlation lengths of a rough function, as shares of the range.
const ROUGH: [f64; 2] = [0.04, 0.1];
/// Levels of a covariate from which there may be a trend, and the powers of its distance from the low end.
const TREND_LEVELS: usize = 3;
const POWERS: [f64; 5] = [0.25, 0.5, 1.0, 2.0, 4.0];
/// Distances, as shares of the stroke, within which the place of the pass before counts.
const REACHES: [f64; 3] = [0.05, 0.15, 0.4];

/// A place, or a length, in the covariate's unit, with the shape there.
pub(super) type Placed = (f64, ShapeForm);

/// Every kind of shape over every axis that may have it.
pub(super) fn placed(part: &Problem, past: &Arc<Past>) -> Vec<(ShapeKind, ShapeAxis, Vec<Placed>)> {
    let largest = part.design.largest_amplitude_m;
    let own = COVARIATES.into_iter().flat_map(|covariate| {
        let axis = ShapeAxis { covariate, past: None };
        let x: Option<Vec<f64>> = part.passes.iter().map(|p| axis.of(p, largest)).collect();
        let values = covariate.of_all(&part.passes);
        let list = x.zip(values).map(|(x, values)| over(&axis, part, &x, &values)).unwrap_or_default();
        list.into_iter().map(move |(kind, places)| (kind, axis.clone(), places))
    });
    let histories = ShapeAxis::histories(&part.passes, past, largest).into_iter().map(|axis| {
        let places = remembered(&axis, part);
        (ShapeKind::Memory, axis, places)
    });
    own.chain(histories).filter(|(_, _, places)| !places.is_empty()).collect()
}

/// The shapes that a covariate may have: a trend alone where it has few levels, for there a jump is a law.
fn over(axis: &ShapeAxis, part: &Problem, x: &[f64], values: &[f64]) -> Vec<(ShapeKind, Vec<Placed>)> {
    let covariate = axis.covariate;
    let mut order: Vec<usize> = (0..x.len()).collect();
    order.sort_by(|&a, &b| x[a].total_cmp(&x[b]));
    let (first, last) = (order[0], order[order.len() - 1]);
    let range = x[last] - x[first];
    let unit = (values[last] - values[first]) / range;
    let levels = 1 + order.windows(2).filter(|w| x[w[1]] - x[w[0]] > 1e-3 * range).count();
    if range.is_nan() || range <= covariate.least_spread || levels < TREND_LEVELS {
        return Vec::new();
    }
    // Half of a trend is made up where its power is one half.
    let half =
        |power: f64| order[order.partition_point(|&i| (x[i] - x[first]) / range < 0.5f64.powf(1.0 / power))];
    let trends = POWERS.map(|power| (values[half(power)], ShapeForm::Over(x[first], range, power))).to_vec();
    if levels < LEVELS {
        return vec![(ShapeKind::Trend, trends)];
    }
    let seen: Vec<Option<f64>> = x.iter().copied().map(Some).collect();
    let weight = |form: &ShapeForm| form.columns(&seen).iter().map(|v| v.abs()).sum::<f64>();
    let enough = |(_, form): &Placed| (FEWEST..=x.len() as f64 - FEWEST).contains(&weight(form));
    let place = |q: f64| order[((order.len() - 1) as f64 * q).round() as usize];
    let mut jumps: Vec<Placed> = (1..PLACES[0])
        .map(|j| place(j as f64 / PLACES[0] as f64))
        .map(|row| (values[row], ShapeForm::From(x[row])))
        .filter(enough)
        .collect();
    jumps.dedup_by(|a, b| a.0 == b.0);
    let mut spots: Vec<(usize, f64)> = WIDTHS
        .iter()
        .flat_map(|width| (0..=PLACES[1]).map(move |j| (width * range, j as f64 / PLACES[1] as f64)))
        .map(|(width, q)| (place(q), width))
        .collect();
    spots.dedup_by(|a, b| x[a.0] == x[b.0] && a.1 == b.1);
    let about = |row: usize, width: f64| (values[row], ShapeForm::About(x[row], width));
    spots.retain(|(row, width)| enough(&about(*row, *width)));
    let peak = |(row, width): &(usize, f64)| (values[*row], ShapeForm::Through(x[*row], *width, 0.0));
    let bumps = spots.iter().map(|(row, width)| about(*row, *width)).chain(spots.iter().map(peak)).collect();
    let mut all = vec![(ShapeKind::Jump, jumps), (ShapeKind::Bump, bumps), (ShapeKind::Trend, trends)];
    if covariate.name == FREQUENCY.name || covariate.name == SPEED.name {
        let through = |(row, width): &(usize, f64)| {
            SEEN.map(|phase| (values[*row], ShapeForm::Through(x[*row], *width, phase)))
        };
        all.push((ShapeKind::Resonance, spots.iter().flat_map(through).collect()));
    }
    let combed = covariate.name == FREQUENCY.name && levels >= ROUGH_LEVELS;
    if combed || matches!(covariate.role, CovariateRole::Time | CovariateRole::Place) {
        all.push((ShapeKind::Period, periods(axis, x.len(), [values[first], values[last]])));
    }
    if levels >= ROUGH_LEVELS && matches!(covariate.role, CovariateRole::Setting | CovariateRole::Place) {
        let any = |share: f64| (unit * share * range, ShapeForm::any(x, share * range, &part.constants));
        all.push((ShapeKind::Rough, ROUGH.map(any).to_vec()));
    }
    all
}

/// Periods over a range of a covariate, in its unit.
fn periods(axis: &ShapeAxis, passes: usize, [low, high]: [f64; 2]) -> Vec<Placed> {
    let most = PERIODS.1.min(passes as f64 / 4.0);
    let steps = ((most - PERIODS.0) / PERIODS.2).floor();
    let scale = if let Scale::Linear(unit) = axis.covariate.scale { unit } else { 1.0 };
    let log = axis.covariate.scale == Scale::Log;
    let of = |count: f64| {
        let length = (high - low) / count;
        PHASES.map(|phase| {
            (length, ShapeForm::Turns { length: length / scale, start: low / scale, phase, log })
        })
    };
    (0..=steps.max(-1.0) as i64).flat_map(|i| of(PERIODS.0 + PERIODS.2 * i as f64)).collect()
}

/// What a pass before leaves: along its setting, counted from the mean; or the more the nearer its place was.
fn remembered(axis: &ShapeAxis, part: &Problem) -> Vec<Placed> {
    let largest = part.design.largest_amplitude_m;
    let x: Vec<f64> = part.passes.iter().filter_map(|p| axis.of(p, largest)).collect();
    if axis.covariate.role == CovariateRole::Place {
        let [low, high] = range(part.passes.iter().filter_map(|p| axis.covariate.of(p)));
        let unit = axis.covariate.scaled(1.0, largest);
        return REACHES.map(|share| share * (high - low)).map(|r| (r, ShapeForm::Within(r * unit))).to_vec();
    }
    let (mean, sd) = moments(&x);
    let middle = part.passes.iter().filter_map(|p| axis.covariate.of(p)).sum::<f64>() / part.len() as f64;
    vec![(middle, ShapeForm::Along(mean, sd))]
}
