//! Departures of a known shape, each by its own evidence: a jump, a bump, a period, a resonance, a rough
//! function or a trend over one covariate, or what a pass before leaves.
//!
//! `y = baseline + A h + scatter`, h the shape at one place, width or period, A ~ N(0, s^2) with s on a grid,
//! the nuisances linear. The integral is exact, and the evidence of a shape is its mean over places. It acts
//! on friction (turning with the direction) or on the sensor. A rough function is many columns h at once.
//! Each is also tried under other scatter (`ground`). docs/diagnosis/model.md, section 6.

use super::axis::{Past, ShapeAxis};
use super::factor::{Factor, factor, factor_of};
use super::form::{Placement, ShapeForm, Way};
use super::locations::placed;
use super::scatter_model::{Ground, Under, grounds};
use crate::regression::{NUISANCES, Posterior, Problem, log_sum_exp};
use crate::scatter::Scatter;
use effects::Input;
use models::Covariate;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::sync::Arc;

/// Passes that are looked at: of longer tables every second, third and so on.
const MOST_PASSES: usize = 2000;
/// Nats by which a rough function must lead more scatter, which is no function of a covariate.
const ROUGH_LEAD: f64 = 4.0;
/// Share of its nats that counts for a rough function beside another shape: it also takes up what another
/// form of that shape leaves, as of a square wave beside a sine.
const ROUGH_SHARE: f64 = 0.7;
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
    /// A peak beside a trough, as an oscillator has it that is driven through its resonance.
    Resonance,
    /// A function that changes within a small part of the range.
    Rough,
    /// What a pass before leaves.
    Memory,
    /// A rise or fall from one end to the other.
    Trend,
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
    /// Log evidence without more scatter, which takes up what tells shapes apart.
    alone: f64,
    /// Log evidence over that of no gap, with larger scatter where that is likelier.
    pub stands_out: f64,
    /// Place, or length of a period, with its 95 % interval, in the covariate's unit.
    pub at: (f64, [f64; 2]),
    /// Size in units of full friction, with its interval.
    pub size: (f64, [f64; 2]),
    pub(super) best: Placement,
}

impl Shape {
    /// Nats by which shapes are ordered.
    fn order_nats(&self) -> f64 {
        if self.kind == ShapeKind::Rough { ROUGH_SHARE * self.alone } else { self.alone }
    }
}

/// Shapes of one kind over one axis: where each is, and the columns of each.
struct Family {
    kind: ShapeKind,
    axis: ShapeAxis,
    way: Way,
    at: Vec<f64>,
    forms: Vec<ShapeForm>,
    columns: Columns,
    /// Root mean square over passes of the column's unit, in full friction.
    unit: f64,
}

/// Columns of the places of a family.
enum Columns {
    /// One for each place.
    One(DMatrix<f64>),
    /// Several for each, with what they are in proportion to and without it.
    Several(Vec<[DMatrix<f64>; 2]>),
}

/// Every kind of shape over every covariate that may have it, clearest first.
pub fn shapes(problem: &Problem, none: &Posterior, scatter: &Scatter) -> Vec<Shape> {
    let n = problem.len();
    let rows: Vec<usize> = (0..n).step_by(n.div_ceil(MOST_PASSES).max(1)).collect();
    let part = problem.select(&rows);
    let prediction = part.predict(&[], &none.u);
    let jacobian = part.jacobian(&[], &none.u, &prediction);
    let nuisance = DVector::from_column_slice(&none.u[..NUISANCES]);
    let residual = DVector::from_column_slice(&part.lateral) - &prediction + &jacobian * nuisance;
    let lasting = (scatter, scatter.lasting_columns(problem));
    let (grounds, more) = grounds(&part, &jacobian, &residual, (none, &prediction), lasting);
    let past = Arc::new(Past::of(&problem.passes));
    let mut list: Vec<Shape> = families(&part, &past, &none.u, &prediction)
        .par_iter()
        .map(|family| weighed(family, &grounds, &residual, more))
        .collect();
    list.retain(|shape| shape.kind != ShapeKind::Rough || shape.nats > more + ROUGH_LEAD);
    list.sort_by(|a, b| b.order_nats().total_cmp(&a.order_nats()));
    list
}

/// Log evidence of any of them over no gap's. Trends are smooth: they have their part in the open set.
pub fn nats(shapes: &[Shape]) -> f64 {
    let all: Vec<f64> = shapes.iter().filter(|s| s.kind != ShapeKind::Trend).map(|s| s.nats).collect();
    log_sum_exp(&all) - (all.len().max(1) as f64).ln()
}

