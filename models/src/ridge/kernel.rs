//! The element kernel: one row of four-node quads, then one row of nodes, in whole SIMD vectors.
//!
//! One-point quads with the hourglass control of Flanagan and Belytschko (1981), written for a structured
//! mesh. Corners are 1 (i, j), 2 (i+1, j), 3 (i+1, j+1), 4 (i, j+1). With the diagonals
//! `d13 = r1 - r3`, `d24 = r2 - r4` and the hourglass vector `h = r1 - r2 + r3 - r4`:
//!
//! - area A = (dx13 dy24 - dx24 dy13) / 2;
//! - A times the gradient of f = ( dy24 f13 - dy13 f24,  dx13 f24 - dx24 f13 ) / 2;
//! - corners 1 and 3 (2 and 4) take opposite stress forces, so two force vectors serve four corners.
//!
//! Positions are those of the half step, where the velocities are, so that the strain of a rigid rotation
//! is exactly zero. Stress is stored as mean, half difference and shear: a rotation by the spin leaves the
//! first alone and turns the other two by twice the angle.
//!
//! No colouring and no scatter: forces on the nodes of row j are complete once the element rows j-1 and j
//! are done; what row j owes to node row j+1 waits in four short rows that stay in the first-level cache.

use super::body::{Body, RowLaw, Stress};
use super::lanes::Lanes;
use pulp::{Simd, WithSimd};

/// What the kernel is compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Features {
    /// Velocity strain on the moving geometry, stress turned by the spin; otherwise small strain.
    pub objective: bool,
    /// Some layer has a viscous arm.
    pub viscous: bool,
    /// Count the work done.
    pub energy: bool,
}

/// Numbers of one time step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Step {
    /// Time step in s.
    pub dt: f64,
    /// Factor on the old velocity, (1 - c dt/2) / (1 + c dt/2) for mass damping c.
    pub keep: f64,
    /// Factor on force over mass, dt / (1 + c dt/2).
    pub push: f64,
    /// Mass damping c in 1/s.
    pub damping: f64,
}

impl Step {
    pub(super) fn new(dt: f64, mass_damping_per_s: f64) -> Step {
        let half = 0.5 * mass_damping_per_s * dt;
        Step { dt, keep: (1.0 - half) / (1.0 + half), push: dt / (1.0 + half), damping: mass_damping_per_s }
    }
}

/// The moving surface (node row 0) as the contact sees it at the end of a step: positions and velocities
/// of the half step, and the internal forces from which the contact subtracts its own.
pub struct Surface<'a> {
    /// Horizontal positions at the half step, m.
    pub x: &'a [f64],
    /// Vertical positions at the half step, m.
    pub y: &'a [f64],
    /// Horizontal velocities at the half step, m/s.
    pub vx: &'a [f64],
    /// Vertical velocities at the half step, m/s.
    pub vy: &'a [f64],
    /// Horizontal internal force per metre of depth, N/m; subtract what pushes the surface along +x.
    pub fx: &'a mut [f64],
    /// Vertical internal force per metre of depth, N/m; subtract what pushes the surface along +y.
    pub fy: &'a mut [f64],
    /// Time step in s: the position at the end of the step is x + vx dt/2.
    pub dt: f64,
}

