//! Layers that move in longer steps than the surface.
//!
//! The soft layers would be stable in steps many times those of the stratum corneum. Each of them, with all that lies behind it,
//! therefore moves once in `every` steps, by its own step of central differences. The node row between two layers moves with the
//! faster one. To the slower layer it stood, over the longer step, at its mean place with its mean velocity; the slower layer's
//! force comes to it as one impulse, at the time at which that force is known, over as many of its steps as the longer one has.
//! That is the impulse method of multiple time steps (Tuckerman, Berne, Martyna 1992; symplectic, of second order like central
//! differences themselves), so that no energy is made where the layers meet.

use super::body::Body;
use super::field::Field;

/// A layer that moves once in `every` steps of the surface.
#[derive(Clone, Debug)]
pub(super) struct Layer {
    /// First row of elements; the node row of this number moves with the layer in front.
    pub first: usize,
    /// Steps of the surface in one step of this layer.
    pub every: usize,
    /// Steps of the layer in front in one step of this layer.
    ratio: usize,
    /// Sums over those of x, y, vx, vy of the node row between.
    sums: [Field; 4],
    /// The forces that the layer in front gives to it, while this layer's own are formed.
    front: [Field; 4],
}

impl Body {
    /// Lets layers move in longer steps: `(first row of elements, steps of the surface in one of theirs)`,
    /// from the surface inwards. Each number of steps must be a multiple of the one before it.
    ///
    /// # Panics
    /// If they are not in order or not multiples.
    pub fn move_in_longer_steps(&mut self, layers: &[(usize, usize)]) {
        let (mut row, mut before) = (0, 1);
        self.layers.clear();
        for &(first, every) in layers {
            assert!(first > row && first < self.ny && every % before == 0, "layers {layers:?}");
            let sums = std::array::from_fn(|_| Field::zeros(self.stride));
            let front = std::array::from_fn(|_| Field::zeros(self.nx));
            self.layers.push(Layer { first, every, ratio: every / before, sums, front });
            (row, before) = (first, every);
        }
        self.clock = 0;
    }

    /// Steps of the surface in one step of element row `j`.
    pub(super) fn every(&self, j: usize) -> usize {
        self.layers.iter().take_while(|layer| layer.first <= j).last().map_or(1, |layer| layer.every)
    }

    /// Adds the present state of the node row in front of layer `level` to its sums, before it moves.
    #[inline(never)]
    pub(super) fn note_interface(&mut self, level: usize) {
        let layer = &mut self.layers[level];
        let start = layer.first * self.stride;
        let fields = [&self.x, &self.y, &self.vx, &self.vy];
        for (sum, field) in layer.sums.iter_mut().zip(fields) {
            sum.iter_mut().zip(&field[start..]).for_each(|(s, v)| *s += v);
        }
    }

    /// Puts the node row in front of the layer where it was in the mean, and lays aside what it is owed, so
    /// that the element row behind it gives its own forces alone.
    #[inline(never)]
    pub(super) fn enter_layer(&mut self, level: usize) {
        self.note_interface(level);
        let layer = &mut self.layers[level];
        let range = layer.first * self.stride..(layer.first + 1) * self.stride;
        let share = 1.0 / layer.ratio as f64;
        let fields = [&mut self.x, &mut self.y, &mut self.vx, &mut self.vy];
        for (sum, field) in layer.sums.iter_mut().zip(fields) {
            for (s, v) in sum.iter_mut().zip(&mut field[range.clone()]) {
                (*s, *v) = (*v, share * *s);
            }
        }
        let rows = &mut self.rows;
        let owed = [&mut rows.owed4_x, &mut rows.owed4_y, &mut rows.owed3_x, &mut rows.owed3_y];
        for (front, owed) in layer.front.iter_mut().zip(owed) {
            std::mem::swap(front, owed);
            owed.fill(0.0);
        }
    }

    /// The end of [`Body::enter_layer`]: the row is back where it is, with the force of both layers on it.
    #[inline(never)]
    pub(super) fn leave_interface(&mut self, level: usize) {
        let layer = &mut self.layers[level];
        let range = layer.first * self.stride..(layer.first + 1) * self.stride;
        let fields = [&mut self.x, &mut self.y, &mut self.vx, &mut self.vy];
        for (sum, field) in layer.sums.iter_mut().zip(fields) {
            field[range.clone()].copy_from_slice(sum);
            sum.fill(0.0);
        }
        let (rows, nx, times) = (&mut self.rows, self.nx, layer.ratio as f64);
        let forces = [
            &mut rows.left_x[..nx],
            &mut rows.left_y[..nx],
            &mut rows.right_x[1..=nx],
            &mut rows.right_y[1..=nx],
        ];
        for (force, front) in forces.into_iter().zip(&layer.front) {
            force.iter_mut().zip(front.iter()).for_each(|(f, a)| *f = a + times * *f);
        }
    }
}
