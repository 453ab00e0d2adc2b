//! Which other cause would imitate the data, at the size and shape at which it imitates them best.
//!
//! A search in three stages. A ladder of sizes for a few draws of the shapes, the nuisances following to
//! first order; from the best rungs of two draws a bounded Levenberg-Marquardt search over nuisances, size
//! and shapes together; and for expensive causes all this on a part of the passes first, the whole table if
//! that comes near.

use super::form::{Kernel, solved};
use super::oracle::{Case, ImitationFit, NUISANCES, Theta, moved};
use super::set_maker::NoiseFree;
use crate::defects::{ALL, Defect, DefectKind, Defects, Draw, Parameter, Values, compatible};
use crate::noise::Noise;
use serde::{Deserialize, Serialize};

/// Causes whose ridges fly or recover late: marched through many cycles, hundred times as dear as the others.
const DEAR: [&str; 3] = ["ridge_inertia", "normal_damping", "lateral_recovery"];
/// Passes on which a dear cause is tried first.
const PART: usize = 36;
/// Share of the whole gap that those passes must show to stand for it: recalibrated alone they may hide it.
const LIKE: f64 = 0.3;
/// chi2 beyond the truth's under which a cause imitates the data.
pub const NEAR: f64 = 10.0;
/// Share of the gap's chi2 that departures from form could take up: one that leaves more is skipped.
const FORM_MOST: f64 = 0.5;
/// Share of the gap's chi2 to which a search is worth its steps.
const SOUGHT: f64 = 0.05;
/// A search is given up where it leaves this many times what would count as near, and a step mends little of it.
const HOPELESS: f64 = 4.0;
/// Share of the gap's chi2 that the ladder must mend for a search to follow. Rungs lie a factor of 2.4 apart at most,
/// so an exact alias is met within a factor of 1.55 and leaves 0.3 of the gap; the rest is room for its shapes.
const WORTH: f64 = 0.15;
/// The same for a dear cause where the truth is a cheap one.
const WORTH_DEAR: f64 = 0.5;
const STEPS: usize = 8;
/// Steps of a search under form uncertainty.
const FORM_STEPS: usize = 3;
/// Most unknowns: nuisances and a kind's four parameters.
const UNKNOWNS: usize = NUISANCES + 4;
/// Logarithms of the nuisances, then the parameters' coordinates.
type Unknowns = [f64; UNKNOWNS];
/// The matrix and the right side of normal equations.
type Equations = ([Unknowns; UNKNOWNS], Unknowns);
type Kind = &'static DefectKind;

/// Another cause, at the size at which it imitates the data best.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Imitator {
    /// Its name.
    pub name: String,
    /// The causes of the truth in whose place it stands alone; the others act beside it as they are.
    pub instead_of: Vec<String>,
    /// chi2 that it leaves beyond what the truth leaves (which pays for its stiffnesses' scatter); below zero
    /// where the imitation lies nearer to the stated calibration than the truth does.
    pub chi2_left: f64,
    /// The same as a share of what the recalibrated baseline leaves.
    pub share_left: f64,
    /// The same once both, truth and imitator, may depart smoothly from their form ([`super::form`]); none
    /// where it leaves too much for that to matter, and in the place of several causes.
    pub form_left: Option<f64>,
}

/// Where a search stands.
#[derive(Clone, Copy)]
struct State {
    x: Unknowns,
    chi2: f64,
    /// Whether it was searched, not only read off the ladder.
    searched: bool,
}

/// A parameter's coordinate: a share of its range, from the middle for those with two sides.
fn coordinate(p: &Parameter, value: f64) -> f64 {
    match p.draw {
        Draw::Linear => (value - p.low) / (p.high - p.low),
        Draw::Log => (value / p.low).ln() / (p.high / p.low).ln(),
        Draw::Signed => value / p.high,
        Draw::Factor => value.ln() / p.high.ln_1p(),
    }
}

fn value(p: &Parameter, u: f64) -> f64 {
    match p.draw {
        Draw::Linear => p.low + u * (p.high - p.low),
        Draw::Log => p.low * (u * (p.high / p.low).ln()).exp(),
        Draw::Signed => u * p.high,
        Draw::Factor => (u * p.high.ln_1p()).exp(),
    }
}

