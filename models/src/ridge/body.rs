//! The moving body: its nodes, stresses and constants, field by field (SoA), row by row.

use super::field::Field;
use super::kernel::{self, Features, Step, Surface};
use super::lanes::Instructions;
use super::layers::Layer;
use super::{Mesh, RidgeError};

/// Stiffness of the hourglass control: K = c (lambda + 2G) A sum(b_i b_i). 0.05 to 0.1 is usual.
pub const HOURGLASS_COEFFICIENT: f64 = 0.1;
/// Coefficient of the linear bulk viscosity, times density, wave speed, element length and rate.
pub const LINEAR_BULK_VISCOSITY: f64 = 0.06;
/// Coefficient of the quadratic bulk viscosity (in compression only).
pub const QUADRATIC_BULK_VISCOSITY: f64 = 1.2;

/// How strain is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Strain {
    /// Velocity strain on the moving geometry, stress turned with the spin: the paper's.
    Objective,
    /// Small displacements on the first geometry: cheaper by the division and the spin.
    Small,
}

/// Stress law of one row of elements.
#[derive(Clone, Copy, Debug)]
pub(super) struct RowLaw {
    /// lambda + G in Pa: mean in-plane stress over trace.
    pub bulk: f64,
    /// G in Pa.
    pub shear: f64,
    /// Linear bulk viscosity over element length, Pa s/m.
    pub linear_viscosity: f64,
    /// Quadratic bulk viscosity over length squared, kg/m3.
    pub quadratic_viscosity: f64,
    /// What is left of the viscous arm's stress after a step.
    pub arm_decay: f64,
    /// The arm's stiffness over the relaxed one, for an increment in mid-step.
    pub arm_gain: f64,
}

/// First geometry of the elements, for small strain.
#[derive(Clone, Debug, Default)]
pub(super) struct ElementGeometry {
    pub dx13: Field,
    pub dy13: Field,
    pub dx24: Field,
    pub dy24: Field,
    pub half_over_area: Field,
    pub hx: Field,
    pub hy: Field,
}

/// Stress of the elements, Pa.
#[derive(Clone, Debug, Default)]
pub(super) struct Stress {
    pub mean: Field,
    pub difference: Field,
    pub shear: Field,
}

impl Stress {
    pub(super) fn zeros(elements: usize) -> Self {
        let [mean, difference, shear] = std::array::from_fn(|_| Field::zeros(elements));
        Stress { mean, difference, shear }
    }
}

/// Forces under way between an element row and the node rows beside it, N/m.
#[derive(Clone, Debug)]
pub(super) struct ForceRows {
    pub left_x: Field,
    pub left_y: Field,
    pub right_x: Field,
    pub right_y: Field,
    pub owed3_x: Field,
    pub owed3_y: Field,
    pub owed4_x: Field,
    pub owed4_y: Field,
}

impl ForceRows {
    fn new(nx: usize, stride: usize) -> Self {
        let [left_x, left_y, right_x, right_y] = std::array::from_fn(|_| Field::zeros(stride));
        let [owed3_x, owed3_y, owed4_x, owed4_y] = std::array::from_fn(|_| Field::zeros(nx));
        ForceRows { left_x, left_y, right_x, right_y, owed3_x, owed3_y, owed4_x, owed4_y }
    }
}

/// Work counted since the start, J per metre of depth.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Work {
    /// Done against the internal forces, less what the contact gave (stored and dissipated inside).
    pub internal: f64,
    /// Done by the loads.
    pub load: f64,
    /// Lost to mass damping.
    pub damping: f64,
}

/// Energies at the end of a step, J per metre of depth.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// Of motion, at the half step.
    pub kinetic: f64,
    /// Stored in the relaxed springs.
    pub elastic: f64,
    /// Stored in the hourglass control.
    pub hourglass: f64,
}

