//! The structured mesh of one fingerprint ridge: columns across, rows from the ridge's surface inwards.
//!
//! ```text
//!   row ny    ___________________   rigid top (held)
//!            |   subcutaneous    |
//!            |___________________|
//!            |      dermis       |
//!            |___________________|   base of the stratum corneum
//!            |  stratum corneum  |   sides are periodic: ridge beside ridge
//!             \__             __/
//!   row 0        \___________/      the ridge's surface, y = 0 at its tip; the plate comes from below
//! ```
//! Every node row holds `nx + 1` nodes in `stride()` places, so that a row can be worked on in whole SIMD
//! vectors; `nx` is a multiple of 8 for the same reason.

use super::{Material, RidgeError};
use serde::{Deserialize, Serialize};

/// Places per node row beyond `nx`: the closing node and padding up to the next SIMD vector.
pub(crate) const PAD: usize = 8;

/// A structured mesh of four-node quads with one material per row of elements.
#[derive(Clone, Debug)]
pub struct Mesh {
    /// Elements across, a multiple of 8.
    pub nx: usize,
    /// Elements from the surface to the top.
    pub ny: usize,
    /// Whether the last column of nodes is the first one again, one width further.
    pub periodic: bool,
    /// Horizontal positions of the nodes in m, row by row, `stride()` places a row.
    pub x_m: Vec<f64>,
    /// Vertical positions of the nodes in m.
    pub y_m: Vec<f64>,
    /// One material for each row of elements.
    pub row_material: Vec<Material>,
}

impl Mesh {
    /// Places per row of nodes.
    pub fn stride(&self) -> usize {
        self.nx + PAD
    }

    /// Number of elements.
    pub fn elements(&self) -> usize {
        self.nx * self.ny
    }

    /// Width of the mesh (the period, if periodic) in m.
    pub fn width_m(&self) -> f64 {
        self.x_m[self.nx] - self.x_m[0]
    }

    /// A mesh whose nodes stand where `place(i, j)` says, for column `i` of 0..=nx and row `j` of 0..=ny.
    pub fn from_nodes(
        nx: usize,
        row_material: Vec<Material>,
        periodic: bool,
        place: impl Fn(usize, usize) -> (f64, f64),
    ) -> Result<Mesh, RidgeError> {
        let ny = row_material.len();
        let whole = nx > 0 && nx.is_multiple_of(8);
        RidgeError::unless(whole, "number of columns", nx as f64, "a multiple of 8, above 0")?;
        RidgeError::unless(ny > 0, "number of rows", 0.0, "above 0")?;
        row_material.iter().try_for_each(|material| material.check("layer"))?;
        let stride = nx + PAD;
        let mut mesh = Mesh {
            nx,
            ny,
            periodic,
            x_m: vec![0.0; stride * (ny + 1)],
            y_m: vec![0.0; stride * (ny + 1)],
            row_material,
        };
        for j in 0..=ny {
            for i in 0..=nx {
                (mesh.x_m[j * stride + i], mesh.y_m[j * stride + i]) = place(i, j);
            }
        }
        mesh.check()?;
        Ok(mesh)
    }

    /// Area of element `(i, j)` in m2 (per metre of depth: its volume).
    pub fn area_m2(&self, i: usize, j: usize) -> f64 {
        let s = self.stride();
        let (a, b, c, d) = (j * s + i, j * s + i + 1, (j + 1) * s + i + 1, (j + 1) * s + i);
        let (x, y) = (&self.x_m, &self.y_m);
        0.5 * ((x[c] - x[a]) * (y[d] - y[b]) - (x[d] - x[b]) * (y[c] - y[a]))
    }

