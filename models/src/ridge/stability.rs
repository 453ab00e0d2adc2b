//! The largest stable time step, from the highest frequency of the body with its contact springs closed.
//!
//! Central differences are stable up to dt = (2/omega) (sqrt(1 + xi^2) - xi) for a mode of frequency omega
//! and damping ratio xi. omega comes from power iteration with the kernel itself as the operator, so the
//! hourglass control, the layers and the penalty springs are all in it.

use super::body::{Body, LINEAR_BULK_VISCOSITY, Stress};
use super::kernel::{self, Features, Step, Surface};
use super::{Mesh, Strain};

/// Share of the stable limit that is used.
pub const STEP_SAFETY: f64 = 0.9;
/// The iteration comes from below; its last bit is covered by this margin on omega.
const OMEGA_MARGIN: f64 = 1.02;
const ITERATIONS: usize = 200;
/// Share of a soft layer's stable step that is used.
const LONGER_STEP_SHARE: f64 = 0.7;
/// Least mass damping in one of a soft layer's steps, `tests/ridge_longer_steps.rs`.
pub const DAMPING_IN_A_LONGER_STEP: f64 = 0.02;
/// Most steps of the surface in one of a layer: it divides the steps of a cycle.
const MOST_STEPS_IN_ONE: usize = 32;

/// Highest angular frequency in rad/s of `body` with `penalty` (N/m per metre of depth, one value for
/// each node of the surface) between the surface and a rigid plate.
pub fn highest_frequency_rad_s(body: &Body, penalty: &[f64]) -> f64 {
    let mut probe = body.clone();
    probe.move_in_longer_steps(&[]);
    probe.load_x.fill(0.0);
    probe.load_y.fill(0.0);
    for (law, material) in probe.laws.iter_mut().zip(&body.mesh.row_material) {
        let fast = 1.0 + material.arm().map_or(0.0, |a| a.ratio);
        law.bulk *= fast;
        law.shear *= fast;
        law.linear_viscosity = 0.0;
        law.quadratic_viscosity = 0.0;
    }
    let nodes = probe.vx.len();
    // A rough start: every frequency is in it. Held nodes stay at zero.
    let mut seed = 1_u64;
    let mut rough = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    let mut start = || -> Vec<f64> {
        probe.inverse_mass.iter().map(|inverse| if *inverse > 0.0 { rough() } else { 0.0 }).collect()
    };
    let (mut u, mut w) = (start(), start());
    if probe.periodic {
        for j in 0..=probe.ny {
            let first = j * probe.stride;
            u[first + probe.nx] = u[first];
            w[first + probe.nx] = w[first];
        }
    }
    let features = Features { objective: false, viscous: false, energy: false };
    let mut square = 0.0;
    for _ in 0..ITERATIONS {
        let norm: f64 = (0..nodes).map(|n| probe.mass[n] * (u[n] * u[n] + w[n] * w[n])).sum::<f64>().sqrt();
        u.iter_mut().chain(&mut w).for_each(|v| *v /= norm);
        let Stress { mean, difference, shear } = &mut probe.stress;
        for field in [mean, difference, shear, &mut probe.hourglass_x, &mut probe.hourglass_y] {
            field.fill(0.0);
        }
        probe.vx.copy_from_slice(&u);
        probe.vy.copy_from_slice(&w);
        kernel::run(&mut probe, features, Step::new(1.0, 0.0), 1, &mut |s: Surface<'_>| {
            for (i, k) in penalty.iter().enumerate() {
                s.fx[i] += k * s.vx[i];
                s.fy[i] += k * s.vy[i];
            }
        });
        // One step of dt = 1 from rest gave v - M^-1 K v.
        let mut quotient = 0.0;
        for n in 0..nodes {
            let (a, b) = (u[n] - probe.vx[n], w[n] - probe.vy[n]);
            quotient += probe.mass[n] * (u[n] * a + w[n] * b);
            (u[n], w[n]) = (a, b);
        }
        square = quotient;
    }
    square.max(0.0).sqrt() * OMEGA_MARGIN
}

/// Stable time step in s for a highest frequency, with the linear bulk viscosity and the safety in it.
pub fn stable_step_s(highest_frequency_rad_s: f64) -> f64 {
    let xi = LINEAR_BULK_VISCOSITY;
    STEP_SAFETY * 2.0 / highest_frequency_rad_s * ((1.0 + xi * xi).sqrt() - xi)
}

/// The same with stiffness-proportional damping of `beta_s` seconds: half of it times the frequency adds to
/// the damping ratio.
pub fn damped_step_s(highest_frequency_rad_s: f64, beta_s: f64) -> f64 {
    let xi = LINEAR_BULK_VISCOSITY + 0.5 * beta_s * highest_frequency_rad_s;
    // The form that keeps its digits where the ratio is large.
    STEP_SAFETY * 2.0 / highest_frequency_rad_s / ((1.0 + xi * xi).sqrt() + xi)
}