/// A body on a structured mesh, moved by explicit central differences.
#[derive(Clone, Debug)]
pub struct Body {
    pub(super) nx: usize,
    pub(super) ny: usize,
    pub(super) stride: usize,
    pub(super) periodic: bool,
    pub(super) width: f64,
    pub(super) x: Field,
    pub(super) y: Field,
    pub(super) vx: Field,
    pub(super) vy: Field,
    pub(super) mass: Field,
    pub(super) inverse_mass: Field,
    pub(super) load_x: Field,
    pub(super) load_y: Field,
    pub(super) stress: Stress,
    pub(super) hourglass_x: Field,
    pub(super) hourglass_y: Field,
    pub(super) hourglass_stiffness: Field,
    pub(super) length: Field,
    pub(super) shape: ElementGeometry,
    /// Of the viscous arms; empty without any.
    pub(super) arm: Stress,
    pub(super) laws: Vec<RowLaw>,
    pub(super) rows: ForceRows,
    /// Work counted so far (see [`Body::count_energy`]).
    pub work: Work,
    strain: Strain,
    viscous: bool,
    pub(super) stiffness_damping_s: f64,
    /// Whether to count work from now on (slower by about a tenth).
    pub count_energy: bool,
    /// The instructions of the kernel, for comparisons; what this machine lacks gives the widest it has (ask
    /// [`Instructions::here`] first).
    pub instructions: Instructions,
    pub(super) layers: Vec<Layer>,
    /// Steps of the surface so far.
    pub(super) clock: usize,
    /// As it was built.
    pub(super) mesh: Mesh,
}

impl Body {
    /// A body at rest and free of stress.
    pub fn new(mesh: Mesh, strain: Strain) -> Body {
        let (nx, ny, stride) = (mesh.nx, mesh.ny, mesh.stride());
        let (nodes, elements) = (stride * (ny + 1), nx * ny);
        let mut shape: [Vec<f64>; 7] = Default::default();
        let mut hourglass_stiffness = Vec::with_capacity(elements);
        let mut length = Vec::with_capacity(elements);
        let mut laws = Vec::with_capacity(ny);
        for j in 0..ny {
            let material = mesh.row_material[j];
            let speed = material.wave_speed_m_s();
            laws.push(RowLaw {
                bulk: material.lambda_pa() + material.shear_modulus_pa(),
                shear: material.shear_modulus_pa(),
                linear_viscosity: LINEAR_BULK_VISCOSITY * material.density_kg_m3 * speed,
                quadratic_viscosity: QUADRATIC_BULK_VISCOSITY.powi(2) * material.density_kg_m3,
                arm_decay: 0.0,
                arm_gain: 0.0,
            });
            for i in 0..nx {
                let at = |column: usize, row: usize| {
                    let node = row * stride + column;
                    (mesh.x_m[node], mesh.y_m[node])
                };
                let (r1, r2, r3, r4) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
                let (dx13, dy13, dx24, dy24) = (r1.0 - r3.0, r1.1 - r3.1, r2.0 - r4.0, r2.1 - r4.1);
                let area = mesh.area_m2(i, j);
                let (hx, hy) = (r1.0 - r2.0 + r3.0 - r4.0, r1.1 - r2.1 + r3.1 - r4.1);
                let of = [dx13, dy13, dx24, dy24, 0.5 / area, hx, hy];
                shape.iter_mut().zip(of).for_each(|(field, value)| field.push(value));
                // sum over corners of b_i b_i, b the gradient of the shape functions.
                let gradients = (dx13 * dx13 + dy13 * dy13 + dx24 * dx24 + dy24 * dy24) / (2.0 * area * area);
                // Over 16: the stored force is a quarter, a corner's share, of a rate four times too large.
                let confined = material.lambda_pa() + 2.0 * material.shear_modulus_pa();
                hourglass_stiffness.push(HOURGLASS_COEFFICIENT / 16.0 * confined * area * gradients);
                // The shorter side of a slim element: viscosity must not stiffen it.
                length.push((1.0 / gradients).sqrt());
            }
        }
        let [dx13, dy13, dx24, dy24, half_over_area, hx, hy] = shape.map(|field| Field::from(&field[..]));
        let shape = ElementGeometry { dx13, dy13, dx24, dy24, half_over_area, hx, hy };
        let mass = Field::from(&mesh.lumped_mass_kg_m()[..]);
        let inverse: Vec<f64> = mass.iter().map(|m| if *m > 0.0 { 1.0 / m } else { 0.0 }).collect();
        let viscous = mesh.row_material.iter().any(|m| m.arm().is_some());
        let arm = if viscous { Stress::zeros(elements) } else { Stress::default() };
        Body {
            nx,
            ny,
            stride,
            periodic: mesh.periodic,
            width: mesh.width_m(),
            x: Field::from(&mesh.x_m[..]),
            y: Field::from(&mesh.y_m[..]),
            vx: Field::zeros(nodes),
            vy: Field::zeros(nodes),
            inverse_mass: Field::from(&inverse[..]),
            mass,
            load_x: Field::zeros(nodes),
            load_y: Field::zeros(nodes),
            stress: Stress::zeros(elements),
            hourglass_x: Field::zeros(elements),
            hourglass_y: Field::zeros(elements),
            hourglass_stiffness: Field::from(&hourglass_stiffness[..]),
            length: Field::from(&length[..]),
            shape,
            arm,
            laws,
            rows: ForceRows::new(nx, stride),
            work: Work::default(),
            strain,
            viscous,
            stiffness_damping_s: 0.0,
            count_energy: false,
            instructions: Instructions::Widest,
            layers: Vec::new(),
            clock: 0,
            mesh,
        }
    }