fn lowest(p: &Parameter) -> f64 {
    if matches!(p.draw, Draw::Signed | Draw::Factor) { -1.0 } else { 0.0 }
}

fn theta(x: &Unknowns) -> Theta {
    std::array::from_fn(|i| x[i])
}

impl Imitator {
    /// Whether the data would not tell it from the truth, form uncertainty included.
    pub fn is_near(&self) -> bool {
        self.chi2_left <= NEAR || self.form_left.is_some_and(|left| left <= NEAR)
    }
}

impl Case<'_> {
    /// Every library cause's best imitation of the data in the place of `truth`, best first. Left out are a
    /// cause that is itself all of `truth`, and those that act beside it or cannot. `base` is the
    /// recalibrated baseline, `truth_chi2` what the truth leaves. Expensive causes begin with a part unless
    /// `whole`.
    pub fn imitators(
        &self,
        truth: &[Defect],
        base: &ImitationFit,
        truth_chi2: f64,
        whole: bool,
    ) -> Vec<Imitator> {
        let part = self.part(base);
        let thinned = Case { known: &part.known, lateral_n: &part.lateral_n, sd_n: &part.sd_n, ..*self };
        let thinned_base = thinned.fit_from(&base.finger, &Defects::none(), 4);
        let gap = (base.chi2 - truth_chi2).max(1e-9);
        let thinned_gap = thinned_base.chi2 - truth_chi2;
        let near = NEAR + SOUGHT * gap;
        let dear = |kind: &DefectKind| DEAR.contains(&kind.name);
        let among_dear = truth.iter().chain(self.beside).any(|d| dear(d.kind));
        let kernel = std::cell::OnceCell::new();
        let one = |kind: Kind| {
            let mut state = if dear(kind) && !whole && thinned_gap > LIKE * gap {
                let worth = if among_dear { WORTH } else { WORTH_DEAR };
                let tried = thinned.imitate(kind, &thinned_base, truth_chi2, near, worth);
                // A part of the passes stands for the share, not for the chi2, of a gap that few passes may hold.
                let share = (tried.chi2 - truth_chi2) / thinned_gap;
                if share * gap < HOPELESS * near && tried.searched {
                    self.search(kind, tried, truth_chi2, near)
                } else {
                    State { chi2: truth_chi2 + share * gap, searched: false, ..tried }
                }
            } else {
                self.imitate(kind, base, truth_chi2, near, WORTH)
            };
            // One of several true causes: no worse than from its own size and shapes, with the stiffnesses as
            // the recalibrated baseline has them, and as this cause alone would have them.
            if let Some(own) = truth.iter().find(|d| d.kind.name == kind.name) {
                let alone = self.fit_from(&self.nominal, &Defects::one(kind, own.values), STEPS);
                for start in [base, &alone] {
                    let own = self.search(kind, self.state(own, start), truth_chi2, near);
                    if own.chi2 < state.chi2 || !state.chi2.is_finite() {
                        state = own;
                    }
                }
            }
            let chi2_left = state.chi2.min(base.chi2) - truth_chi2;
            // In the place of several causes only the share counts.
            let form_left =
                (truth.len() == 1 && state.searched && chi2_left < FORM_MOST * gap && state.chi2 < base.chi2)
                    .then(|| {
                        let (kernel, truth_cost) = kernel.get_or_init(|| {
                            let kernel = Kernel::new(self.known);
                            let cost = self.departure(&kernel, self.lateral_n, truth_chi2, base).cost;
                            (kernel, cost)
                        });
                        self.form_cost(kind, state.x, kernel, base) - truth_cost
                    });
            let name = kind.name.to_string();
            let instead_of = truth.iter().map(|d| d.kind.name.to_string()).collect();
            Imitator { name, instead_of, chi2_left, share_left: chi2_left / gap, form_left }
        };
        let known = ALL.iter().copied().filter(|kind| kind.in_library && kind.in_tables);
        let other = |kind: &Kind| truth.len() > 1 || kind.name != truth[0].kind.name;
        let goes_with = |kind: Kind, d: &Defect| d.kind.name != kind.name && compatible(d.kind, kind);
        let free = |kind: &Kind| self.beside.iter().all(|d| goes_with(kind, d));
        let mut out: Vec<Imitator> = known.filter(other).filter(free).map(one).collect();
        out.sort_by(|a, b| a.chi2_left.total_cmp(&b.chi2_left));
        out
    }

    /// A part of the passes that holds the gap in proportion: every so many of them in the order of what the
    /// baseline leaves, each counting for as many.
    fn part(&self, base: &ImitationFit) -> NoiseFree {
        let mut order: Vec<usize> = (0..self.known.len()).collect();
        let size = |i: usize| (base.residual_n[i] / self.sd_n[i]).abs();
        order.sort_by(|a, b| size(*a).total_cmp(&size(*b)));
        let every = order.len().div_ceil(PART).max(1);
        let thinned: Vec<usize> = order.iter().copied().skip(every / 2).step_by(every).collect();
        let weight = (thinned.len() as f64 / order.len() as f64).sqrt();
        NoiseFree {
            known: thinned.iter().map(|i| self.known[*i]).collect(),
            lateral_n: thinned.iter().map(|i| self.lateral_n[*i]).collect(),
            sd_n: thinned.iter().map(|i| self.sd_n[*i] * weight).collect(),
        }
    }

    /// The rungs of each draw's ladder that leave least, best first: chi2 with the nuisances refitted to
    /// first order, and the parameters.
    fn ladder(&self, kind: Kind, base: &ImitationFit) -> Vec<(f64, Values)> {
        let sides = if matches!(kind.parameters[0].draw, Draw::Log | Draw::Linear) { 1 } else { 2 };
        // Every side of the size with the first shape over its range.
        let (shapes, rungs) = match kind.parameters.len() > 1 {
            true if DEAR.contains(&kind.name) => (2, 5),
            true => (3, 6),
            false => (1, 9),
        };
        let mut noise = Noise::new(17, kind.name);
        let none = Defects::none();
        let start = self.logarithms(&base.finger);
        let model = self.predict(&base.finger, &none);
        let jacobian = self.jacobian(start, &none, &model);
        let mut out: Vec<(f64, Values)> = Vec::new();
        for draw in 0..shapes * sides {
            let mut values = kind.draw(&mut noise);
            kind.turn(&mut values, draw % 2 == 0);
            kind.reshape(&mut values, ((draw / sides) as f64 + 0.5) / shapes as f64);
            let mut best = (f64::INFINITY, values);
            for rung in 0..rungs {
                kind.resize(&mut values, (rung as f64 + 0.5) / rungs as f64);
                let left =
                    self.left(&jacobian, &self.predict(&base.finger, &Defects::one(kind, values)), start);
                if left < best.0 {
                    best = (left, values);
                }
            }
            out.push(best);
        }
        out.sort_by(|a, b| a.0.total_cmp(&b.0));
        out
    }

    /// A cause's best imitation from the two best draws of its ladder.
    fn imitate(&self, kind: Kind, base: &ImitationFit, truth_chi2: f64, near: f64, worth: f64) -> State {
        let mut best: Option<State> = None;
        let ladder = self.ladder(kind, base);
        let first = ladder[0].0;
        let starts = if DEAR.contains(&kind.name) { 1 } else { 2 };
        for (left, values) in ladder.into_iter().take(starts) {
            if left - truth_chi2 > (1.0 - worth) * (base.chi2 - truth_chi2) || left > 2.0 * first {
                continue;
            }
            let start = self.state(&Defect { kind, values }, base);
            let state = self.search(kind, start, truth_chi2, near);
            if best.is_none_or(|b| state.chi2 < b.chi2) {
                best = Some(state);
            }
            if best.is_some_and(|b| b.chi2 - truth_chi2 < 0.5 * near) {
                break;
            }
        }
        best.unwrap_or(State { x: [0.0; UNKNOWNS], chi2: first.min(base.chi2), searched: false })
    }

    /// Where a search starts: the baseline's nuisances, a cause's size and shapes.
    fn state(&self, defect: &Defect, base: &ImitationFit) -> State {
        let mut x = [0.0; UNKNOWNS];
        x[..NUISANCES].copy_from_slice(&self.logarithms(&base.finger));
        for (i, (p, value)) in defect.kind.parameters.iter().zip(defect.values).enumerate() {
            x[NUISANCES + i] = coordinate(p, value).clamp(lowest(p), 1.0);
        }
        State { x, chi2: f64::NAN, searched: true }
    }

    /// Levenberg-Marquardt within the bounds of the kind's own ranges.
    fn search(&self, kind: Kind, start: State, truth_chi2: f64, near: f64) -> State {
        let n = NUISANCES + kind.parameters.len();
        let run = |x: &Unknowns| self.run(kind, x);
        let mut at = start;
        let mut model = run(&at.x);
        at.chi2 = self.chi2(&model, theta(&at.x));
        let mut damping = 1e-3;
        for _ in 0..STEPS {
            let columns = self.columns(kind, &at.x, &model);
            let equations = self.normal_equations(&columns, &self.standardised(&model), theta(&at.x));
            let before = at.chi2;
            for _ in 0..5 {
                let next = bounded_step(kind, &equations, damping, &at.x, n);
                let trial = run(&next);
                let chi2 = self.chi2(&trial, theta(&next));
                if chi2 < at.chi2 {
                    (at, model) = (State { x: next, chi2, searched: true }, trial);
                    damping = (damping * 0.2_f64).max(1e-9);
                    break;
                }
                damping = (damping * 8.0_f64).max(1e-4);
            }
            let (gained, left) = (before - at.chi2, at.chi2 - truth_chi2);
            let hopeless = left > HOPELESS * near && gained < 0.3 * left;
            if gained < 0.02 * near.min(left.max(0.0)) + 1e-3 || hopeless {
                break;
            }
        }
        at
    }

    fn run(&self, kind: Kind, x: &Unknowns) -> Vec<f64> {
        let of = |i| kind.parameters.get(i).map_or(0.0, |p| value(p, x[NUISANCES + i]));
        self.predict(&moved(&self.nominal, theta(x)), &Defects::one(kind, std::array::from_fn(of)))
    }

    /// Derivatives of the model in standard deviations.
    fn columns(&self, kind: Kind, at: &Unknowns, model: &[f64]) -> Vec<Vec<f64>> {
        let one = |k: usize| {
            let mut x = *at;
            let h = if k < NUISANCES || x[k] < 0.5 { 2e-3 } else { -2e-3 };
            x[k] += h;
            let pairs = self.run(kind, &x).into_iter().zip(model).zip(self.sd_n);
            pairs.map(|((a, b), sd)| (a - b) / h / sd).collect()
        };
        (0..NUISANCES + kind.parameters.len()).map(one).collect()
    }

    /// Cost of an imitation that may depart from its form, from the optimum without departures: where the
    /// departure takes up what is smooth, another size may do better.
    fn form_cost(&self, kind: Kind, start: Unknowns, kernel: &Kernel, base: &ImitationFit) -> f64 {
        let mut x = start;
        let mut model = self.run(kind, &x);
        let mut now = self.departure(kernel, &model, self.prior(theta(&x)), base);
        for _ in 0..FORM_STEPS {
            let root = kernel.root(&now.change, now.scale);
            let whitened: Vec<Vec<f64>> =
                self.columns(kind, &x, &model).iter().map(|c| solved(&root, c, 0)).collect();
            let residual = solved(&root, &self.standardised(&model), 0);
            let equations = self.normal_equations(&whitened, &residual, theta(&x));
            let next = bounded_step(kind, &equations, 1e-3, &x, whitened.len());
            let trial = self.run(kind, &next);
            let then = self.departure(kernel, &trial, self.prior(theta(&next)), base);
            if then.cost > now.cost - 0.1 {
                break;
            }
            (x, model, now) = (next, trial, then);
        }
        now.cost
    }

    /// Normal equations of nuisances and parameters, the stiffnesses' priors included.
    fn normal_equations(&self, columns: &[Vec<f64>], residual: &[f64], theta: Theta) -> Equations {
        let dot = |p: &[f64], q: &[f64]| p.iter().zip(q).map(|(x, y)| x * y).sum::<f64>();
        let (mut a, mut b) = ([[0.0; UNKNOWNS]; UNKNOWNS], [0.0; UNKNOWNS]);
        let weight = self.stiffness_sd.powi(-2);
        for i in 0..columns.len() {
            b[i] = dot(&columns[i], residual);
            for j in 0..=i {
                a[i][j] = dot(&columns[i], &columns[j]);
                a[j][i] = a[i][j];
            }
            if i < 2 {
                a[i][i] += weight;
                b[i] -= weight * theta[i];
            }
        }
        (a, b)
    }
}