    /// Lumped nodal masses in kg per metre of depth. A periodic closing node holds the mass of its twin.
    pub fn lumped_mass_kg_m(&self) -> Vec<f64> {
        let s = self.stride();
        let mut mass = vec![0.0; s * (self.ny + 1)];
        for j in 0..self.ny {
            for i in 0..self.nx {
                let quarter = 0.25 * self.area_m2(i, j) * self.row_material[j].density_kg_m3;
                for node in [j * s + i, j * s + i + 1, (j + 1) * s + i, (j + 1) * s + i + 1] {
                    mass[node] += quarter;
                }
            }
        }
        if self.periodic {
            for j in 0..=self.ny {
                let both = mass[j * s] + mass[j * s + self.nx];
                mass[j * s] = both;
                mass[j * s + self.nx] = both;
            }
        }
        mass
    }

    /// Width in m that each node of a row stands for; a periodic closing node stands for its twin's.
    pub fn tributary_width_m(&self, row: usize) -> Vec<f64> {
        let x = &self.x_m[row * self.stride()..][..=self.nx];
        let mut width: Vec<f64> =
            (0..=self.nx).map(|i| 0.5 * (x[(i + 1).min(self.nx)] - x[i.saturating_sub(1)])).collect();
        if self.periodic {
            width[0] += width[self.nx];
            width[self.nx] = width[0];
        }
        width
    }

    fn check(&self) -> Result<(), RidgeError> {
        for j in 0..self.ny {
            for i in 0..self.nx {
                let area = self.area_m2(i, j);
                if !(area > 0.0 && area.is_finite()) {
                    let what = format!("area in m2 of the element in column {i}, row {j}");
                    return Err(RidgeError::input(what, area, "above 0: the mesh is folded"));
                }
            }
        }
        Ok(())
    }
}

/// The rounded top of a ridge. It does not matter to the results which (see `docs/ridge.md`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RidgeProfile {
    /// y = RH (2x/RW)^2.
    Parabola,
    /// An ellipse three quarters as curved at the tip, as high at the valley.
    Ellipse,
    /// No ridge: a flat slab of the same thickness.
    Flat,
}

/// Sizes of the ridge, Table 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RidgeGeometry {
    /// RW, width of the ridge and its period, m.
    pub ridge_width_m: f64,
    /// RH, height of the ridge, m.
    pub ridge_height_m: f64,
    /// SCH, thickness of the stratum corneum within the ridge's valley, m.
    pub inner_corneum_m: f64,
    /// EH, thickness of the dermis, m.
    pub dermis_m: f64,
    /// STH, thickness of the subcutaneous tissue, m.
    pub subcutaneous_m: f64,
    /// Shape of the ridge's top.
    pub profile: RidgeProfile,
}

impl RidgeGeometry {
    /// Table 1 of the paper.
    pub const TABLE_1: RidgeGeometry = RidgeGeometry {
        ridge_width_m: 500e-6,
        ridge_height_m: 200e-6,
        inner_corneum_m: 100e-6,
        dermis_m: 600e-6,
        subcutaneous_m: 1800e-6,
        profile: RidgeProfile::Parabola,
    };

    /// Height of the ridge's surface over its tip at a distance `x` from the middle, in m.
    pub fn surface_m(&self, x_m: f64) -> f64 {
        let s = (2.0 * x_m / self.ridge_width_m).abs().min(1.0);
        match self.profile {
            RidgeProfile::Parabola => self.ridge_height_m * s * s,
            // Semi-axes 2 RH and RW / 2 sqrt(0.75): it reaches RH at the side.
            RidgeProfile::Ellipse => self.ridge_height_m * 2.0 * (1.0 - (1.0 - 0.75 * s * s).sqrt()),
            RidgeProfile::Flat => 0.0,
        }
    }