    /// Index of the node in column `i` of row `j`.
    pub fn node(&self, i: usize, j: usize) -> usize {
        j * self.stride + i
    }

    /// Position in m of a node, at the half step.
    pub fn position_m(&self, node: usize) -> (f64, f64) {
        (self.x[node], self.y[node])
    }

    /// Velocity in m/s of a node, at the half step.
    pub fn velocity_m_s(&self, node: usize) -> (f64, f64) {
        (self.vx[node], self.vy[node])
    }

    /// Sets a node's velocity in m/s. A held node keeps it for ever.
    pub fn set_velocity(&mut self, node: usize, vx: f64, vy: f64) {
        (self.vx[node], self.vy[node]) = (vx, vy);
    }

    /// Sets a node's position in m; the first geometry, and so small strain, is not changed.
    pub fn set_position(&mut self, node: usize, x: f64, y: f64) {
        (self.x[node], self.y[node]) = (x, y);
    }

    /// Sets the external force on a node in N per metre of depth.
    pub fn set_load(&mut self, node: usize, x: f64, y: f64) {
        (self.load_x[node], self.load_y[node]) = (x, y);
    }

    /// Holds a node at its velocity (at rest, unless set otherwise): no force moves it.
    pub fn hold(&mut self, node: usize) {
        self.inverse_mass[node] = 0.0;
        self.mass[node] = 0.0;
    }

    /// Holds the whole top row.
    pub fn hold_top(&mut self) {
        (0..=self.nx).for_each(|i| self.hold(self.node(i, self.ny)));
    }

    /// Mass of a node in kg per metre of depth, zero if held.
    pub fn mass_kg_m(&self, node: usize) -> f64 {
        self.mass[node]
    }

    /// Stress (xx, yy, xy) in Pa of element `(i, j)`, tension positive, without the bulk viscosity.
    pub fn stress_pa(&self, i: usize, j: usize) -> [f64; 3] {
        let e = j * self.nx + i;
        let of = |stress: &Stress| [stress.mean[e], stress.difference[e], stress.shear[e]];
        let mut s = of(&self.stress);
        if self.viscous && self.stiffness_damping_s == 0.0 {
            s.iter_mut().zip(of(&self.arm)).for_each(|(s, arm)| *s += arm);
        }
        [s[0] + s[1], s[0] - s[1], s[2]]
    }

    /// Sets the stress (xx, yy, xy) in Pa of element `(i, j)`.
    pub fn set_stress(&mut self, i: usize, j: usize, stress: [f64; 3]) {
        let e = j * self.nx + i;
        self.stress.mean[e] = 0.5 * (stress[0] + stress[1]);
        self.stress.difference[e] = 0.5 * (stress[0] - stress[1]);
        self.stress.shear[e] = stress[2];
    }