/// The damped step, nuisances held within a factor, parameters within their ranges: those that a step would
/// carry out stay at the bound and the others follow.
fn bounded_step(kind: &DefectKind, (a, b): &Equations, damping: f64, at: &Unknowns, n: usize) -> Unknowns {
    let bounds = |i: usize| match i.checked_sub(NUISANCES) {
        Some(k) => (lowest(&kind.parameters[k]), 1.0),
        None => (at[i] - 0.4, at[i] + 0.4),
    };
    let mut fixed = [false; UNKNOWNS];
    let mut next = *at;
    for _ in 0..=n {
        // Unknowns at their bounds move by a known amount; the rest solve what is left.
        let (mut m, mut r) = (*a, *b);
        for i in 0..n {
            m[i][i] += damping * a[i][i] + 1e-9;
            if fixed[i] {
                let moved = next[i] - at[i];
                for j in (0..n).filter(|j| !fixed[*j]) {
                    r[j] -= a[j][i] * moved;
                }
            }
        }
        for i in (0..n).filter(|i| fixed[*i]) {
            for j in 0..n {
                (m[i][j], m[j][i]) = (0.0, 0.0);
            }
            (m[i][i], r[i]) = (1.0, 0.0);
        }
        let Some(step) = super::oracle::solve(&mut m, r, n) else { return *at };
        let before = fixed;
        for i in (0..n).filter(|i| !before[*i]) {
            let (low, high) = bounds(i);
            let wanted = at[i] + step[i];
            next[i] = wanted.clamp(low, high);
            fixed[i] = wanted != next[i];
        }
        if fixed == before {
            break;
        }
    }
    next
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sealed::design::Design;
    use crate::sealed::set_maker::SetMaker;

    #[test]
    fn a_search_leaves_no_more_than_its_ladder() {
        let mut searched = 0;
        for (seed, name) in [
            (3, "adhesion"),
            (4, "load_dependent_friction"),
            (5, "subsurface_relaxation"),
            (6, "mode_shape"),
            (7, "normal_offset"),
            (8, "moisture_drift"),
        ] {
            let mut noise = Noise::new(seed, "ladder");
            let design = Design::draw(&mut noise);
            let planned = design.plan(&mut noise);
            let maker = SetMaker::draw(&mut noise, seed);
            let points = maker.circumstances(&planned, true, &mut noise);
            let truth = DefectKind::named(name).unwrap();
            let mut values = truth.draw(&mut noise);
            truth.resize(&mut values, 0.7);
            let data = maker.noise_free(&points, &Defects::one(truth, values));
            let case = maker.case(&data);
            let base = case.fit(&Defects::none(), 8);
            let found = case.imitators(&[Defect { kind: truth, values }], &base, 0.0, false);
            for imitator in found.iter().filter(|i| !DEAR.contains(&i.name.as_str())) {
                let kind = DefectKind::named(&imitator.name).unwrap();
                // The best rung with its nuisances refitted in full: the result of a ladder alone.
                let rung =
                    case.fit(&Defects::one(kind, case.ladder(kind, &base)[0].1), 3).chi2.min(base.chi2);
                // Where not even that mends a quarter of the gap no search follows, and the rung counts to first order.
                if rung < 0.75 * base.chi2 {
                    assert!(imitator.chi2_left <= 1.001 * rung + 1e-6, "{name}: {rung} {imitator:?}");
                    searched += 1;
                }
            }
        }
        assert!(searched >= 6, "{searched}");
    }
}
