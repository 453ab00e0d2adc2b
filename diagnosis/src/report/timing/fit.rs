//! The mean delay of one form: least squares over all edges, and what scatters from edge to edge.

use super::response::{Prepared, ResponseForm};
use nalgebra::{Matrix2, Vector2};

/// Mean delays at which a search starts, s, and stiffnesses of the spring under the contact, N/m.
const STARTS_S: [f64; 8] = [-0.02, -0.005, 0.0, 0.002, 0.006, 0.015, 0.035, 0.08];
const STIFFNESSES: [f64; 4] = [500.0, 2e3, 1e4, 1e6];
/// Bounds of that stiffness, N/m; from the upper one on the contact slides at once.
const STIFFNESS: [f64; 2] = [50.0, 1e7];
/// Prior of its logarithm: a skin or a silicone tip on its holder, within a factor of e squared either way.
const STIFFNESS_PRIOR: [f64; 2] = [8.0, 2.0];
/// First and last step of the walk along the delay, s.
const LONGEST_S: f64 = 8e-3;
const SHORTEST_S: f64 = 4e-4;
/// Steps of the search, and halvings of one.
const ROUNDS: usize = 12;
const HALVINGS: usize = 4;
/// Steps of the derivatives: of the delay, s, and of the logarithm of the stiffness.
const NUDGE: [f64; 2] = [1e-4, 0.02];

/// What a form came to.
#[derive(Debug, Clone)]
pub struct ResponseFit {
    /// Mean delay, s.
    pub late_s: f64,
    /// Its standard deviation by the scatter from edge to edge, s.
    pub sd_s: f64,
    /// Stiffness of the spring under the contact, N/m.
    pub stiffness: f64,
    /// Sum of squared residuals, N2.
    pub squares: f64,
    /// Variance that white noise alone would leave of the delay, over the one that the edges show: what a
    /// residual counts for.
    pub counts: f64,
}

/// Edges with the stated mean delay of the channel.
pub struct TimingRegression<'a> {
    /// The edges.
    pub edges: &'a [Prepared],
    /// Mean delay of the channel's filter as stated, s.
    pub stated_s: f64,
}

/// Takes from `y` its projection on the columns: what no level, size or drift of an edge explains.
fn left_by(mut y: Vec<f64>, columns: &mut [Vec<f64>]) -> Vec<f64> {
    for i in 0..columns.len() {
        let (done, rest) = columns.split_at_mut(i);
        let own = &mut rest[0];
        done.iter().for_each(|d| take_off(own, d));
        let length = own.iter().map(|v| v * v).sum::<f64>().sqrt();
        if length > 1e-12 {
            own.iter_mut().for_each(|v| *v /= length);
            take_off(&mut y, own);
        } else {
            own.fill(0.0);
        }
    }
    y
}

fn take_off(y: &mut [f64], unit: &[f64]) {
    let share: f64 = y.iter().zip(unit).map(|(a, b)| a * b).sum();
    y.iter_mut().zip(unit).for_each(|(a, b)| *a -= share * b);
}