/// Runs `count` steps of `body`; `contact` is called in each with the surface (through a pointer, so that the
/// kernel is compiled once and not for each contact).
pub(super) fn run(
    body: &mut Body,
    features: Features,
    step: Step,
    count: usize,
    contact: &mut dyn FnMut(Surface<'_>),
) {
    // One step for the rows at the surface, then one for each layer that moves in longer ones.
    let slower = body.layers.iter().map(|layer| Step::new(layer.every as f64 * step.dt, step.damping));
    let steps: Vec<Step> = std::iter::once(step).chain(slower).collect();
    struct Steps<'a, const OBJECTIVE: bool, const VISCOUS: bool, const ENERGY: bool> {
        body: &'a mut Body,
        steps: Vec<Step>,
        count: usize,
        contact: &'a mut dyn FnMut(Surface<'_>),
    }
    impl<const OBJECTIVE: bool, const VISCOUS: bool, const ENERGY: bool> WithSimd
        for Steps<'_, OBJECTIVE, VISCOUS, ENERGY>
    {
        type Output = ();
        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) {
            for _ in 0..self.count {
                sweep::<S, OBJECTIVE, VISCOUS, ENERGY>(simd, self.body, &self.steps, self.contact);
            }
        }
    }
    let arch = body.instructions.arch().unwrap_or_default();
    macro_rules! dispatch {
        ($objective:literal, $viscous:literal, $energy:literal) => {
            arch.dispatch(Steps::<$objective, $viscous, $energy> { body, steps, count, contact })
        };
    }
    match (features.objective, features.viscous, features.energy) {
        (false, false, false) => dispatch!(false, false, false),
        (true, false, false) => dispatch!(true, false, false),
        (false, true, false) => dispatch!(false, true, false),
        (true, true, false) => dispatch!(true, true, false),
        (false, false, true) => dispatch!(false, false, true),
        (true, false, true) => dispatch!(true, false, true),
        (false, true, true) => dispatch!(false, true, true),
        (true, true, true) => dispatch!(true, true, true),
    }
}

