//! Ridges with mass: a table of the steady friction of a bouncing oscillator, made once at first use.
//!
//! In units of `k_n w/2` and radians: `r^2 x'' + 2 zeta r x' + x + depth = force`, the plate at `sin(theta)`,
//! `r = 2 pi f sqrt(m/k_n)`. Touch-down keeps a share of the approach speed (restitution, zero in two of the
//! tables); its impulse carries load, but no friction, since the lateral spring is unstretched then. The table holds the ratio to the massless slider, so that it is exactly
//! one where there is no mass. Its interpolation error is [`STATED_ERROR`] of the ratio.

use crate::contact::{Contact, arc_load, half_contact_angle, lost_to_stick};
use std::f64::consts::PI;
use std::sync::OnceLock;

/// Damping ratio and restitution of the touch-down for which tables are kept.
pub const CLASSES: [(f64, f64); 4] = [(0.3, 0.0), (1.0, 0.0), (0.15, 0.6), (0.5, 0.35)];
/// Relative error of the interpolated ratio, root mean square, measured between the nodes by the tests.
pub const STATED_ERROR: f64 = 0.06;

const LOADS: usize = 22;
const RATIOS: usize = 13;
const DRAGS: usize = 20;
const LOAD_RANGE: (f64, f64) = (0.004, 1.5);
const DRAG_RANGE: (f64, f64) = (0.001, 1.5);
const LARGEST_RATIO: f64 = 1.5;
const STEPS: usize = 240;

type Table = Vec<f32>;
static TABLES: OnceLock<[Table; CLASSES.len()]> = OnceLock::new();

/// Ratio of the mean friction with mass to that without.
pub fn friction_ratio(c: &Contact) -> f64 {
    let tables = TABLES.get_or_init(|| CLASSES.map(|(zeta, restitution)| build(zeta, restitution)));
    let table = &tables[c.damping_class.min(CLASSES.len() - 1)];
    let r = 2.0 * PI * c.frequency * (c.mass / c.normal_stiffness).sqrt();
    let x = place(c.load_ratio().ln(), LOAD_RANGE.0.ln(), LOAD_RANGE.1.ln(), LOADS);
    let y = place(r, 0.0, LARGEST_RATIO, RATIOS);
    let z = place(c.drag().ln(), DRAG_RANGE.0.ln(), DRAG_RANGE.1.ln(), DRAGS);
    let mut sum = 0.0;
    for corner in 0..8usize {
        let (i, wi) = side(x, corner & 1);
        let (j, wj) = side(y, (corner >> 1) & 1);
        let (k, wk) = side(z, (corner >> 2) & 1);
        sum += wi * wj * wk * f64::from(table[(i * RATIOS + j) * DRAGS + k]);
    }
    sum.exp()
}

fn place(value: f64, low: f64, high: f64, count: usize) -> (usize, f64) {
    let s = ((value - low) / (high - low) * (count - 1) as f64).clamp(0.0, (count - 1) as f64);
    let i = (s as usize).min(count - 2);
    (i, s - i as f64)
}

fn side((index, part): (usize, f64), upper: usize) -> (usize, f64) {
    if upper == 1 { (index + 1, part) } else { (index, 1.0 - part) }
}

fn build(zeta: f64, restitution: f64) -> Table {
    let mut table = vec![0.0; LOADS * RATIOS * DRAGS];
    for i in 0..LOADS {
        let load =
            (LOAD_RANGE.0.ln() + (LOAD_RANGE.1 / LOAD_RANGE.0).ln() * i as f64 / (LOADS - 1) as f64).exp();
        for j in 1..RATIOS {
            let r = LARGEST_RATIO * j as f64 / (RATIOS - 1) as f64;
            let drags: [f64; DRAGS] = std::array::from_fn(|k| {
                (DRAG_RANGE.0.ln() + (DRAG_RANGE.1 / DRAG_RANGE.0).ln() * k as f64 / (DRAGS - 1) as f64).exp()
            });
            let friction = bounce(load, r, zeta, restitution, &drags);
            for k in 0..DRAGS {
                let phi = half_contact_angle(load, 0.0);
                let carried = if phi >= PI { load } else { arc_load(phi) };
                let massless = carried - lost_to_stick(phi, drags[k]) / (2.0 * PI);
                table[(i * RATIOS + j) * DRAGS + k] =
                    (friction[k].max(0.02 * massless) / massless).ln() as f32;
            }
        }
    }
    table
}

/// Mean friction (units of `mu0 k_n w/2`) of the bouncing oscillator at several drags.
///
/// The finger's depth is steered by its mean force until the load is carried, then averaged over cycles
/// (a bounce may repeat over two cycles or wander).
pub fn bounce<const N: usize>(load: f64, r: f64, zeta: f64, restitution: f64, drags: &[f64; N]) -> [f64; N] {
    let h = 2.0 * PI / STEPS as f64;
    let (settle, average) = (60, 24);
    let mut depth = if load >= 1.0 { load } else { -half_contact_angle(load, 0.0).cos() };
    let (mut x, mut v) = (0.0f64, 1.0f64);
    let mut touching = true;
    let mut stretch = [0.0f64; N];
    let mut sums = [0.0f64; N];
    // Free flight is a damped oscillator about -depth: its exact step keeps the flight free of step error.
    let (decay, turn) = (zeta / r, (1.0 - zeta * zeta).max(1e-6).sqrt() / r);
    let (e, cos, sin) = ((-decay * h).exp(), (turn * h).cos(), (turn * h).sin());
    let mut carried = 0.0;
    for cycle in 0..settle + average {
        let mut mean = 0.0;
        for step in 0..STEPS {
            let theta = h * (step + 1) as f64;
            let (plate, plate_v) = (theta.sin(), theta.cos());
            let mut force = 0.0;
            if touching {
                force = -r * r * plate + 2.0 * zeta * r * plate_v + plate + depth;
                if force > 0.0 {
                    (x, v) = (plate, plate_v);
                } else {
                    touching = false;
                    force = 0.0;
                }
            }
            if !touching {
                let q = x + depth;
                let q2 = e * (q * (cos + decay / turn * sin) + v / turn * sin);
                v = e * (v * cos - (q * (decay * decay + turn * turn) / turn + v * decay / turn) * sin);
                x = q2 - depth;
                if x <= plate {
                    let approach = (plate_v - v).max(0.0);
                    // A rebound too small to clear the plate within a step is none.
                    let back = if restitution * approach > 2.0 * h { restitution } else { 0.0 };
                    mean += r * r * (1.0 + back) * approach / (2.0 * PI);
                    (x, v) = (plate, plate_v + back * approach);
                    touching = back == 0.0;
                }
            }
            mean += force * h / (2.0 * PI);
            for n in 0..N {
                stretch[n] = if touching { (stretch[n] + drags[n] * h).min(force) } else { 0.0 };
                if cycle >= settle {
                    sums[n] += stretch[n] * h;
                }
            }
        }
        if cycle >= settle {
            carried += mean / average as f64;
        } else {
            depth += 0.25 * (load - mean);
        }
    }
    // What little the steering left is made up in proportion.
    let correction = (load / carried).clamp(0.8, 1.25);
    sums.map(|s| s / (2.0 * PI * average as f64) * correction)
}