/// Stable time step in s of a body that meets a plate with these springs. Contact springs much stiffer than
/// the elements gain energy each time they open or close near the limit: there the step is halved.
pub fn contact_step_s(body: &Body, penalty: &[f64]) -> f64 {
    let bare = highest_frequency_rad_s(body, &[]);
    let closed = highest_frequency_rad_s(body, penalty);
    let stiffer = ((closed / bare - 2.0) / 1.0).clamp(0.0, 1.0);
    let step = match body.stiffness_damping_s {
        0.0 => stable_step_s(closed.max(bare)),
        beta => damped_step_s(closed.max(bare), beta),
    };
    step * (1.0 - 0.5 * stiffer)
}

/// Adds mass to the nodes whose elements and contact springs alone hold the step down, `share` of the first
/// layer's mass in all, and returns what was added in kg per metre of depth.
///
/// A node's mass suffices for a step dt where it is at least dt^2/4 (sum of omega_e^2 m_e + k), omega_e = 2 c
/// / l the highest frequency of each element beside it, m_e its share of the element's mass and k its contact
/// spring. The step is raised until what is missing is the mass that may be added. At the ridge's tip
/// elements are small both ways, so little mass goes far.
pub fn add_mass(body: &mut Body, penalty: &[f64], share: f64) -> f64 {
    let mesh = &body.mesh;
    let (nx, stride) = (mesh.nx, mesh.stride());
    let first = &mesh.row_material[0];
    let rows = mesh.row_material.iter().take_while(|m| *m == first).count();
    // Half the stiffness that a node sees, so that its mass must be above dt^2/4 times it.
    let mut stiffness = vec![0.0; body.mass.len()];
    let mut mass = 0.0;
    for j in 0..mesh.ny {
        let material = mesh.row_material[j];
        for i in 0..nx {
            let quarter = 0.25 * mesh.area_m2(i, j) * material.density_kg_m3;
            mass += if j < rows { 4.0 * quarter } else { 0.0 };
            let omega = 2.0 * material.wave_speed_m_s() / body.length[j * nx + i];
            let right = if mesh.periodic && i + 1 == nx { 0 } else { i + 1 };
            for node in [j * stride + i, j * stride + right, (j + 1) * stride + i, (j + 1) * stride + right] {
                stiffness[node] += quarter * omega * omega;
            }
        }
    }
    stiffness.iter_mut().zip(penalty).for_each(|(s, k)| *s += k);
    let free = |body: &Body, node: usize| body.inverse_mass[node] > 0.0 && stiffness[node] > 0.0;
    let missing = |body: &Body, quarter_dt2: f64| -> f64 {
        let nodes = (0..stiffness.len()).filter(|n| free(body, *n));
        nodes.map(|n| (quarter_dt2 * stiffness[n] - body.mass[n]).max(0.0)).sum()
    };
    let [low, _] = crate::root::halved([0.0, 1.0], 200, |middle| missing(body, middle) <= share * mass);
    let added = missing(body, low);
    for n in (0..stiffness.len()).filter(|n| free(body, *n)).collect::<Vec<_>>() {
        body.mass[n] = body.mass[n].max(low * stiffness[n]);
        body.inverse_mass[n] = 1.0 / body.mass[n];
    }
    if body.periodic {
        for start in (0..body.mass.len()).step_by(stride) {
            body.mass[start + nx] = body.mass[start];
            body.inverse_mass[start + nx] = body.inverse_mass[start];
        }
    }
    added
}

/// Longer steps of the softer layers, for [`Body::move_in_longer_steps`]: each layer behind the first, with all that lies behind
/// it, in the greatest power of two of steps `dt` that is within `LONGER_STEP_SHARE` of its own stable step and no more than
/// `MOST_STEPS_IN_ONE`. The layer is taken alone, free where it is held by the stiffer one: a bound from above on its frequency.
///
/// Impulses feed a fast motion whose half period is the longer step; mass damping must take more. A layer
/// therefore moves in longer steps only where the damping of one of them, `mass_damping_per_s` times its
/// length, is at least `DAMPING_IN_A_LONGER_STEP`.
pub fn longer_steps(body: &Body, dt: f64, mass_damping_per_s: f64) -> Vec<(usize, usize)> {
    let mesh = &body.mesh;
    let mut layers: Vec<(usize, usize)> = Vec::new();
    for first in (1..mesh.ny).filter(|j| mesh.row_material[*j] != mesh.row_material[*j - 1]) {
        let nodes = first * mesh.stride()..;
        let behind = Mesh {
            ny: mesh.ny - first,
            x_m: mesh.x_m[nodes.clone()].to_vec(),
            y_m: mesh.y_m[nodes].to_vec(),
            row_material: mesh.row_material[first..].to_vec(),
            ..mesh.clone()
        };
        let stable = stable_step_s(highest_frequency_rad_s(&Body::new(behind, Strain::Small), &[]));
        let fit = (LONGER_STEP_SHARE * stable / dt).max(1.0);
        let every = 1_usize << (fit.log2().floor() as usize);
        let before = layers.last().map_or(1, |layer| layer.1);
        layers.push((first, every.clamp(before, MOST_STEPS_IN_ONE)));
    }
    layers.retain(|(_, every)| mass_damping_per_s * *every as f64 * dt >= DAMPING_IN_A_LONGER_STEP);
    let mut before = 1;
    layers.retain(|(_, every)| std::mem::replace(&mut before, *every) < *every);
    layers
}
