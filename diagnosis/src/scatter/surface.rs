//! A flexible surface through a table, with the scales of its parts and of the scatter about it.

use crate::constants::Constants;
use crate::data::Table;
use crate::regression::{Lengths, Linear, NUISANCES, Problem, Scaled, rows_times};
use crate::scatter::lasting;
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// Places of the scales on their grids.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State {
    even: usize,
    odd: usize,
    /// Stays at the first place, zero, where the table does not separate runs.
    run: usize,
    scale: usize,
    /// Size and correlation of what lasts from pass to pass.
    slow: usize,
    lasts: usize,
    with_runs: bool,
    /// Largest places of what lasts that the length of the runs allows.
    most: lasting::Bounds,
}

/// Sweeps over the scales.
const SWEEPS: usize = 12;

impl State {
    /// Where the climb begins: a small departure, the stated scatter.
    pub fn start(with_runs: bool) -> Self {
        State {
            even: 2,
            odd: 0,
            run: usize::from(with_runs),
            scale: 4,
            slow: 0,
            lasts: 1,
            with_runs,
            most: lasting::Bounds::default(),
        }
    }

    /// The same where what lasts is bounded.
    pub fn within(self, most: &lasting::Bounds) -> Self {
        State { slow: self.slow.min(most.size), lasts: self.lasts.min(most.correlation), most: *most, ..self }
    }

    /// The same with scatter that lasts: from independent passes a climb does not find it.
    fn lasting(self, k: &Constants) -> Self {
        if self.slow > 0 {
            self
        } else {
            State { slow: k.slow_sizes.len() / 2, even: 0, ..self }.within(&self.most)
        }
    }

    /// Size of the slow scatter over that of the independent one, and its correlation from pass to pass.
    pub fn slow(&self, k: &Constants) -> [f64; 2] {
        [k.slow_sizes[self.slow], k.slow_correlations[self.lasts]]
    }

    /// Relative deviation of the level from run to run.
    pub fn run(&self, k: &Constants) -> f64 {
        k.run_sds[self.run]
    }

    fn scale(&self, k: &Constants) -> f64 {
        k.scatter_scales[self.scale]
    }

    fn log_prior(&self, k: &Constants) -> f64 {
        let (scale, run) = (self.scale(k).ln() / k.scatter_log_sd, self.run(k) / k.run_sd_prior);
        let costs = [(self.run, k.run_nats), (self.slow, k.slow_nats)];
        let costs: f64 = costs.iter().map(|(at, nats)| if *at > 0 { *nats } else { 0.0 }).sum();
        -0.5 * (scale * scale + run * run) - costs
    }

    /// States one step away.
    fn neighbours(&self, k: &Constants) -> Vec<State> {
        let mut list: Vec<State> = Vec::new();
        let mut step = |at: usize, len: usize, to: &dyn Fn(usize) -> State| {
            list.extend([at.checked_sub(1), (at + 1 < len).then_some(at + 1)].into_iter().flatten().map(to));
        };
        step(self.scale, k.scatter_scales.len(), &|scale| State { scale, ..*self });
        step(self.even, k.discrepancy_even.len(), &|even| State { even, ..*self });
        step(self.odd, k.discrepancy_odd.len(), &|odd| State { odd, ..*self });
        step(self.slow, self.most.size + 1, &|slow| State { slow, ..*self });
        if self.slow > 0 {
            step(self.lasts, self.most.correlation + 1, &|lasts| State { lasts, ..*self });
        }
        if self.with_runs {
            step(self.run, k.run_sds.len(), &|run| State { run, ..*self });
        }
        list
    }
}

/// A surface at one smoothness: what is to be explained, and the columns that explain it.
pub struct ScatterSurface {
    constants: Arc<Constants>,
    linear: Linear,
    lateral: DVector<f64>,
    runs: Vec<usize>,
    run_count: usize,
    /// Cosines in the order of measurement.
    cosines: DMatrix<f64>,
}

/// A table beside a surface through it.
pub struct Seen {
    /// Each pass's distance from what the others lead to expect, in deviations of a pass that belongs there.
    pub left_out: Vec<f64>,
    /// Residual beside the surface in deviations of a pass, bounded where the pass counts for little.
    pub beside: Vec<f64>,
    /// The surface, N.
    pub level: Vec<f64>,
}

impl ScatterSurface {
    /// The surface of one smoothness.
    pub fn new(table: &Table, problem: &Problem, center: &[f64], lengths: Lengths) -> Self {
        ScatterSurface {
            constants: problem.constants.clone(),
            linear: Linear::about(table, problem, center, lengths),
            lateral: DVector::from_column_slice(&problem.lateral),
            runs: table.runs.clone(),
            run_count: if table.run_count > 1 { table.run_count } else { 0 },
            cosines: lasting::cosines(&problem.constants, table),
        }
    }

    /// Columns (those of runs and of what lasts come last) and residual in weighted deviations of a pass as
    /// stated, with the logarithms of those.
    fn whitened(&self, variance: &[f64], weight: &[f64], level: &[f64]) -> Whitened {
        let n = variance.len();
        let root = DVector::from_fn(n, |i, _| (weight[i] / variance[i]).sqrt());
        let (own, slow) = (self.linear.columns.ncols(), self.cosines.ncols());
        let mut columns = self.linear.columns.clone().resize_horizontally(own + self.run_count + slow, 0.0);
        // What lasts is counted in deviations of a pass as stated.
        for (mut own, cosine) in
            columns.columns_mut(own + self.run_count, slow).column_iter_mut().zip(self.cosines.column_iter())
        {
            (0..n).for_each(|i| own[i] = cosine[i] * variance[i].sqrt());
        }
        if self.run_count > 0 {
            (0..n).for_each(|i| columns[(i, own + self.runs[i])] = level[i]);
        }
        let columns = rows_times(columns, &root);
        let z = self.linear.residual.component_mul(&root);
        Whitened { gram: columns.tr_mul(&columns), score: columns.tr_mul(&z), z, columns }
    }