    /// A graded periodic mesh of about `elements` quads; fine at the tip, where contact is decided.
    /// Returns the mesh and the row at which the dermis begins.
    pub fn mesh(
        &self,
        [corneum, dermis, subcutaneous]: [Material; 3],
        elements: usize,
    ) -> Result<RidgeMesh, RidgeError> {
        positive("ridge width in m", self.ridge_width_m)?;
        positive("ridge height in m", self.ridge_height_m)?;
        positive("inner corneum thickness in m", self.inner_corneum_m)?;
        positive("dermis thickness in m", self.dermis_m)?;
        positive("subcutaneous thickness in m", self.subcutaneous_m)?;
        let able = (128..=200_000).contains(&elements);
        RidgeError::unless(able, "number of elements", elements as f64, "128 to 200000")?;
        // Half the rows in the stratum corneum, a quarter in each softer layer.
        let nx = (((elements as f64).sqrt() / 8.0).round() as usize).max(1) * 8;
        let ny = (elements as f64 / nx as f64).round() as usize;
        let soft_rows = (ny / 5).max(2);
        let (dermis_rows, corneum_rows) = (soft_rows, ny - 2 * soft_rows);
        let tip = TIP_SPACING_M * (1500.0 / elements as f64).sqrt();
        let half_columns = graded(0.5 * self.ridge_width_m, tip, nx / 2);
        let corneum_m = self.ridge_height_m + self.inner_corneum_m;
        let corneum_levels = graded(corneum_m, tip, corneum_rows);
        let last = corneum_m - corneum_levels[corneum_rows - 1];
        let dermis_levels = graded(self.dermis_m, last, dermis_rows);
        let last = self.dermis_m - dermis_levels[dermis_rows - 1];
        let soft_levels = graded(self.subcutaneous_m, last, soft_rows);
        let mut row_material = vec![corneum; corneum_rows];
        row_material.extend(std::iter::repeat_n(dermis, dermis_rows));
        row_material.extend(std::iter::repeat_n(subcutaneous, soft_rows));
        let mesh = Mesh::from_nodes(nx, row_material, true, |i, j| {
            let side = half_columns[i.abs_diff(nx / 2)];
            let x = if i < nx / 2 { -side } else { side };
            let y = if j <= corneum_rows {
                // Fine rows at the tip, equal ones at the valley, where the layer is thinner.
                let side = (2.0 * x / self.ridge_width_m).abs();
                let fine = corneum_levels[j] / corneum_m;
                let equal = j as f64 / corneum_rows as f64;
                let surface = self.surface_m(x);
                surface + (corneum_m - surface) * (fine + (equal - fine) * side)
            } else if j <= corneum_rows + dermis_rows {
                corneum_m + dermis_levels[j - corneum_rows]
            } else {
                corneum_m + self.dermis_m + soft_levels[j - corneum_rows - dermis_rows]
            };
            (x, y)
        })?;
        Ok(RidgeMesh { mesh, corneum_rows, tip_spacing_m: tip })
    }
}

/// Element size at the tip for 1500 elements, in m: a fifth of the Hertz half-width at 3.5 N/m.
const TIP_SPACING_M: f64 = 2e-6;

/// A ridge's mesh and what the loading needs to know of it.
#[derive(Clone, Debug)]
pub struct RidgeMesh {
    /// The mesh; its middle column of nodes is the tip.
    pub mesh: Mesh,
    /// Rows of elements in the stratum corneum: the node row of this number is its base.
    pub corneum_rows: usize,
    /// Size of the elements at the tip, m.
    pub tip_spacing_m: f64,
}

/// `n + 1` levels from 0 to `length`, growing geometrically from a first step of `first` (or equal ones,
/// where `n` steps of `first` would already reach too far).
fn graded(length: f64, first: f64, n: usize) -> Vec<f64> {
    let sum = |r: f64| if (r - 1.0).abs() < 1e-12 { n as f64 } else { (r.powi(n as i32) - 1.0) / (r - 1.0) };
    let mut ratio = 1.0;
    if first * (n as f64) < length {
        let mut high = 2.0;
        while first * sum(high) < length {
            high *= 2.0;
        }
        ratio = crate::root::bisection([1.0, high], 200, |ratio| first * sum(ratio) < length);
    }
    let mut levels = vec![0.0];
    let mut step = 1.0;
    for _ in 0..n {
        levels.push(levels[levels.len() - 1] + step);
        step *= ratio;
    }
    let scale = length / levels[n];
    levels.iter().map(|l| l * scale).collect()
}

fn positive(what: &str, value: f64) -> Result<(), RidgeError> {
    RidgeError::unless(value > 0.0 && value.is_finite(), what, value, "above 0 and finite")
}