    /// Energies now. Kinetic energy is that of the half step after the stresses.
    pub fn energy(&self) -> Energy {
        let mut energy = Energy::default();
        for j in 0..=self.ny {
            for i in 0..self.own_columns() {
                let n = self.node(i, j);
                energy.kinetic += 0.5 * self.mass[n] * (self.vx[n].powi(2) + self.vy[n].powi(2));
            }
        }
        for j in 0..self.ny {
            let law = self.laws[j];
            for i in 0..self.nx {
                let e = j * self.nx + i;
                let (area, s) = (0.5 / self.shape.half_over_area[e], &self.stress);
                let deviator = (s.difference[e].powi(2) + s.shear[e].powi(2)) / law.shear;
                energy.elastic += 0.5 * area * (s.mean[e].powi(2) / law.bulk + deviator);
                energy.hourglass += 0.5 * (self.hourglass_x[e].powi(2) + self.hourglass_y[e].powi(2))
                    / self.hourglass_stiffness[e];
            }
        }
        energy
    }

    /// Bytes of this body on the heap, near enough.
    pub fn memory_bytes(&self) -> usize {
        let nodes = 2 * self.mesh.x_m.len() + 9 * self.x.len();
        let elements = (7 + 7 + if self.viscous { 3 } else { 0 }) * self.length.len();
        8 * (nodes + elements + 8 * self.stride)
    }

    /// Scales the artificial bulk viscosity; zero switches it off, for tests of energy and frequency.
    pub fn scale_bulk_viscosity(&mut self, factor: f64) {
        for law in &mut self.laws {
            law.linear_viscosity *= factor;
            law.quadratic_viscosity *= factor;
        }
    }

    /// Stiffness-proportional damping of an elastic body: from now on its stress is that of the strain and
    /// `beta_s` seconds times its rate. It replaces the viscous arms, as an arm that forgets
    /// everything within a step. The hourglass control has none.
    pub fn damp_stiffness(&mut self, beta_s: f64) {
        if self.mesh.row_material.iter().any(|m| m.arm().is_some()) || beta_s <= 0.0 {
            return;
        }
        self.stiffness_damping_s = beta_s;
        self.viscous = true;
        self.arm = Stress::zeros(self.length.len());
    }

    /// Advances `count` steps of `dt` seconds (of the surface, see [`Body::move_in_longer_steps`]). `contact`
    /// sees the surface in each. Nothing is checked here: see [`super::stability`] for the step and
    /// [`Body::is_finite`].
    pub fn advance(
        &mut self,
        dt: f64,
        mass_damping_per_s: f64,
        count: usize,
        contact: &mut impl FnMut(Surface<'_>),
    ) {
        for j in 0..self.ny {
            let dt = dt * self.every(j) as f64;
            let law = &mut self.laws[j];
            if let Some(arm) = self.mesh.row_material[j].arm() {
                law.arm_decay = (-dt / arm.relaxation_time_s).exp();
                law.arm_gain = arm.ratio * (-0.5 * dt / arm.relaxation_time_s).exp();
            } else if self.stiffness_damping_s > 0.0 {
                law.arm_gain = self.stiffness_damping_s / dt;
            }
        }
        let features = Features {
            objective: self.strain == Strain::Objective,
            viscous: self.viscous,
            energy: self.count_energy,
        };
        kernel::run(self, features, Step::new(dt, mass_damping_per_s), count, contact);
    }

    /// Refuses a body that has run away.
    pub fn is_finite(&self) -> Result<(), RidgeError> {
        let mut speeds = self.vx.iter().chain(self.vy.iter());
        let sound = speeds.all(|v| v.is_finite() && v.abs() < 1e6);
        if sound { Ok(()) } else { Err(RidgeError::Diverged) }
    }

    /// Columns of nodes of their own: the closing one of a periodic row is its twin's.
    #[inline(always)]
    fn own_columns(&self) -> usize {
        self.nx + usize::from(!self.periodic)
    }

    /// Adds the part of the surface row's force that waits in the row `right` to the row `left`, so that
    /// a contact sees and changes one force a node.
    #[inline(always)]
    pub(super) fn complete_surface_force(&mut self) {
        for i in 0..self.own_columns() {
            self.rows.left_x[i] += self.rows.right_x[i];
            self.rows.left_y[i] += self.rows.right_y[i];
            self.rows.right_x[i] = 0.0;
            self.rows.right_y[i] = 0.0;
        }
    }
}