impl TimingRegression<'_> {
    /// Residuals of each edge: its level, its size and a straight drift are its own.
    pub fn residuals(&self, form: ResponseForm, late_s: f64, stiffness: f64) -> Vec<Vec<f64>> {
        let one = |edge: &Prepared| {
            let shown = edge.shown(stiffness, self.stated_s, form, late_s);
            let y = edge.lateral.iter().map(|s| s.1).collect();
            let drift = edge.lateral.iter().map(|s| s.0).collect();
            left_by(y, &mut [vec![1.0; edge.lateral.len()], shown, drift])
        };
        self.edges.iter().map(one).collect()
    }

    /// Samples, less what each edge and the two common parameters take.
    pub fn freedom(&self) -> f64 {
        self.edges.iter().map(|e| e.lateral.len() as f64 - 3.0).sum::<f64>() - 2.0
    }

    fn cost(&self, form: ResponseForm, at: Vector2<f64>, variance: f64) -> f64 {
        let squares = sum(&self.residuals(form, at[0], at[1].exp()));
        squares / variance + ((at[1] - STIFFNESS_PRIOR[0]) / STIFFNESS_PRIOR[1]).powi(2)
    }

    /// The best of a grid, refined; with `fixed` the delay stays zero.
    pub fn fit(&self, form: ResponseForm, fixed: bool) -> ResponseFit {
        let [low, high] = form.range(self.stated_s);
        let bounded = |at: Vector2<f64>| {
            let late = if fixed { 0.0 } else { at[0].clamp(low, high) };
            Vector2::new(late, at[1].clamp(STIFFNESS[0].ln(), STIFFNESS[1].ln()))
        };
        let starts = STARTS_S.iter().flat_map(|t| STIFFNESSES.map(|k| bounded(Vector2::new(*t, k.ln()))));
        let squares = |at: &Vector2<f64>| sum(&self.residuals(form, at[0], at[1].exp()));
        let mut tried: Vec<(f64, Vector2<f64>)> = Vec::new();
        for at in starts {
            if tried.iter().all(|(_, seen)| *seen != at) {
                tried.push((squares(&at), at));
            }
        }
        let best = tried.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).expect("there are starts");
        let best = if fixed { best } else { descended(best, |at| squares(&bounded(at))) };
        let (variance, mut at) = (best.0.max(1e-18) / self.freedom(), bounded(best.1));
        let mut cost = self.cost(form, at, variance);
        for _ in 0..ROUNDS {
            let (hessian, gradients) = self.slopes(form, at, variance);
            let gradient: Vector2<f64> = gradients.iter().sum::<Vector2<f64>>()
                - Vector2::new(0.0, (at[1] - STIFFNESS_PRIOR[0]) / STIFFNESS_PRIOR[1].powi(2));
            let mut step = hessian.try_inverse().map_or_else(Vector2::zeros, |inverse| inverse * gradient);
            if fixed {
                step = Vector2::new(0.0, gradient[1] / hessian[(1, 1)]);
            }
            let next = (0..HALVINGS).find_map(|_| {
                let next = bounded(at + step);
                step *= 0.3;
                let value = self.cost(form, next, variance);
                (value < cost).then_some((next, value))
            });
            let Some((next, value)) = next else { break };
            let gain = cost - value;
            (at, cost) = (next, value);
            if gain < 1e-3 {
                break;
            }
        }
        self.at(form, at)
    }

    /// Curvature, and the gradient of each edge, of half the cost.
    fn slopes(
        &self,
        form: ResponseForm,
        at: Vector2<f64>,
        variance: f64,
    ) -> (Matrix2<f64>, Vec<Vector2<f64>>) {
        let here = self.residuals(form, at[0], at[1].exp());
        let nudged = [
            self.residuals(form, at[0] + NUDGE[0], at[1].exp()),
            self.residuals(form, at[0], (at[1] + NUDGE[1]).exp()),
        ];
        let mut hessian = Matrix2::new(0.0, 0.0, 0.0, STIFFNESS_PRIOR[1].powi(-2));
        let gradients = (0..here.len()).map(|e| {
            let mut gradient = Vector2::zeros();
            for (i, r) in here[e].iter().enumerate() {
                let slope = Vector2::new(nudged[0][e][i] - r, nudged[1][e][i] - r);
                let slope = slope.component_div(&Vector2::from(NUDGE));
                hessian += slope * slope.transpose() / variance;
                gradient -= slope * (r / variance);
            }
            gradient
        });
        let gradients = gradients.collect();
        (hessian, gradients)
    }

    /// What a place comes to. Noise within an edge is correlated: the scatter of the edges' own gradients
    /// says how much (the sandwich of Huber 1967), and never less than white noise would.
    fn at(&self, form: ResponseForm, at: Vector2<f64>) -> ResponseFit {
        let squares = sum(&self.residuals(form, at[0], at[1].exp()));
        let variance = squares.max(1e-18) / self.freedom();
        let (hessian, gradients) = self.slopes(form, at, variance);
        let inverse = hessian.try_inverse().unwrap_or_else(|| Matrix2::identity() * 1e-2);
        let scatter: Matrix2<f64> = gradients.iter().map(|g| g * g.transpose()).sum();
        let n = gradients.len() as f64;
        let sandwich = inverse * scatter * inverse * (n / (n - 2.0).max(1.0));
        let white = inverse[(0, 0)];
        let sd_s = sandwich[(0, 0)].max(white).sqrt();
        ResponseFit { late_s: at[0], sd_s, stiffness: at[1].exp(), squares, counts: white / (sd_s * sd_s) }
    }
}

/// Walks down along the delay with ever shorter steps: a sharp edge has no slope that leads far.
fn descended(mut best: (f64, Vector2<f64>), squares: impl Fn(Vector2<f64>) -> f64) -> (f64, Vector2<f64>) {
    let mut step_s = LONGEST_S;
    while step_s > SHORTEST_S {
        let sides = [-step_s, step_s].map(|s| best.1 + Vector2::new(s, 0.0)).map(|at| (squares(at), at));
        match sides.into_iter().find(|side| side.0 < best.0) {
            Some(better) => best = better,
            None => step_s *= 0.5,
        }
    }
    best
}

fn sum(residuals: &[Vec<f64>]) -> f64 {
    residuals.iter().flatten().map(|r| r * r).sum()
}
