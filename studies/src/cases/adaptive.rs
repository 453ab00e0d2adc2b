//! A surrogate whose nodes are chosen where the error is: a sparse grid that grows where its hierarchical surplus is large.
//!
//! The surplus of a node is what it adds to the interpolant of its ancestors: the error there before it was known. The basis is
//! Pflueger's modified linear one (Spatially Adaptive Sparse Grids for High-Dimensional Problems, 2010), which needs no nodes on the
//! boundary: in eight dimensions a boundary would have most of them.

use models::sparse::basis;
use serde::{Deserialize, Serialize};
use std::collections::HashSet;

/// Place of a node along one axis: `index / 2^level`, the index odd.
type Step = (u8, u32);

/// Deepest level: 2^-20 of an axis.
const DEEPEST: u8 = 20;

/// A node.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Node {
    /// Level and index along each axis.
    pub steps: Vec<Step>,
    /// What it adds to the interpolant; zero where its case has no result.
    pub surplus: f64,
    /// Whether its children are there.
    pub refined: bool,
}

/// The grid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SparseGrid {
    dimensions: usize,
    /// Its nodes in the order in which they came, ancestors before their descendants.
    pub nodes: Vec<Node>,
}

impl SparseGrid {
    /// Without nodes.
    pub fn new(dimensions: usize) -> Self {
        SparseGrid { dimensions, nodes: Vec::new() }
    }

    /// The interpolant at a place.
    pub fn at(&self, place: &[f64]) -> f64 {
        let one = |node: &Node| {
            let mut product = node.surplus;
            for (step, x) in node.steps.iter().zip(place) {
                if product == 0.0 {
                    break;
                }
                product *= basis(*step, *x);
            }
            product
        };
        self.nodes.iter().map(one).sum()
    }

    /// The nodes to add next: the children of the nodes with the largest surplus, `about` so many with the ancestors that they need;
    /// at first the middle and the first two levels about it. Empty where no node can be refined.
    pub fn next(&mut self, about: usize) -> Vec<Vec<Step>> {
        let mut there: HashSet<Vec<Step>> = self.nodes.iter().map(|n| n.steps.clone()).collect();
        let mut new = Vec::new();
        if self.nodes.is_empty() {
            let middle = vec![(1, 1); self.dimensions];
            add(&middle, &mut there, &mut new);
            for axis in 0..self.dimensions {
                for step in [(2, 1), (2, 3)] {
                    let mut steps = middle.clone();
                    steps[axis] = step;
                    add(&steps, &mut there, &mut new);
                }
            }
            return sorted(new);
        }
        let mut order: Vec<usize> = (0..self.nodes.len()).filter(|i| !self.nodes[*i].refined).collect();
        order.sort_by(|a, b| {
            self.nodes[*b].surplus.abs().total_cmp(&self.nodes[*a].surplus.abs()).then(a.cmp(b))
        });
        for i in order {
            if new.len() >= about {
                break;
            }
            self.nodes[i].refined = true;
            for axis in 0..self.dimensions {
                let (level, index) = self.nodes[i].steps[axis];
                if level == DEEPEST {
                    continue;
                }
                for child in [2 * index - 1, 2 * index + 1] {
                    let mut steps = self.nodes[i].steps.clone();
                    steps[axis] = (level + 1, child);
                    add(&steps, &mut there, &mut new);
                }
            }
        }
        sorted(new)
    }

    /// Adds nodes of [`SparseGrid::next`] with the values found there, none where a case has no result.
    pub fn take(&mut self, new: Vec<Vec<Step>>, values: &[Option<f64>]) {
        for (steps, value) in new.into_iter().zip(values) {
            let surplus = value.map_or(0.0, |value| value - self.at(&place_of(&steps)));
            self.nodes.push(Node { steps, surplus, refined: value.is_none() });
        }
    }
}

