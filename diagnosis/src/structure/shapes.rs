//! Departures of a known shape, each by its own evidence: a jump, a bump or a period over one covariate.
//!
//! `y = baseline + A h + scatter`, h the shape at one place, width or period, A ~ N(0, s^2) with s on a grid,
//! the nuisances linear. The integral is exact, and the evidence of a shape is its mean over places. It acts
//! on friction (turning with the direction) or on the sensor. Scatter that lasts can take up any of them, so
//! each is also tried where independent scatter is all there is. docs/diagnosis/model.md, section 6.

use super::form::{Form, Placement, Way};
use crate::evidence::Posterior;
use crate::fit::Problem;
use crate::gaussian::{Covariance, log_sum_exp};
use crate::layout::NUISANCES;
use crate::scatter::Scatter;
use effects::Input;
use models::covariate::{COVARIATES, Covariate, Role};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Deviations of a shape's size, in units of full friction.
const SIZES: [f64; 4] = [0.02, 0.06, 0.2, 0.6];
/// Scales of independent scatter where none is to last.
const SCALES: [f64; 4] = [1.0, 1.3, 1.7, 2.2];
/// Places of a jump, and of a bump; its widths as shares of the range.
const PLACES: [usize; 2] = [60, 40];
const WIDTHS: [f64; 3] = [0.02, 0.05, 0.1];
/// Fewest passes on either side of a jump, or within a bump.
const FEWEST: f64 = 4.0;
/// Levels of a covariate from which a jump or a bump is not a law of it.
const LEVELS: usize = 8;
/// Periods over the range: fewest, most, and the step; phases of each in turns.
const PERIODS: (f64, f64, f64) = (3.0, 100.0, 0.5);
const PHASES: [f64; 4] = [0.0, 0.125, 0.25, 0.375];
/// Passes that are looked at: of longer tables every second, third and so on.
const MOST_PASSES: usize = 2000;
/// Ends of a 95 % interval.
const ENDS: [f64; 2] = [0.025, 0.975];

/// What a shape is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ShapeKind {
    /// Another level from some place on.
    Jump,
    /// A place of its own: a spot, a spell, a resonance.
    Bump,
    /// What repeats.
    Period,
}

/// A departure of one kind over one covariate.
#[derive(Debug, Clone)]
pub struct Shape {
    /// What it is.
    pub kind: ShapeKind,
    /// Over what.
    pub covariate: &'static Covariate,
    /// Whether it turns with the direction, as friction does.
    pub turns: bool,
    /// Log evidence over no gap's.
    pub nats: f64,
    /// Place, or length of a period, with its 95 % interval, in the covariate's unit.
    pub at: (f64, [f64; 2]),
    /// Size in units of full friction, with its interval.
    pub size: (f64, [f64; 2]),
    pub(super) best: Placement,
}

/// Shapes of one kind over one covariate: where each is, and a column for each.
struct Family {
    kind: ShapeKind,
    covariate: &'static Covariate,
    way: Way,
    at: Vec<f64>,
    forms: Vec<Form>,
    columns: DMatrix<f64>,
    /// Root mean square over passes of the column's unit, in full friction.
    unit: f64,
}

/// Scatter under which shapes are tried: its covariance, and log evidence of no gap under it beside that as
/// settled.
struct Ground {
    covariance: Covariance,
    nats: f64,
    alone: Option<(f64, usize)>,
}

/// Every kind of shape over every covariate that may have it, strongest first.
pub fn shapes(problem: &Problem, none: &Posterior, scatter: &Scatter) -> Vec<Shape> {
    let n = problem.len();
    let rows: Vec<usize> = (0..n).step_by(n.div_ceil(MOST_PASSES).max(1)).collect();
    let part = problem.select(&rows);
    let prediction = part.predict(&[], &none.u);
    let jacobian = part.jacobian(&[], &none.u, &prediction);
    let nuisance = DVector::from_column_slice(&none.u[..NUISANCES]);
    let residual = DVector::from_column_slice(&part.lateral) - &prediction + &jacobian * nuisance;
    let grounds = grounds(&part, &jacobian, &residual, scatter.lasting_columns(problem), scatter.slow_cost);
    let mut list: Vec<Shape> = families(&part, &none.u, &prediction)
        .par_iter()
        .map(|family| weighed(family, &grounds, &residual))
        .collect();
    list.sort_by(|a, b| b.nats.total_cmp(&a.nats));
    list
}