fn weighed(family: &Family, grounds: &[Ground], residual: &DVector<f64>, more: f64) -> Shape {
    let count = family.at.len() as f64;
    let mut parts: Vec<(f64, Vec<Factor>)> = Vec::new();
    for ground in grounds {
        let each: Vec<Factor> = match &family.columns {
            Columns::One(columns) => {
                let (b, q) = ground.covariance.scores(columns, residual);
                b.iter().zip(&q).map(|(b, q)| factor(*b, *q)).collect()
            }
            Columns::Several(all) => {
                all.iter().map(|columns| factor_of(columns, &ground.covariance, residual)).collect()
            }
        };
        let all: Vec<f64> = each.iter().map(|e| e.nats).collect();
        parts.push((ground.nats + log_sum_exp(&all) - count.ln(), each));
    }
    let over = |wanted: &dyn Fn(Under) -> bool| {
        let all = parts.iter().zip(grounds).filter(|(_, ground)| wanted(ground.under));
        log_sum_exp(&all.map(|(part, _)| part.0).collect::<Vec<_>>())
    };
    let nats = over(&|_| true);
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
        covariate: family.axis.covariate,
        turns: !matches!(family.way, Way::Reading(_)),
        nats,
        alone: over(&|under| !matches!(under, Under::More(_))),
        stands_out: nats - more.max(0.0),
        at: (family.at[top], [0.5 * (low + below), 0.5 * (high + above)]),
        size: (size, [size - 1.96 * sd, size + 1.96 * sd]),
        best: Placement {
            axis: family.axis.clone(),
            form: family.forms[top].clone(),
            way: family.way,
            sd: best[top].size,
            under: grounds[under].under,
        },
    }
}

