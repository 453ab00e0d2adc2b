//! The stiffness matrix of a body, read from the kernel itself, and its Cholesky factor within its band.

use crate::ridge::{Body, Mesh, RidgeError, Strain};

/// A symmetric positive definite matrix in its lower band, then its Cholesky factor.
#[derive(Clone, Debug)]
pub struct Banded {
    n: usize,
    band: usize,
    /// Row `i` holds the columns `i - band ..= i`.
    rows: Vec<f64>,
}

impl Banded {
    /// A matrix of zeros of `n` rows, with `band` columns left of the diagonal.
    pub fn zeros(n: usize, band: usize) -> Banded {
        Banded { n, band, rows: vec![0.0; n * (band + 1)] }
    }

    fn place(&self, i: usize, j: usize) -> usize {
        i * (self.band + 1) + self.band + j - i
    }

    /// Sets the element in row `i` and column `j`, `i - band <= j <= i`.
    pub fn set(&mut self, i: usize, j: usize, value: f64) {
        let place = self.place(i, j);
        self.rows[place] = value;
    }

    /// Factorises in place.
    ///
    /// # Errors
    /// A matrix that is not positive definite: a body that nothing holds.
    pub fn factorised(mut self) -> Result<Banded, RidgeError> {
        for i in 0..self.n {
            for j in i.saturating_sub(self.band)..=i {
                let first = i.saturating_sub(self.band).max(j.saturating_sub(self.band));
                let (a, b) = (self.place(i, first), self.place(j, first));
                let count = j - first;
                let dot: f64 =
                    self.rows[a..a + count].iter().zip(&self.rows[b..b + count]).map(|(x, y)| x * y).sum();
                let rest = self.rows[self.place(i, j)] - dot;
                let place = self.place(i, j);
                if i == j {
                    if !(rest > 0.0 && rest.is_finite()) {
                        let what = format!("pivot {i} of the stiffness matrix");
                        return Err(RidgeError::input(what, rest, "above 0: something must hold the body"));
                    }
                    self.rows[place] = rest.sqrt();
                } else {
                    self.rows[place] = rest / self.rows[self.place(j, j)];
                }
            }
        }
        Ok(self)
    }

    /// Solves for `right` in place, once factorised.
    pub fn solve(&self, right: &mut [f64]) {
        for i in 0..self.n {
            let first = i.saturating_sub(self.band);
            let start = self.place(i, first);
            let row = &self.rows[start..start + i - first];
            let dot: f64 = row.iter().zip(&right[first..i]).map(|(a, b)| a * b).sum();
            right[i] = (right[i] - dot) / self.rows[self.place(i, i)];
        }
        for i in (0..self.n).rev() {
            right[i] /= self.rows[self.place(i, i)];
            let (value, first) = (right[i], i.saturating_sub(self.band));
            let start = self.place(i, first);
            let row = &self.rows[start..start + i - first];
            right[first..i].iter_mut().zip(row).for_each(|(r, a)| *r -= a * value);
        }
    }
}

/// Compliance of the nodes of row 0 in m per N/m: entry `[a][b]` is the displacement `a` under a unit of the force `b`, both
/// numbered `2 i` along the plate and `2 i + 1` across it. Node row `held` and all above it are held.
///
/// # Errors
/// A body that nothing holds.
pub fn surface_compliance(mesh: &Mesh, held: usize) -> Result<Vec<Vec<f64>>, RidgeError> {
    let (nx, rows) = (mesh.nx, held);
    let columns = if mesh.periodic { nx } else { nx + 1 };
    // Neighbours in the same row and the next, around the periodic side.
    let band = 4 * columns + 1;
    let n = 2 * columns * rows;
    let mut matrix = Banded::zeros(n, band.min(n - 1));
    let mut rest = Body::new(mesh.clone(), Strain::Small);
    rest.scale_bulk_viscosity(0.0);
    // Nodes 4 columns and 3 rows apart share no element: one step of the kernel reads all their columns.
    let around = |i: usize, by: isize| -> Option<usize> {
        let k = i as isize + by;
        if mesh.periodic {
            return Some(k.rem_euclid(columns as isize) as usize);
        }
        usize::try_from(k).ok().filter(|k| *k < columns)
    };
    for colour in 0..24 {
        let (ci, cj, axis) = (colour % 4, colour / 4 % 3, colour / 12);
        let moved = |i: usize, j: usize| i % 4 == ci && j % 3 == cj && j < rows && i < columns;
        let force = internal_force(&rest, mesh, |i, j| {
            let one = f64::from(u8::from(moved(i, j)));
            if axis == 0 { (one, 0.0) } else { (0.0, one) }
        });
        for j in (cj..rows).step_by(3) {
            for i in (ci..columns).step_by(4) {
                let column = 2 * (j * columns + i) + axis;
                for dj in -1_isize..=1 {
                    let Some(jj) = usize::try_from(j as isize + dj).ok().filter(|jj| *jj < rows) else {
                        continue;
                    };
                    for ii in (-1..=1).filter_map(|di| around(i, di)) {
                        let (fx, fy) = force[jj * columns + ii];
                        for (c, value) in [fx, fy].into_iter().enumerate() {
                            let row = 2 * (jj * columns + ii) + c;
                            if row >= column {
                                matrix.set(row, column, value);
                            }
                        }
                    }
                }
            }
        }
    }
    let factor = matrix.factorised()?;
    let surface = 2 * columns;
    let solved = (0..surface).map(|b| {
        let mut right = vec![0.0; n];
        right[b] = 1.0;
        factor.solve(&mut right);
        right.truncate(surface);
        right
    });
    Ok(solved.collect())
}

/// Force against a displacement in m of each node: one step of the kernel of one second from rest takes it from the velocities.
fn internal_force(
    rest: &Body,
    mesh: &Mesh,
    displacement: impl Fn(usize, usize) -> (f64, f64),
) -> Vec<(f64, f64)> {
    let columns = if mesh.periodic { mesh.nx } else { mesh.nx + 1 };
    let mut body = rest.clone();
    for j in 0..=mesh.ny {
        for i in 0..=mesh.nx {
            // The closing node of a periodic row goes with its twin.
            let (x, y) = displacement(i % columns, j);
            body.set_velocity(body.node(i, j), x, y);
        }
    }
    body.advance(1.0, 0.0, 1, &mut |_| {});
    let force = |k: usize| {
        let (i, j) = (k % columns, k / columns);
        let node = body.node(i, j);
        let ((x, y), (vx, vy), mass) = (displacement(i, j), body.velocity_m_s(node), body.mass_kg_m(node));
        (mass * (x - vx), mass * (y - vy))
    };
    (0..columns * (mesh.ny + 1)).map(force).collect()
}