/// Log evidence of any of them over no gap's.
pub fn nats(shapes: &[Shape]) -> f64 {
    let all: Vec<f64> = shapes.iter().map(|s| s.nats).collect();
    log_sum_exp(&all) - (all.len().max(1) as f64).ln()
}

fn grounds(
    part: &Problem,
    jacobian: &DMatrix<f64>,
    residual: &DVector<f64>,
    lasting: usize,
    cost: f64,
) -> Vec<Ground> {
    let evidence = |c: &Covariance| -0.5 * (c.quadratic(residual) + c.log_det());
    let settled = part.covariance(jacobian);
    let own = evidence(&settled);
    let mut list = vec![Ground { covariance: settled, nats: 0.0, alone: None }];
    if lasting > 0 {
        list.extend(SCALES.map(|scale| {
            let covariance = independent(part, scale, lasting).covariance(jacobian);
            let nats = evidence(&covariance) - own + cost - (SCALES.len() as f64).ln();
            Ground { covariance, nats, alone: Some((scale, lasting)) }
        }));
    }
    list
}

/// A problem whose scatter is this much larger and does not last.
pub(super) fn independent(part: &Problem, scale: f64, lasting: usize) -> Problem {
    let shifts = part.common.columns(lasting, part.common.ncols() - lasting).into_owned();
    let variance = part.variance.iter().map(|v| v * scale * scale).collect();
    Problem { common: shifts, variance, ..part.clone() }
}

/// Log Bayes factor of one column, by its score b and information q, averaged over sizes; with the mean and
/// deviation of its weight, at the best size.
fn factor(b: f64, q: f64) -> Factor {
    let each = SIZES.map(|s| {
        let grown = 1.0 + s * s * q;
        let nats = 0.5 * (b * b * s * s / grown - grown.ln());
        Factor { nats, mean: b * s * s / grown, sd: s / grown.sqrt(), size: s }
    });
    let best = each.iter().fold(each[0], |a, e| if e.nats > a.nats { *e } else { a });
    Factor { nats: log_sum_exp(&each.map(|e| e.nats)) - (SIZES.len() as f64).ln(), ..best }
}

#[derive(Clone, Copy)]
struct Factor {
    nats: f64,
    mean: f64,
    sd: f64,
    size: f64,
}