/// One step of the surface, and of every layer whose own longer step ends with it (see [`super::layers`]).
#[inline(always)]
fn sweep<S: Simd, const OBJECTIVE: bool, const VISCOUS: bool, const ENERGY: bool>(
    simd: S,
    body: &mut Body,
    steps: &[Step],
    contact: &mut dyn FnMut(Surface<'_>),
) {
    let (nx, ny, stride) = (body.nx, body.ny, body.stride);
    body.clock += 1;
    let moving = body.layers.iter().take_while(|layer| body.clock.is_multiple_of(layer.every)).count();
    let end = body.layers.get(moving).map_or(ny, |layer| layer.first);
    let rows = &mut body.rows;
    let owed = [&mut rows.owed3_x, &mut rows.owed3_y, &mut rows.owed4_x, &mut rows.owed4_y];
    owed.into_iter().for_each(|row| row.fill(0.0));
    let mut level = 0;
    for j in 0..end {
        let interface = body.layers.get(level).is_some_and(|layer| layer.first == j);
        if interface {
            body.enter_layer(level);
        }
        element_row::<S, OBJECTIVE, VISCOUS>(simd, body, j, &steps[level + usize::from(interface)]);
        if interface {
            body.leave_interface(level);
        }
        join_sides(body);
        if j == 0 {
            body.complete_surface_force();
            contact(Surface {
                x: &body.x[..stride],
                y: &body.y[..stride],
                vx: &body.vx[..stride],
                vy: &body.vy[..stride],
                fx: &mut body.rows.left_x,
                fy: &mut body.rows.left_y,
                dt: steps[0].dt,
            });
        }
        node_row::<S, ENERGY>(simd, body, j, &steps[level]);
        level += usize::from(interface);
        if j == 0 {
            // The closing node's force was completed in `left`, where later rows have nothing.
            (body.rows.left_x[nx], body.rows.left_y[nx]) = (0.0, 0.0);
        }
    }
    body.rows.left_x[..nx].copy_from_slice(&body.rows.owed4_x);
    body.rows.left_y[..nx].copy_from_slice(&body.rows.owed4_y);
    body.rows.right_x[1..=nx].copy_from_slice(&body.rows.owed3_x);
    body.rows.right_y[1..=nx].copy_from_slice(&body.rows.owed3_y);
    join_sides(body);
    if moving < body.layers.len() {
        body.note_interface(moving);
    }
    node_row::<S, ENERGY>(simd, body, end, &steps[level]);
}

/// The force that the last column gives to the closing node belongs to the first node of a periodic row.
#[inline(always)]
fn join_sides(body: &mut Body) {
    if body.periodic {
        body.rows.right_x[0] = body.rows.right_x[body.nx];
        body.rows.right_y[0] = body.rows.right_y[body.nx];
    }
}

/// The vectors of one row, from `start`, `count` values.
#[inline(always)]
fn vectors<S: Simd>(values: &[f64], start: usize, count: usize) -> &[S::f64s] {
    &S::as_simd_f64s(&values[start..start + count]).0[..count / S::F64_LANES]
}

#[inline(always)]
fn vectors_mut<S: Simd>(values: &mut [f64], start: usize, count: usize) -> &mut [S::f64s] {
    &mut S::as_mut_simd_f64s(&mut values[start..start + count]).0[..count / S::F64_LANES]
}

#[inline(always)]
fn stresses<S: Simd>(of: &mut Stress, start: usize, count: usize) -> [&mut [S::f64s]; 3] {
    [&mut of.mean, &mut of.difference, &mut of.shear].map(|field| vectors_mut::<S>(field, start, count))
}

/// Stress update of element row `j`; forces go to the rows `left` (corner 1), `right` (corner 2, one place
/// further), and `owed` (corners 3 and 4).
#[inline(always)]
fn element_row<S: Simd, const OBJECTIVE: bool, const VISCOUS: bool>(
    simd: S,
    body: &mut Body,
    j: usize,
    step: &Step,
) {
    let nx = body.nx;
    let (low, high, el) = (j * body.stride, (j + 1) * body.stride, j * nx);
    let corner = |field| -> [&[S::f64s]; 4] {
        [
            vectors::<S>(field, low, nx),
            vectors::<S>(field, low + 1, nx),
            vectors::<S>(field, high + 1, nx),
            vectors::<S>(field, high, nx),
        ]
    };
    let (x, y, vx, vy) = (corner(&body.x), corner(&body.y), corner(&body.vx), corner(&body.vy));
    let shape = &body.shape;
    let fixed: [&[S::f64s]; 7] = if OBJECTIVE {
        [&[]; 7]
    } else {
        [&shape.dx13, &shape.dy13, &shape.dx24, &shape.dy24, &shape.half_over_area, &shape.hx, &shape.hy]
            .map(|field| vectors::<S>(field, el, nx))
    };
    let length = vectors::<S>(&body.length, el, nx);
    let hourglass = vectors::<S>(&body.hourglass_stiffness, el, nx);
    let [mean, difference, shear] = stresses::<S>(&mut body.stress, el, nx);
    let hourglass_x = vectors_mut::<S>(&mut body.hourglass_x, el, nx);
    let hourglass_y = vectors_mut::<S>(&mut body.hourglass_y, el, nx);
    let [arm_mean, arm_difference, arm_shear] =
        if VISCOUS { stresses::<S>(&mut body.arm, el, nx) } else { Default::default() };
    let rows = &mut body.rows;
    let left_x = vectors_mut::<S>(&mut rows.left_x, 0, nx);
    let left_y = vectors_mut::<S>(&mut rows.left_y, 0, nx);
    let right_x = vectors_mut::<S>(&mut rows.right_x, 1, nx);
    let right_y = vectors_mut::<S>(&mut rows.right_y, 1, nx);
    let owed3_x = vectors_mut::<S>(&mut rows.owed3_x, 0, nx);
    let owed3_y = vectors_mut::<S>(&mut rows.owed3_y, 0, nx);
    let owed4_x = vectors_mut::<S>(&mut rows.owed4_x, 0, nx);
    let owed4_y = vectors_mut::<S>(&mut rows.owed4_y, 0, nx);

    let law: &RowLaw = &body.laws[j];
    let constant = |value| Lanes::splat(simd, value);
    let (bulk, rigidity) = (constant(law.bulk * step.dt), constant(law.shear * step.dt));
    // Strains are rates here: the step is in the constants, so that fewer multiplications are left to the
    // elements.
    let viscosity1 = constant(law.linear_viscosity);
    let viscosity2 = constant(law.quadratic_viscosity);
    let (decay, gain) = (constant(law.arm_decay), constant(law.arm_gain));
    let (zero, half, one, two) = (constant(0.0), constant(0.5), constant(1.0), constant(2.0));
    let (dt, half_dt) = (constant(step.dt), constant(0.5 * step.dt));

    for k in 0..nx / S::F64_LANES {
        let at = |field: &[&[S::f64s]; 4], corner: usize| Lanes::of(simd, field[corner][k]);
        let pick = |field: &[S::f64s]| Lanes::of(simd, field[k]);
        let (vx1, vx2, vx3, vx4) = (at(&vx, 0), at(&vx, 1), at(&vx, 2), at(&vx, 3));
        let (vy1, vy2, vy3, vy4) = (at(&vy, 0), at(&vy, 1), at(&vy, 2), at(&vy, 3));
        let [dx13, dy13, dx24, dy24, half_over_area, hx, hy] = if OBJECTIVE {
            let (x1, x2, x3, x4) = (at(&x, 0), at(&x, 1), at(&x, 2), at(&x, 3));
            let (y1, y2, y3, y4) = (at(&y, 0), at(&y, 1), at(&y, 2), at(&y, 3));
            let (dx13, dy13, dx24, dy24) = (x1 - x3, y1 - y3, x2 - x4, y2 - y4);
            let half_over_area = one / dx13.cross(dy24, dx24, dy13);
            [dx13, dy13, dx24, dy24, half_over_area, (x1 + x3) - (x2 + x4), (y1 + y3) - (y2 + y4)]
        } else {
            let [a, b, c, d, e, f, g] = fixed;
            [pick(a), pick(b), pick(c), pick(d), pick(e), pick(f), pick(g)]
        };
        // Rates of the displacement gradient.
        let (vx13, vx24, vy13, vy24) = (vx1 - vx3, vx2 - vx4, vy1 - vy3, vy2 - vy4);
        let xx = half_over_area * dy24.cross(vx13, dy13, vx24);
        let xy = half_over_area * dx13.cross(vx24, dx24, vx13);
        let yx = half_over_area * dy24.cross(vy13, dy13, vy24);
        let yy = half_over_area * dx13.cross(vy24, dx24, vy13);
        // Hourglass rates, four times: what remains of the corner velocities beside the linear field.
        let beside = |h: Lanes<S>, gx: Lanes<S>, gy: Lanes<S>| hy.neg_mul_add(gy, hx.neg_mul_add(gx, h));
        let warp_x = beside((vx1 + vx3) - (vx2 + vx4), xx, xy);
        let warp_y = beside((vy1 + vy3) - (vy2 + vy4), yx, yy);

        let (mut d, mut s) = (pick(difference), pick(shear));
        let (mut qx, mut qy) = (pick(hourglass_x), pick(hourglass_y));
        // Cosine and sine of the spin's angle and of twice that, to second order.
        let turn = half_dt * (yx - xy);
        let (square, twice) = (turn * turn, turn + turn);
        let (bent, bent_twice) = (half.neg_mul_add(square, one), two.neg_mul_add(square, one));
        let turned = |a: Lanes<S>, b: Lanes<S>, bent: Lanes<S>, angle: Lanes<S>| {
            (a.cross(bent, b, angle), b.mul_add(bent, a * angle))
        };
        if OBJECTIVE {
            (d, s) = turned(d, s, bent_twice, twice);
            (qx, qy) = turned(qx, qy, bent, turn);
        }
        let trace = xx + yy;
        let (mean_step, d_step, s_step) = (bulk * trace, rigidity * (xx - yy), rigidity * (xy + yx));
        let m = pick(mean) + mean_step;
        d += d_step;
        s += s_step;
        let stiffness = dt * pick(hourglass);
        qx = stiffness.mul_add(warp_x, qx);
        qy = stiffness.mul_add(warp_y, qy);
        mean[k] = m.v;
        difference[k] = d.v;
        shear[k] = s.v;
        hourglass_x[k] = qx.v;
        hourglass_y[k] = qy.v;

        // Artificial bulk viscosity: linear always, quadratic in compression.
        let l = pick(length);
        let squeeze = trace.min(zero) * l;
        let mut m = (viscosity1 * l).mul_add(trace, m);
        m = (viscosity2 * squeeze).neg_mul_add(squeeze, m);
        if VISCOUS {
            let (mut ad, mut as_) = (pick(arm_difference), pick(arm_shear));
            if OBJECTIVE {
                (ad, as_) = turned(ad, as_, bent_twice, twice);
            }
            let am = decay.mul_add(pick(arm_mean), gain * mean_step);
            ad = decay.mul_add(ad, gain * d_step);
            as_ = decay.mul_add(as_, gain * s_step);
            arm_mean[k] = am.v;
            arm_difference[k] = ad.v;
            arm_shear[k] = as_.v;
            m += am;
            d += ad;
            s += as_;
        }
        // Forces: the hourglass force works along the corners' signs, less its linear part.
        let (hqx, hqy) = (half_over_area * hx, half_over_area * hy);
        let sxx = hqx.neg_mul_add(qx, half * (m + d));
        let syy = hqy.neg_mul_add(qy, half * (m - d));
        let sxy_x = hqy.neg_mul_add(qx, half * s);
        let sxy_y = hqx.neg_mul_add(qy, half * s);
        let (p_x, p_y) = (dy24.cross(sxx, dx24, sxy_x), dy24.cross(sxy_y, dx24, syy));
        let (r_x, r_y) = (dx13.cross(sxy_x, dy13, sxx), dx13.cross(syy, dy13, sxy_y));
        left_x[k] = (pick(owed4_x) + (p_x + qx)).v;
        left_y[k] = (pick(owed4_y) + (p_y + qy)).v;
        right_x[k] = (pick(owed3_x) + (r_x - qx)).v;
        right_y[k] = (pick(owed3_y) + (r_y - qy)).v;
        owed3_x[k] = (qx - p_x).v;
        owed3_y[k] = (qy - p_y).v;
        owed4_x[k] = (-(r_x + qx)).v;
        owed4_y[k] = (-(r_y + qy)).v;
    }
}

/// Central differences for node row `j`: new velocities, then positions at the next half step.
#[inline(always)]
fn node_row<S: Simd, const ENERGY: bool>(simd: S, body: &mut Body, j: usize, step: &Step) {
    let (nx, start) = (body.nx, j * body.stride);
    // A periodic row ends before its closing node, which follows its twin.
    let count = if body.periodic { nx } else { body.stride };
    let rows = &body.rows;
    let left_x = vectors::<S>(&rows.left_x, 0, count);
    let left_y = vectors::<S>(&rows.left_y, 0, count);
    let right_x = vectors::<S>(&rows.right_x, 0, count);
    let right_y = vectors::<S>(&rows.right_y, 0, count);
    let load_x = vectors::<S>(&body.load_x, start, count);
    let load_y = vectors::<S>(&body.load_y, start, count);
    let inverse_mass = vectors::<S>(&body.inverse_mass, start, count);
    let x = vectors_mut::<S>(&mut body.x, start, count);
    let y = vectors_mut::<S>(&mut body.y, start, count);
    let vx = vectors_mut::<S>(&mut body.vx, start, count);
    let vy = vectors_mut::<S>(&mut body.vy, start, count);
    let (keep, push) = (Lanes::splat(simd, step.keep), Lanes::splat(simd, step.push));
    let half_dt = Lanes::splat(simd, 0.5 * step.dt);
    let mut work = [Lanes::splat(simd, 0.0); 3];
    for k in 0..count / S::F64_LANES {
        let pick = |field: &[S::f64s]| Lanes::of(simd, field[k]);
        let (ux, uy) = (pick(vx), pick(vy));
        let (inner_x, inner_y) = (pick(left_x) + pick(right_x), pick(left_y) + pick(right_y));
        let (outer_x, outer_y) = (pick(load_x), pick(load_y));
        let mobility = push * pick(inverse_mass);
        let new_x = keep.mul_add(ux, mobility * (outer_x - inner_x));
        let new_y = keep.mul_add(uy, mobility * (outer_y - inner_y));
        let (way_x, way_y) = (half_dt * (ux + new_x), half_dt * (uy + new_y));
        vx[k] = new_x.v;
        vy[k] = new_y.v;
        x[k] = (pick(x) + way_x).v;
        y[k] = (pick(y) + way_y).v;
        if ENERGY {
            let mass = Lanes::of(simd, vectors::<S>(&body.mass, start, count)[k]);
            work[0] += inner_x.mul_add(way_x, inner_y * way_y);
            work[1] += outer_x.mul_add(way_x, outer_y * way_y);
            work[2] += mass * way_x.mul_add(way_x, way_y * way_y);
        }
    }
    if ENERGY {
        body.work.internal += work[0].sum();
        body.work.load += work[1].sum();
        body.work.damping += step.damping / step.dt * work[2].sum();
    }
    if body.periodic {
        let last = start + nx;
        body.vx[last] = body.vx[start];
        body.vy[last] = body.vy[start];
        body.x[last] = body.x[start] + body.width;
        body.y[last] = body.y[start];
    }
}
