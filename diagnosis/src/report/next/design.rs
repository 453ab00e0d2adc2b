//! Which conditions: greedily those after which the hypotheses are least confused.
//!
//! Two hypotheses of probabilities p and q are confused by at most `sqrt(p q) exp(-B)`, B the Bhattacharyya
//! distance of what they expect of all chosen passes together. For Gaussians of like covariance B is an
//! eighth of the sum of both Kullback-Leibler divergences, which add up from pass to pass, each given those
//! before it. The design minimises the sum over all pairs: one that is separated stops drawing passes, a
//! learnt condition too.

use super::predictive::Predictive;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Chooses `count` passes; a condition may come again. Rows of the grid, in the order of their worth.
///
/// Where the open set is given by its place among the hypotheses, every second pass goes where it is most in doubt.
pub fn greedy(hypotheses: &[Predictive], count: usize, open: Option<usize>, most: f64) -> Vec<usize> {
    let n = hypotheses.first().map_or(0, |b| b.mean.len());
    let k = hypotheses.len();
    let mut known: Vec<DMatrix<f64>> = hypotheses.iter().map(|b| b.covariance.clone()).collect();
    // What `j` expects once it has seen what `i` expects, at j + k i.
    let mut seen: Vec<DVector<f64>> = (0..k * k).map(|ij| hypotheses[ij % k].mean.clone()).collect();
    let mut nats = vec![0.0; k * k];
    let mut chosen = Vec::new();
    for step in 0..count {
        let confused = |c: usize| -> f64 {
            let mut sum = 0.0;
            for i in 0..k {
                for j in 0..i {
                    let gain = both(hypotheses, &known, &seen, (i, j), c).min(most);
                    let weight = (hypotheses[i].probability * hypotheses[j].probability).sqrt();
                    sum += weight * (-(nats[j + k * i] + gain) / 4.0).exp();
                }
            }
            sum
        };
        let left: Vec<f64> = match open.filter(|_| step % 2 == 1) {
            Some(h) => (0..n).map(|c| -known[h][(c, c)] / hypotheses[h].scatter[c]).collect(),
            None => (0..n).into_par_iter().map(confused).collect(),
        };
        let best = (0..n).min_by(|&a, &b| left[a].total_cmp(&left[b]).then(a.cmp(&b)));
        let Some(c) = best else { break };
        for i in 0..k {
            for j in 0..i {
                nats[j + k * i] += both(hypotheses, &known, &seen, (i, j), c).min(most);
            }
        }
        for j in 0..k {
            let column = known[j].column(c) / (known[j][(c, c)] + hypotheses[j].scatter[c]);
            for i in 0..k {
                let surprise = hypotheses[i].mean[c] - seen[j + k * i][c];
                seen[j + k * i].axpy(surprise, &column, 1.0);
            }
            let row = known[j].row(c).clone_owned();
            known[j] -= column * row;
        }
        chosen.push(c);
    }
    chosen
}

/// Mean of both divergences that a further pass at `c` adds.
fn both(
    hypotheses: &[Predictive],
    known: &[DMatrix<f64>],
    seen: &[DVector<f64>],
    (i, j): (usize, usize),
    c: usize,
) -> f64 {
    let k = hypotheses.len();
    let variance = |h: usize| known[h][(c, c)].max(0.0) + hypotheses[h].scatter[c];
    let one = |i: usize, j: usize| {
        let (vi, vj) = (variance(i), variance(j));
        let apart = hypotheses[i].mean[c] - seen[j + k * i][c];
        0.5 * ((vi + apart * apart) / vj - 1.0 + (vj / vi).ln())
    };
    0.5 * (one(i, j) + one(j, i))
}

/// The hypothesis that the leader (the first) is most to be parted from.
pub fn rival(hypotheses: &[Predictive]) -> Option<usize> {
    (1..hypotheses.len())
        .max_by(|&a, &b| hypotheses[a].probability.total_cmp(&hypotheses[b].probability).then(b.cmp(&a)))
}

/// Expected gain of the log evidence of `a` over `b`'s by passes at those conditions, were `a` true: the
/// Kullback-Leibler divergence of what both expect of them together.
pub fn expected_nats(a: &Predictive, b: &Predictive, chosen: &[usize]) -> f64 {
    let joint = |h: &Predictive| {
        let mut m = DMatrix::from_fn(chosen.len(), chosen.len(), |i, j| h.covariance[(chosen[i], chosen[j])]);
        chosen.iter().enumerate().for_each(|(i, &c)| m[(i, i)] += h.scatter[c]);
        m
    };
    let (ca, cb) = (joint(a), joint(b));
    let apart = DVector::from_iterator(chosen.len(), chosen.iter().map(|&c| a.mean[c] - b.mean[c]));
    let (Some(fa), Some(fb)) = (ca.clone().cholesky(), cb.cholesky()) else { return 0.0 };
    let log_det = |m: &DMatrix<f64>| 2.0 * m.diagonal().iter().map(|d| d.ln()).sum::<f64>();
    0.5 * (fb.solve(&ca).trace() + apart.dot(&fb.solve(&apart)) - chosen.len() as f64 + log_det(fb.l_dirty())
        - log_det(fa.l_dirty()))
}

#[cfg(test)]
mod tests {
    use super::*;
    const MOST: f64 = 4.0;
    use crate::hypotheses::{Fitted, Options, fit_all};
    use crate::regression::{Posterior, laplace};
    use crate::report::next::{PASSES, grid, predictive::predictives};
    use crate::tests::{Deviates, rig, table};
    use crate::verdict::decide;
    use models::Condition;

