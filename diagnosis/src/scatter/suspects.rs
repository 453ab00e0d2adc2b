//! Passes that do not belong: how probable that is for each, and when many together are a departure instead.

use crate::constants::Constants;
use crate::regression::Problem;
use crate::scatter::Space;

/// Degrees of freedom of the Student weights of the first rounds.
const STUDENT: f64 = 3.0;
/// Rounds in which share and responsibilities take turns.
const ROUNDS: usize = 20;

/// Weights of Student's t: the first rounds, before there is a scale to go by.
pub fn heavy(left_out: &[f64]) -> Vec<f64> {
    left_out.iter().map(|d| ((STUDENT + 1.0) / (STUDENT + d * d)).min(1.0)).collect()
}

/// Probability that each pass does not belong.
pub fn responsibilities(k: &Constants, left_out: &[f64]) -> Vec<f64> {
    let n = left_out.len() as f64;
    let [seen, of] = k.outside_prior;
    let mut share = seen / of;
    let mut outside = vec![0.0; left_out.len()];
    for _ in 0..ROUNDS {
        for (o, d) in outside.iter_mut().zip(left_out) {
            let inside = (1.0 - share) * (-0.5 * d * d).exp() / (2.0 * std::f64::consts::PI).sqrt();
            let reach = d / k.outside_width;
            let wide = share / (std::f64::consts::PI * k.outside_width * (1.0 + reach * reach));
            *o = wide / (wide + inside);
        }
        share = (seen + outside.iter().sum::<f64>()) / (of + n);
    }
    outside
}

/// Weight that is left to each pass. What surely does not belong keeps the variance of its own residual: it
/// must not vanish from the determinant.
pub fn weights(k: &Constants, outside: &[f64], left_out: &[f64]) -> Vec<f64> {
    let own = |d: &f64| 1.0 / d.abs().max(k.outside_width).powi(2);
    outside.iter().zip(left_out).map(|(o, d)| (1.0 - o + o * own(d)).min(1.0)).collect()
}

/// Takes back passes that stand out together, which makes them a departure and no bad passes, and says where
/// they lie; `None` where none do.
///
/// Bad passes fall anywhere, and either way. `outside` is the probability of each to be one, `left_out` how
/// far it is off. Where such passes cluster, those of the cell that does most are taken back, until the
/// others fall anywhere.
pub fn take_back(problem: &Problem, space: &Space, outside: &mut [f64], left_out: &[f64]) -> Option<String> {
    let k = &problem.constants;
    let n = outside.len();
    let count = |outside: &[f64]| outside.iter().filter(|o| **o > k.suspect_probability).count();
    if count(outside) as f64 > k.most_suspects * n as f64 {
        outside.fill(0.0);
        return Some("the whole table".to_string());
    }
    let mut places: Vec<String> = Vec::new();
    for _ in 0..MOST_TAKEN {
        if count(outside) < FEWEST {
            break;
        }
        let way: Vec<f64> = outside.iter().zip(left_out).map(|(o, d)| o * d.signum()).collect();
        let along = way.iter().zip(&problem.passes).map(|(w, p)| w * p.direction.sign()).collect();
        let found = space.cluster(&[way, along], &[outside.to_vec()]);
        if found.p >= k.together_level {
            break;
        }
        found.rows.iter().for_each(|&i| outside[i] = 0.0);
        places.push(found.place);
    }
    places.dedup();
    (!places.is_empty()).then(|| places.join("; "))
}

/// Fewest passes that form a cluster.
const FEWEST: usize = 3;
/// Cells that are taken back at most.
const MOST_TAKEN: usize = 12;
/// Deviations beyond which a residual does not count for more where clusters are sought.
pub const BOUNDED_SD: f64 = 3.0;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{Deviates, rig, table};

    /// Of a thousand normal deviates hardly one is called suspect; ten far passes are.
    #[test]
    fn far_passes_are_suspect_and_normal_ones_are_not() {
        let k = Constants::default();
        let mut draw = Deviates(5);
        let mut left: Vec<f64> = (0..1000).map(|_| draw.normal()).collect();
        let called =
            |left: &[f64]| responsibilities(&k, left).iter().filter(|o| **o > k.suspect_probability).count();
        assert!(called(&left) <= 1, "{}", called(&left));
        for i in 0..10 {
            left[100 * i] = if i % 2 == 0 { 7.0 } else { -9.0 };
        }
        assert!((10..=12).contains(&called(&left)), "{}", called(&left));
    }

    /// Passes drawn at random stay suspect; all those of one load are taken back, the others not.
    #[test]
    fn passes_of_one_load_are_taken_back() {
        let problem = Problem::new(&table(&mut Deviates(4), 0.0), &rig(), &Default::default());
        let space = Space::of(&problem);
        let n = problem.len();
        let either = |i: usize| if i.is_multiple_of(3) { 9.0 } else { -9.0 };
        let of = |rows: &[usize]| {
            let mut outside = vec![0.0; n];
            rows.iter().for_each(|&i| outside[i] = 1.0);
            let left: Vec<f64> = (0..n).map(either).collect();
            let place = take_back(&problem, &space, &mut outside, &left);
            (place, (0..n).filter(|&i| outside[i] > 0.5).collect::<Vec<_>>())
        };
        assert_eq!(of(&[3, 9, 17, 26]), (None, vec![3, 9, 17, 26]));
        let light: Vec<usize> = (0..n).filter(|&i| problem.passes[i].normal_force_n < 0.2).take(5).collect();
        let (place, left) = of(&light);
        assert!(place.is_some_and(|p| p.contains("force")) && left.len() < 3, "{left:?}");
        let many: Vec<usize> = (0..n).step_by(4).collect();
        assert_eq!(of(&many), (Some("the whole table".to_string()), Vec::new()));
    }
}