    fn sizes(&self, s: &State) -> Vec<f64> {
        let k = &*self.constants;
        let (r, scale) = (self.linear.kernel.rank(), s.scale(k));
        let parts = [(r, k.discrepancy_even[s.even]), (r, k.discrepancy_odd[s.odd]), (NUISANCES, 1.0)];
        let runs = (self.run_count, s.run(k));
        let [slow, rho] = s.slow(k);
        let lasting = lasting::powers(rho, self.linear.residual.len(), self.cosines.ncols());
        parts
            .into_iter()
            .chain([runs])
            .flat_map(|(count, size)| vec![size / scale; count])
            .chain(lasting.into_iter().map(|power| slow * power.sqrt()))
            .collect()
    }

    fn log_posterior(&self, w: &Whitened, s: &State) -> f64 {
        let Some(parts) = Scaled::new(&w.gram, &w.score, self.sizes(s)) else { return f64::NEG_INFINITY };
        let (n, scale) = (w.z.len() as f64, s.scale(&self.constants));
        let chi2 = (w.z.norm_squared() - parts.explained) / (scale * scale);
        s.log_prior(&self.constants) - 0.5 * (chi2 + parts.log_det) - n * scale.ln()
    }

    /// Climbs the marginal likelihood, prior included, from a state, a step of one scale at a time; its
    /// logarithm is up to what all states share.
    pub fn climbed(&self, variance: &[f64], weight: &[f64], level: &[f64], start: State) -> (f64, State) {
        let w = self.whitened(variance, weight, level);
        let found = self.climb(&w, start, |_| true);
        let other = self.climb(&w, found.1.lasting(&self.constants), |_| true);
        if other.0 > found.0 { other } else { found }
    }

    fn climb(&self, w: &Whitened, start: State, open: impl Fn(&State) -> bool) -> (f64, State) {
        let mut best = (self.log_posterior(w, &start), start);
        let mut tried = vec![start];
        for _ in 0..SWEEPS {
            let before = best.0;
            for s in best.1.neighbours(&self.constants).into_iter().filter(&open) {
                if tried.contains(&s) {
                    continue;
                }
                tried.push(s);
                let value = self.log_posterior(w, &s);
                if value > best.0 {
                    best = (value, s);
                }
            }
            if best.0 <= before {
                break;
            }
        }
        best
    }

    /// The same of the recalibrated baseline alone, with the scale of the scatter that suits it.
    pub fn bare(&self, variance: &[f64], weight: &[f64], level: &[f64], s: &State) -> (f64, State, f64) {
        let w = self.whitened(variance, weight, level);
        let start = State { even: 0, odd: 0, ..*s };
        let (value, best) =
            self.climb(&w, start, |s| (s.even, s.odd, s.slow, s.lasts) == (0, 0, start.slow, start.lasts));
        (value, best, self.between(&w, best))
    }

    /// The best scale between the grid's places: a parabola through the logarithms of three of them.
    fn between(&self, w: &Whitened, best: State) -> f64 {
        let (k, at) = (&*self.constants, best.scale);
        if at == 0 || at + 1 == k.scatter_scales.len() {
            return best.scale(k);
        }
        let point = |scale: usize| {
            let s = State { scale, ..best };
            (s.scale(k).ln(), self.log_posterior(w, &s))
        };
        let [(x0, y0), (x1, y1), (x2, y2)] = [at - 1, at, at + 1].map(point);
        let (left, right) = ((y1 - y0) / (x1 - x0), (y2 - y1) / (x2 - x1));
        let bend = (right - left) / (x2 - x0);
        let top = if bend < 0.0 { 0.5 * (x0 + x1) - 0.5 * left / bend } else { x1 };
        top.clamp(x0, x2).exp()
    }

    /// The table beside the surface.
    pub fn seen(&self, variance: &[f64], weight: &[f64], level: &[f64], s: &State) -> Seen {
        let w = self.whitened(variance, weight, level);
        let n = w.z.len();
        let scale = s.scale(&self.constants);
        let Some(parts) = Scaled::new(&w.gram, &w.score, self.sizes(s)) else {
            let none = vec![0.0; n];
            return Seen { left_out: none.clone(), beside: none, level: level.to_vec() };
        };
        let weights = parts.weights();
        let explained = &w.columns * &weights;
        let leverage = parts.leverage(&w.columns);
        let own = self.linear.columns.ncols();
        let surface = &self.lateral - &self.linear.residual + &self.linear.columns * weights.rows(0, own);
        let mut seen = Seen {
            left_out: Vec::with_capacity(n),
            beside: Vec::with_capacity(n),
            level: surface.as_slice().to_vec(),
        };
        for i in 0..n {
            // In whitened units C = I + Phi Phi': the left-out residual is [C^-1 z]_i / [C^-1]_ii, its
            // variance 1 / [C^-1]_ii.
            let diagonal = (1.0 - leverage[i]).max(1e-9);
            let beside = (w.z[i] - explained[i]) / scale;
            let missed = beside / diagonal;
            // The pass itself counts with its nominal variance, not with the inflated one.
            let spread = (1.0 / diagonal - 1.0) + weight[i];
            seen.left_out.push(missed / spread.max(1e-9).sqrt());
            seen.beside.push(beside);
        }
        seen
    }
}

/// A surface's columns and residual in weighted deviations of a pass, and their products.
struct Whitened {
    columns: DMatrix<f64>,
    z: DVector<f64>,
    gram: DMatrix<f64>,
    score: DVector<f64>,
}