/// A node and the ancestors that are missing.
fn add(steps: &[Step], there: &mut HashSet<Vec<Step>>, new: &mut Vec<Vec<Step>>) {
    if !there.insert(steps.to_vec()) {
        return;
    }
    for axis in 0..steps.len() {
        let (level, index) = steps[axis];
        if level > 1 {
            let mut ancestor = steps.to_vec();
            // The odd one of the two indices about half of this one.
            ancestor[axis] = (level - 1, (index / 2) | 1);
            add(&ancestor, there, new);
        }
    }
    new.push(steps.to_vec());
}

/// Ancestors first: their levels add up to less.
fn sorted(mut new: Vec<Vec<Step>>) -> Vec<Vec<Step>> {
    new.sort_by_key(|steps| (steps.iter().map(|s| u32::from(s.0)).sum::<u32>(), steps.clone()));
    new
}

/// The place of a node, each axis 0 to 1.
pub fn place_of(steps: &[Step]) -> Vec<f64> {
    steps.iter().map(|(level, index)| f64::from(*index) / f64::from(1_u32 << level)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cases::kinds::ridge::kronecker;

    fn grown(dimensions: usize, nodes: usize, about: usize, f: &dyn Fn(&[f64]) -> f64) -> SparseGrid {
        let mut grid = SparseGrid::new(dimensions);
        while grid.nodes.len() < nodes {
            let new = grid.next(about);
            let values: Vec<Option<f64>> = new.iter().map(|s| Some(f(&place_of(s)))).collect();
            grid.take(new, &values);
        }
        grid
    }

    fn rms(grid: &SparseGrid, dimensions: usize, f: &dyn Fn(&[f64]) -> f64) -> f64 {
        let places = (1..=500).map(|n| kronecker(n, dimensions));
        (places.map(|p| (grid.at(&p) - f(&p)).powi(2)).sum::<f64>() / 500.0).sqrt()
    }

    #[test]
    fn nodes_are_met_and_what_is_multilinear_is_found_by_the_first_levels() {
        let f = |p: &[f64]| 1.0 + p[0] - 2.0 * p[1] + 0.5 * p[2];
        let grid = grown(3, 7, 100, &f);
        assert!(rms(&grid, 3, &f) < 1e-12);
        let bent = |p: &[f64]| (3.0 * p[0] * p[1]).sin() + (p[2] - 0.3).abs();
        let grid = grown(3, 300, 40, &bent);
        let off = |n: &Node| (grid.at(&place_of(&n.steps)) - bent(&place_of(&n.steps))).abs();
        let worst = grid.nodes.iter().map(off).fold(0.0, f64::max);
        assert!(worst < 1e-12, "{worst}");
    }

    #[test]
    fn nodes_go_where_the_error_is_and_the_error_falls() {
        // A ramp in two of eight variables, as the loss of contact is one.
        let f = |p: &[f64]| (8.0 * (p[0] + 0.5 * p[1] - 0.8)).tanh() + 0.1 * p[4];
        let few = rms(&grown(8, 200, 50, &f), 8, &f);
        let grid = grown(8, 2000, 50, &f);
        let many = rms(&grid, 8, &f);
        assert!(many < 0.25 * few && many < 0.03, "{few} {many}");
        let deepest = |axis: usize| grid.nodes.iter().map(|n| n.steps[axis].0).max().unwrap();
        assert!(
            deepest(0) > deepest(5) && deepest(1) > deepest(5),
            "{:?}",
            (0..8).map(deepest).collect::<Vec<_>>()
        );
    }

    #[test]
    fn a_node_without_a_result_stops_nothing() {
        let mut grid = SparseGrid::new(2);
        let new = grid.next(10);
        let values: Vec<Option<f64>> = (0..new.len()).map(|i| (i != 1).then_some(1.0)).collect();
        grid.take(new, &values);
        assert!(!grid.next(10).is_empty());
        assert!((grid.at(&[0.3, 0.9]) - 1.0).abs() < 1e-12);
    }
}