fn weighed(family: &Family, grounds: &[Ground], residual: &DVector<f64>) -> Shape {
    let count = family.at.len() as f64;
    let mut parts: Vec<(f64, Vec<Factor>)> = Vec::new();
    for ground in grounds {
        let (b, q) = ground.covariance.scores(&family.columns, residual);
        let each: Vec<Factor> = b.iter().zip(&q).map(|(b, q)| factor(*b, *q)).collect();
        let all: Vec<f64> = each.iter().map(|e| e.nats).collect();
        parts.push((ground.nats + log_sum_exp(&all) - count.ln(), each));
    }
    // Half the weight for scatter as settled, half for independent scatter.
    let share = if grounds.len() > 1 { 0.5_f64.ln() } else { 0.0 };
    let total: Vec<f64> = parts.iter().map(|p| p.0 + share).collect();
    let under = (0..parts.len()).max_by(|&i, &j| parts[i].0.total_cmp(&parts[j].0)).unwrap_or(0);
    let best = parts[under].1.as_slice();
    let top = (0..best.len()).max_by(|&i, &j| best[i].nats.total_cmp(&best[j].nats)).unwrap_or(0);
    let whole = log_sum_exp(&best.iter().map(|e| e.nats).collect::<Vec<_>>());
    let mut order: Vec<usize> = (0..best.len()).collect();
    order.sort_by(|&i, &j| family.at[i].total_cmp(&family.at[j]));
    let end = |share: f64| {
        let mut sum = 0.0;
        let found = order.iter().find(|&&i| {
            sum += (best[i].nats - whole).exp();
            sum >= share
        });
        family.at[*found.or(order.last()).unwrap_or(&0)]
    };
    // Places are a grid: an end of the interval lies half way to the next of them.
    let places = order.iter().map(|&i| family.at[i]);
    let [low, high] = ENDS.map(end);
    let below = places.clone().rfind(|at| *at < low).unwrap_or(low);
    let above = places.clone().find(|at| *at > high).unwrap_or(high);
    let (size, sd) = (best[top].mean * family.unit, best[top].sd * family.unit);
    Shape {
        kind: family.kind,
        covariate: family.covariate,
        turns: !matches!(family.way, Way::Reading(_)),
        nats: log_sum_exp(&total),
        at: (family.at[top], [0.5 * (low + below), 0.5 * (high + above)]),
        size: (size, [size - 1.96 * sd, size + 1.96 * sd]),
        best: Placement {
            form: family.forms[top],
            way: family.way,
            sd: best[top].size,
            alone: grounds[under].alone,
        },
    }
}

fn families(part: &Problem, u: &[f64], prediction: &DVector<f64>) -> Vec<Family> {
    let full = part.full_friction();
    let mean = full.iter().sum::<f64>() / full.len() as f64;
    let rms = |f: &DVector<f64>| {
        ((0..full.len()).map(|i| (f[i] / full[i]).powi(2)).sum::<f64>() / full.len() as f64).sqrt()
    };
    let friction = Way::Friction.signal(part, u, prediction);
    // What a change of the friction coefficient or of the amplitude does is not in proportion to the force.
    let input = |input: Input| {
        let slope = Way::Input(input, 1.0).signal(part, u, prediction);
        // A size is that of friction: a larger amplitude lowers it.
        Way::Input(input, rms(&friction) / rms(&slope).max(1e-9).copysign(slope.dot(&friction)))
    };
    let both = part.passes.iter().any(|p| p.direction != part.passes[0].direction);
    let ways = [input(Input::Friction), input(Input::Amplitude), Way::Friction, Way::Reading(mean)];
    let signals: Vec<(Way, DVector<f64>)> =
        ways[..if both { 4 } else { 3 }].iter().map(|way| (*way, way.signal(part, u, prediction))).collect();
    let mut list = Vec::new();
    for covariate in COVARIATES {
        let values: Option<Vec<f64>> = part.passes.iter().map(|p| covariate.of(p)).collect();
        let Some(values) = values else { continue };
        for (kind, shapes) in over(part, covariate, &values) {
            for (way, signal) in &signals {
                let columns = DMatrix::from_fn(part.len(), shapes.len(), |i, j| shapes[j].2[i] * signal[i]);
                let at = shapes.iter().map(|s| s.0).collect();
                let forms = shapes.iter().map(|s| s.1).collect();
                list.push(Family { kind, covariate, way: *way, at, forms, columns, unit: rms(signal) });
            }
        }
    }
    list
}

/// A place, or the length of a period, with the shape there and its value at each pass.
type Placed = (f64, Form, Vec<f64>);