fn families(part: &Problem, past: &Arc<Past>, u: &[f64], prediction: &DVector<f64>) -> Vec<Family> {
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
    for (kind, axis, places) in placed(part, past) {
        let largest = part.design.largest_amplitude_m;
        let x: Vec<Option<f64>> = part.passes.iter().map(|p| axis.of(p, largest)).collect();
        let forms: Vec<ShapeForm> = places.iter().map(|place| place.1.clone()).collect();
        let bare: Vec<DMatrix<f64>> = forms.iter().map(|form| form.columns(&x)).collect();
        for (way, signal) in &signals {
            let laid = bare.iter().map(|bare| {
                let mut columns = bare.clone();
                columns.column_iter_mut().for_each(|mut c| c.component_mul_assign(signal));
                columns
            });
            let columns = if kind == ShapeKind::Rough {
                Columns::Several(laid.zip(&bare).map(|(columns, bare)| [columns, bare.clone()]).collect())
            } else {
                let all: Vec<DVector<f64>> = laid.map(|c| c.column(0).into_owned()).collect();
                Columns::One(DMatrix::from_columns(&all))
            };
            let at = places.iter().map(|place| place.0).collect();
            let (axis, forms, unit) = (axis.clone(), forms.clone(), rms(signal));
            list.push(Family { kind, axis, way: *way, at, forms, columns, unit });
        }
    }
    list
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Table;
    use crate::regression::minimise;
    use crate::tests::{Deviates, rig, table};
    use models::Condition;

    /// The best shape of a table whose friction coefficient is times what a pass and the one before make it,
    /// and the gap in nats.
    fn best(mut table: Table, factor: impl Fn(&Condition, &Condition) -> f64) -> (Shape, f64) {
        let mut draw = Deviates(8);
        let baseline = Problem::new(&table, &rig(), &Default::default()).nominal;
        for i in 0..table.len() {
            let p = &table.passes[i];
            let mu0 = 0.5 * factor(p, &table.passes[i.saturating_sub(1)]);
            let there = effects::Baseline { mu0, ..baseline };
            let force = effects::lateral_force(&there, &[], p, &table.design);
            table.lateral[i] = force * (1.0 + 0.02 * draw.normal()) + 0.001 * draw.normal();
        }
        let mut problem = Problem::new(&table, &rig(), &Default::default());
        let (_, _, scatter) =
            crate::scatter::noise::settle(&table, &rig(), &mut problem, &crate::scatter::Belief::ByResidual);
        let fit = minimise(&problem, &[], &[0.0; NUISANCES], &problem.variance, 15);
        let basis = crate::regression::bases::Basis::none(problem.len());
        let (_, none) = crate::regression::evidence::averaged_over_form(&problem, &fit.u, &[], &basis);
        let gap = problem.misfit(&none.prediction) - problem.len() as f64;
        (shapes(&problem, &none, &scatter).swap_remove(0), 0.5 * gap)
    }

    /// Passes whose speeds and frequencies fill their ranges, in no order.
    fn filled() -> Table {
        let mut table = table(&mut Deviates(7), 0.0);
        let n = table.len();
        for (i, p) in table.passes.iter_mut().enumerate() {
            let share = |by: usize| (i * by % n) as f64 / n as f64;
            p.speed_m_s = 0.01 * 9f64.powf(share(7));
            p.frequency_hz = 25e3 + 10e3 * share(11);
        }
        table
    }

    /// A friction coefficient that rises or falls by a third half way, under vibration: a jump in time of
    /// that sign, with nearly all of the gap's evidence, though the forces do not rise in proportion.
    #[test]
    fn a_jump_of_the_coefficient_has_its_sign_and_its_evidence() {
        for factor in [1.33, 0.7] {
            let jumps = |p: &Condition, _: &Condition| if p.time_s > 90.0 { factor } else { 1.0 };
            let (best, gap) = best(table(&mut Deviates(7), 0.0), jumps);
            assert_eq!((best.kind, best.covariate.name), (ShapeKind::Jump, "time_s"), "{best:?}");
            assert!(best.size.0 * (factor - 1.0) > 0.0, "{factor}: {:?}", best.size);
            assert!(best.nats > 0.7 * gap, "{} nats of a gap of {gap}", best.nats);
        }
    }

    /// A coefficient that rises with the speed by half, evenly or at high speed only: a trend over it.
    #[test]
    fn a_smooth_rise_is_a_trend() {
        let share = |p: &Condition| (p.speed_m_s / 0.01).ln() / 9f64.ln();
        let found = [1, 3].map(|power| best(filled(), |p, _| 1.0 + 0.5 * share(p).powi(power)).0);
        for shape in &found {
            assert_eq!((shape.kind, shape.covariate.name), (ShapeKind::Trend, "speed_m_s"), "{shape:?}");
            assert!(shape.size.0 > 0.0, "{:?}", shape.size);
        }
        assert!(found[1].at.0 >= found[0].at.0, "{:?}", found.map(|shape| shape.at));
    }

    /// A coefficient that goes with the load of the pass before, or with whether the direction has turned: a
    /// memory of that. Where loads rise from pass to pass, a memory of the load is a law, and none is seen.
    #[test]
    fn what_the_pass_before_leaves_is_a_memory() {
        let load = |_: &Condition, last: &Condition| (last.normal_force_n / 0.3).powf(0.4);
        let turned = |p: &Condition, last: &Condition| 1.0 + 0.2 * p.direction.sign() * last.direction.sign();
        let random = || table(&mut Deviates(7), 0.0);
        let found = best(random(), load).0;
        assert_eq!((found.kind, found.covariate.name), (ShapeKind::Memory, "normal_force_n"), "{found:?}");
        let found = best(random(), turned).0;
        assert_eq!((found.kind, found.covariate.name), (ShapeKind::Memory, "direction"), "{found:?}");
        let mut rising = random();
        for (i, p) in rising.passes.iter_mut().enumerate() {
            p.normal_force_n = 0.1 * 1.06f64.powi(i as i32);
        }
        let remembers_load = |table: &Table| {
            let past = Arc::new(Past::of(&table.passes));
            let axes = ShapeAxis::histories(&table.passes, &past, table.design.largest_amplitude_m);
            axes.iter().any(|axis| axis.covariate.name == "normal_force_n")
        };
        assert!(remembers_load(&random()) && !remembers_load(&rising));
    }

    /// A fall beside a peak over frequency is a resonance, at its place; a jagged function of the speed is
    /// rough.
    #[test]
    fn a_resonance_and_a_rough_function_are_no_bump() {
        let dispersive = |p: &Condition, _: &Condition| {
            let z = (p.frequency_hz - 30e3) / 700.0;
            1.0 + 0.6 * z / (1.0 + z * z)
        };
        let found = best(filled(), dispersive).0;
        assert_eq!((found.kind, found.covariate.name), (ShapeKind::Resonance, "frequency_hz"), "{found:?}");
        assert!((found.at.0 - 30e3).abs() < 700.0, "{:?}", found.at);
        let jagged = |p: &Condition, _: &Condition| {
            let z = p.speed_m_s.ln();
            1.0 + 0.2 * ((11.0 * z).sin() + (17.3 * z + 1.0).sin() + (7.1 * z + 2.0).sin())
        };
        let found = best(filled(), jagged).0;
        assert_eq!((found.kind, found.covariate.name), (ShapeKind::Rough, "speed_m_s"), "{found:?}");
    }
}