    /// Log evidence of a hypothesis with further passes, or without.
    fn evidence(fitted: &Fitted, e: &Posterior, further: &[(Condition, f64, f64)]) -> f64 {
        let mut problem = fitted.problem.clone();
        for (p, force, variance) in further {
            problem.passes.push(*p);
            problem.lateral.push(*force);
            problem.variance.push(*variance);
        }
        problem.common = problem.common.resize_vertically(problem.passes.len(), 0.0);
        let basis = fitted.kernels.at(&problem.passes);
        laplace(&problem, &e.members, &e.u, &basis, e.freedom, 8).log_evidence
    }

    /// The stated nats are what evidence gains on average when the passes are made and the leader is true.
    #[test]
    fn expected_nats_are_what_the_evidence_gains_on_average() {
        let mut draw = Deviates(5);
        let table = table(&mut draw, 0.06);
        let mut fitted = fit_all(&table, &rig(), &Options { pairs: false, ..Options::default() });
        let decision = decide(&mut fitted);
        let grid = grid::conditions(&table);
        let hypotheses = predictives(&fitted, &rig(), &decision, &grid);
        let chosen = greedy(&hypotheses, PASSES, Some(hypotheses.len() - 1), MOST);
        assert_eq!(chosen.len(), PASSES);
        let of = |name: &str| {
            &fitted.candidates.iter().find(|c| c.names().join("+") == name).expect("a candidate").best
        };
        let (a, b) = (of(&hypotheses[0].name), of(&hypotheses[1].name));
        let before = evidence(&fitted, a, &[]) - evidence(&fitted, b, &[]);
        let stated = expected_nats(&hypotheses[0], &hypotheses[1], &chosen);
        let k = chosen.len();
        let root = DMatrix::from_fn(k, k, |i, j| {
            hypotheses[0].covariance[(chosen[i], chosen[j])]
                + if i == j { hypotheses[0].scatter[chosen[i]] } else { 0.0 }
        })
        .cholesky()
        .expect("a covariance with scatter is positive definite")
        .l();
        let draws = 60;
        let gains: Vec<f64> = (0..draws)
            .map(|_| {
                let deviates = DVector::from_fn(k, |_, _| draw.normal());
                let off = &root * deviates;
                let further: Vec<(Condition, f64, f64)> = chosen
                    .iter()
                    .enumerate()
                    .map(|(i, &c)| (grid[c], hypotheses[0].mean[c] + off[i], hypotheses[0].scatter[c]))
                    .collect();
                evidence(&fitted, a, &further) - evidence(&fitted, b, &further) - before
            })
            .collect();
        let mean = gains.iter().sum::<f64>() / f64::from(draws);
        let names = (&hypotheses[0].name, &hypotheses[1].name);
        assert!(stated > 0.5, "{names:?}: {stated:.2} nats");
        // A third for what linear predictions leave out, and the scatter of the mean.
        let sd =
            (gains.iter().map(|g| (g - mean).powi(2)).sum::<f64>() / f64::from(draws * (draws - 1))).sqrt();
        assert!(
            (mean - stated).abs() < 0.33 * stated + 2.0 * sd,
            "{names:?}: stated {stated:.2}, gained {mean:.2} with an error of {sd:.2}"
        );
    }

    fn belief(probability: f64, mean: [f64; 2], own: f64) -> Predictive {
        Predictive {
            name: String::new(),
            probability,
            mean: DVector::from_column_slice(&mean),
            covariance: DMatrix::from_diagonal_element(2, 2, own),
            scatter: vec![1.0; 2],
        }
    }

    /// For two Gaussians of one known variance the divergence is half the squared distance, pass for pass.
    #[test]
    fn nats_of_certain_hypotheses_are_half_the_squared_distance() {
        let (a, b) = (belief(0.5, [0.0, 3.0], 0.0), belief(0.5, [2.0, 1.0], 0.0));
        assert!((expected_nats(&a, &b, &[0, 1]) - 4.0).abs() < 1e-12);
        assert!((expected_nats(&a, &b, &[0, 0, 1]) - 6.0).abs() < 1e-12);
    }

    /// A condition about which a hypothesis is unsure is learnt by it and stops telling: the design goes on.
    #[test]
    fn a_condition_that_is_learnt_stops_drawing_passes() {
        let sure = [belief(0.5, [0.0, 0.0], 0.0), belief(0.5, [3.0, 2.5], 0.0)];
        assert_eq!(greedy(&sure, 2, None, MOST), [0, 0]);
        let unsure = [belief(0.5, [0.0, 0.0], 9.0), belief(0.5, [3.0, 2.5], 9.0)];
        assert_eq!(greedy(&unsure, 2, None, MOST), [0, 1]);
    }

    /// With the open set given, every second pass goes where that is most in doubt, and moves on once it has learnt.
    #[test]
    fn every_second_pass_goes_where_nothing_is_known() {
        let mut open = belief(0.001, [0.0, 0.0], 0.0);
        open.covariance = DMatrix::from_diagonal(&DVector::from_column_slice(&[1.0, 9.0]));
        let hypotheses = [belief(0.5, [0.0, 0.0], 0.0), belief(0.5, [3.0, 0.0], 0.0), open];
        assert_eq!(greedy(&hypotheses, 4, None, MOST), [0, 0, 0, 0]);
        assert_eq!(greedy(&hypotheses, 4, Some(2), MOST), [0, 1, 0, 1]);
    }

    /// Passes go where the likely rival is parted, not where the unlikely one is.
    #[test]
    fn passes_go_to_the_likely_rival() {
        let hypotheses =
            [belief(0.6, [0.0, 0.0], 0.0), belief(0.38, [0.0, 1.0], 0.0), belief(0.02, [1.5, 0.0], 0.0)];
        assert_eq!(greedy(&hypotheses, 1, None, MOST), [1]);
    }
}