/// The shapes that a covariate may have: none where it has few levels, for there a jump is a law.
fn over(part: &Problem, covariate: &Covariate, values: &[f64]) -> Vec<(ShapeKind, Vec<Placed>)> {
    let largest = part.design.largest_amplitude_m;
    let x: Vec<f64> = values.iter().map(|v| covariate.scaled(*v, largest)).collect();
    let mut order: Vec<usize> = (0..x.len()).collect();
    order.sort_by(|&a, &b| x[a].total_cmp(&x[b]));
    let (low, high) = (x[order[0]], x[order[order.len() - 1]]);
    let range = high - low;
    let unit = (values[order[order.len() - 1]] - values[order[0]]) / range;
    let apart = order.windows(2).filter(|w| x[w[1]] - x[w[0]] > 1e-3 * range).count();
    if range.is_nan() || range <= covariate.least_spread || apart + 1 < LEVELS {
        return Vec::new();
    }
    let placed = |at: f64, form: Form| -> Placed { (at, form, x.iter().map(|v| form.at(*v)).collect()) };
    let enough = |(_, _, s): &Placed| {
        (FEWEST..=x.len() as f64 - FEWEST).contains(&s.iter().map(|v| v.abs()).sum::<f64>())
    };
    let place = |q: f64| order[((order.len() - 1) as f64 * q).round() as usize];
    let mut jumps: Vec<Placed> = (1..PLACES[0])
        .map(|j| place(j as f64 / PLACES[0] as f64))
        .map(|row| placed(values[row], Form::From(x[row])))
        .filter(enough)
        .collect();
    jumps.dedup_by(|a, b| a.0 == b.0);
    let mut bumps: Vec<Placed> = WIDTHS
        .iter()
        .flat_map(|width| (0..=PLACES[1]).map(move |j| (width, j as f64 / PLACES[1] as f64)))
        .map(|(width, q)| (width, place(q)))
        .map(|(width, row)| placed(values[row], Form::About(x[row], width * range)))
        .filter(enough)
        .collect();
    bumps.dedup_by(|a, b| a.2 == b.2);
    let mut periods: Vec<Placed> = Vec::new();
    if matches!(covariate.role, Role::Time | Role::Place) {
        let most = PERIODS.1.min(x.len() as f64 / 4.0);
        let mut count = PERIODS.0;
        while count <= most {
            for phase in PHASES {
                periods.push(placed(unit * range / count, Form::Turns(count / range, low, phase)));
            }
            count += PERIODS.2;
        }
    }
    let all = [(ShapeKind::Jump, jumps), (ShapeKind::Bump, bumps), (ShapeKind::Period, periods)];
    all.into_iter().filter(|(_, list)| !list.is_empty()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::example::{Deviates, rig, table};
    use crate::least_squares::minimise;

    /// A friction coefficient that rises or falls by a third half way, under vibration: a jump in time of
    /// that sign, with nearly all of the gap's evidence, though the forces do not rise in proportion.
    #[test]
    fn a_jump_of_the_coefficient_has_its_sign_and_its_evidence() {
        for factor in [1.33, 0.7] {
            let mut draw = Deviates(8);
            let mut table = table(&mut Deviates(7), 0.0);
            let baseline = Problem::new(&table, &rig(), &Default::default()).nominal;
            for (p, lateral) in table.passes.iter().zip(&mut table.lateral) {
                let mu0 = 0.5 * if p.time_s > 90.0 { factor } else { 1.0 };
                let there = effects::Baseline { mu0, ..baseline };
                let force = effects::lateral_force(&there, &[], p, &table.design);
                *lateral = force * (1.0 + 0.02 * draw.normal()) + 0.001 * draw.normal();
            }
            let mut problem = Problem::new(&table, &rig(), &Default::default());
            let (_, _, scatter) =
                crate::noise::settle(&table, &rig(), &mut problem, &crate::scatter::Belief::Judged);
            let fit = minimise(&problem, &[], &[0.0; NUISANCES], &problem.variance, 15);
            let basis = crate::bases::Basis::none(problem.len());
            let (_, none) = crate::evidence::averaged_over_form(&problem, &fit, &[], &basis);
            let best = &shapes(&problem, &none, &scatter)[0];
            let gap = problem.misfit(&none.prediction) - problem.len() as f64;
            assert_eq!((best.kind, best.covariate.name), (ShapeKind::Jump, "time_s"), "{best:?}");
            assert!(best.size.0 * (factor - 1.0) > 0.0, "{factor}: {:?}", best.size);
            assert!(best.nats > 0.35 * gap, "{} nats of a gap of {gap}", best.nats);
        }
    }
}
