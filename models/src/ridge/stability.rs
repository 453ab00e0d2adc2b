//! The largest stable time step, from the highest frequency of the body with its contact springs closed.
//!
//! Central differences are stable up to dt = (2/omega) (sqrt(1 + xi^2) - xi) for a mode of frequency omega
//! and damping ratio xi. omega comes from power iteration with the kernel itself as the operator, so the
//! hourglass control, the layers and the penalty springs are all in it.

use super::body::{Body, LINEAR_BULK_VISCOSITY};
use super::kernel::{self, Features, Step, Surface};

/// Share of the stable limit that is used.
pub const STEP_SAFETY: f64 = 0.9;
/// The iteration comes from below; its last bit is covered by this margin on omega.
const OMEGA_MARGIN: f64 = 1.02;
const ITERATIONS: usize = 200;

/// Highest angular frequency in rad/s of `body` with `penalty` (N/m per metre of depth, one value for
/// each node of the surface) between the surface and a rigid plate.
pub fn highest_frequency_rad_s(body: &Body, penalty: &[f64]) -> f64 {
    let mut probe = body.clone();
    for field in [&mut probe.mean, &mut probe.difference, &mut probe.shear] {
        field.fill(0.0);
    }
    probe.load_x.fill(0.0);
    probe.load_y.fill(0.0);
    for (law, material) in probe.laws.iter_mut().zip(&body.mesh().row_material) {
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
    let mut u: Vec<f64> =
        (0..nodes).map(|n| if probe.inverse_mass[n] > 0.0 { rough() } else { 0.0 }).collect();
    let mut w: Vec<f64> =
        (0..nodes).map(|n| if probe.inverse_mass[n] > 0.0 { rough() } else { 0.0 }).collect();
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
        for n in 0..nodes {
            u[n] /= norm;
            w[n] /= norm;
        }
        for field in [
            &mut probe.mean,
            &mut probe.difference,
            &mut probe.shear,
            &mut probe.hourglass_x,
            &mut probe.hourglass_y,
        ] {
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

/// The same with stiffness-proportional damping of `beta_s` seconds: half of it times the frequency adds to the damping ratio.
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
    let step = match body.stiffness_damping_s() {
        0.0 => stable_step_s(closed.max(bare)),
        beta => damped_step_s(closed.max(bare), beta),
    };
    step * (1.0 - 0.5 * stiffer)
}
