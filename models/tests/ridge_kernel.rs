//! The element kernel against closed forms. Each test prints the number that it judges.

#[path = "ridge/block.rs"]
mod block;

use block::block;
use muprime_models::ridge::{
    Body, Material, Mesh, Plate, RidgeError, RidgeGeometry, Strain, Surface, stability,
};

fn nothing(_: Surface<'_>) {}

fn stable_step(body: &Body) -> f64 {
    stability::stable_step_s(stability::highest_frequency_rad_s(body, &[]))
}

/// A block whose inner nodes are pushed about, so that every quad is crooked.
fn crooked(material: Material, n: usize) -> Mesh {
    Mesh::from_nodes(n, vec![material; n], false, |i, j| {
        let inner = i > 0 && j > 0 && i < n && j < n;
        let shift = |a: f64| if inner { 0.3 / n as f64 * (a * 12.9898).sin() } else { 0.0 };
        let (x, y) = (i as f64 / n as f64, j as f64 / n as f64);
        (x + shift(i as f64 + 3.1 * j as f64), y + shift(7.7 * i as f64 + j as f64))
    })
    .expect("not folded")
}

/// Patch test: the boundary of a crooked mesh moves linearly; the inner nodes must follow it exactly and
/// the stress must be uniform and equal to Hooke's law.
#[test]
fn patch_test_on_crooked_quads() {
    let material = Material::elastic(1e3, 0.3, 2.0);
    for strain in [Strain::Small, Strain::Objective] {
        let mut body = Body::new(crooked(material, 8), strain);
        // The bulk viscosity grows with the element's size, so it is no linear law on unequal elements.
        body.scale_bulk_viscosity(0.0);
        let field = |x: f64, y: f64| (1e-3 * (2.0 * x + 0.5 * y), 1e-3 * (0.5 * x - y));
        for j in 0..=8 {
            for i in 0..=8 {
                let n = body.node(i, j);
                let (x, y) = body.position_m(n);
                let (vx, vy) = field(x, y);
                body.set_velocity(n, vx, vy);
                if i == 0 || j == 0 || i == 8 || j == 8 {
                    body.hold(n);
                }
            }
        }
        let start: Vec<(f64, f64)> = (0..81).map(|k| body.position_m(body.node(k % 9, k / 9))).collect();
        let dt = stable_step(&body);
        body.advance(dt, 0.0, 100, &mut nothing);
        let mut stray = 0.0_f64;
        for (k, at) in start.iter().enumerate() {
            let n = body.node(k % 9, k / 9);
            let (vx, vy) = body.velocity_m_s(n);
            let want = field(at.0, at.1);
            stray += 0.5 * body.mass_kg_m(n) * ((vx - want.0).powi(2) + (vy - want.1).powi(2));
        }
        println!("{strain:?}: stray kinetic energy {stray:e} J/m");
        let t = 100.0 * dt;
        let (exx, eyy, gxy) = (2e-3 * t, -1e-3 * t, 1e-3 * t);
        let (l, g) = (material.lambda_pa(), material.shear_modulus_pa());
        let hooke = [l * (exx + eyy) + 2.0 * g * exx, l * (exx + eyy) + 2.0 * g * eyy, g * gxy];
        // The objective strain is of second order beside the small one: its stress agrees to the strain.
        let tolerance = if strain == Strain::Small { 1e-11 } else { 4e-3 * t };
        for j in 0..8 {
            for i in 0..8 {
                for (got, want) in body.stress_pa(i, j).iter().zip(hooke) {
                    assert!((got - want).abs() < tolerance * hooke[0].abs() + 1e-15, "{got} {want}");
                }
            }
        }
        assert!(stray < 1e-16, "{stray:e}");
    }
}

/// A rigid rotation through a right angle in coarse steps: no stress arises, and a stress that is there
/// turns with the body.
#[test]
fn rigid_rotation_makes_no_force_and_turns_stress() {
    let mut body = Body::new(crooked(Material::elastic(1e6, 0.3, 1.0), 8), Strain::Objective);
    body.scale_bulk_viscosity(0.0);
    let mut loaded = body.clone();
    for k in 0..64 {
        loaded.set_stress(k % 8, k / 8, [5.0, -2.0, 1.0]);
    }
    let steps = 720;
    let first: Vec<(f64, f64)> = (0..81).map(|k| body.position_m(body.node(k % 9, k / 9))).collect();
    let turned = |(x, y): (f64, f64), angle: f64| {
        (x * angle.cos() - y * angle.sin() + angle, x * angle.sin() + y * angle.cos() - 2.0 * angle)
    };
    for body in [&mut body, &mut loaded] {
        for k in 0..81 {
            body.hold(body.node(k % 9, k / 9));
        }
        for step in 0..steps {
            let angle = |s: usize| std::f64::consts::FRAC_PI_2 * s as f64 / steps as f64;
            for (k, at) in first.iter().enumerate() {
                let (a, b) = (turned(*at, angle(step)), turned(*at, angle(step + 1)));
                let n = body.node(k % 9, k / 9);
                body.set_position(n, 0.5 * (a.0 + b.0), 0.5 * (a.1 + b.1));
                body.set_velocity(n, b.0 - a.0, b.1 - a.1);
            }
            body.advance(1.0, 0.0, 1, &mut nothing);
        }
    }
    let worst = (0..64).flat_map(|k| body.stress_pa(k % 8, k / 8)).fold(0.0_f64, |a, b| a.max(b.abs()));
    println!("stress after a free rotation: {worst:e} Pa of a modulus of 1e6 Pa");
    assert!(worst < 1e-7);
    for k in 0..64 {
        for (got, want) in loaded.stress_pa(k % 8, k / 8).iter().zip([-2.0, 5.0, -1.0]) {
            assert!((got - want).abs() < 1e-4, "{got} instead of {want}");
        }
    }
}

/// A free body in uniform motion feels no force.
#[test]
fn uniform_motion_makes_no_force() {
    let mut body = Body::new(crooked(Material::elastic(1e6, 0.3, 1.0), 8), Strain::Objective);
    let nodes: Vec<usize> = (0..81).map(|k| body.node(k % 9, k / 9)).collect();
    nodes.iter().for_each(|n| body.set_velocity(*n, 3.0, -2.0));
    body.advance(stable_step(&body), 0.0, 1000, &mut nothing);
    for n in nodes {
        let (vx, vy) = body.velocity_m_s(n);
        assert!((vx - 3.0).abs() < 1e-9 && (vy + 2.0).abs() < 1e-9, "{vx} {vy}");
    }
}

/// Half a period of a confined column (fixed top, free bottom) is 2 L / c_p; found from its lowest mode.
#[test]
fn column_swings_at_the_pressure_wave_speed() {
    let material = Material::elastic(28.3e6, 0.33, 750.0);
    let (length, rows) = (1e-3, 64);
    let mut body = Body::new(block([1e-4, length], [8, rows], material, true).expect("valid"), Strain::Small);
    body.scale_bulk_viscosity(0.0);
    body.hold_top();
    for j in 0..rows {
        for i in 0..=8 {
            let shape = (0.5 * std::f64::consts::PI * j as f64 / rows as f64).cos();
            body.set_velocity(body.node(i, j), 0.0, 1e-3 * shape);
        }
    }
    let dt = stable_step(&body);
    let period = crossing_period(&mut body, dt, |body| body.velocity_m_s(0).1);
    let exact = 4.0 * length / material.wave_speed_m_s();
    println!("period {period:e} s, exact {exact:e} s, off by {:.3} %", 100.0 * (period / exact - 1.0));
    assert!((period / exact - 1.0).abs() < 0.002);
}

/// First bending frequency of a cantilever in plane strain, L/h = 16, against Euler and Bernoulli with the
/// first-order correction for shear and rotary inertia (Timoshenko), 0.45 % here.
#[test]
fn cantilever_swings_at_the_beam_frequency() {
    let material = Material::elastic(1e6, 0.3, 1000.0);
    let (length, height) = (1.6e-2, 1e-3);
    let rows = 16;
    let mut previous = f64::NAN;
    for columns in [64, 128] {
        let mesh = block([length, height], [columns, rows], material, false).expect("valid");
        let mut body = Body::new(mesh, Strain::Small);
        body.scale_bulk_viscosity(0.0);
        let beta = 1.875_104_068_711_961_f64;
        for j in 0..=rows {
            for i in 0..=columns {
                let s = beta * i as f64 / columns as f64;
                let k = (beta.cosh() + beta.cos()) / (beta.sinh() + beta.sin());
                let shape = s.cosh() - s.cos() - k * (s.sinh() - s.sin());
                let slope = (s.sinh() + s.sin() - k * (s.cosh() - s.cos())) * beta / length;
                let y = height * (j as f64 / rows as f64 - 0.5);
                body.set_velocity(body.node(i, j), -1e-6 * slope * y, 1e-6 * shape);
            }
            let n = body.node(0, j);
            body.set_velocity(n, 0.0, 0.0);
            body.hold(n);
        }
        let dt = stable_step(&body);
        // The share of the first mode: what else was set swinging does not move its zeros.
        let first: Vec<f64> = (0..=columns).map(|i| body.velocity_m_s(body.node(i, rows / 2)).1).collect();
        let frequency = 1.0
            / crossing_period(&mut body, dt, |body| {
                (0..=columns).map(|i| body.velocity_m_s(body.node(i, rows / 2)).1 * first[i]).sum()
            });
        let plane = material.young_modulus_pa / (1.0 - 0.3 * 0.3);
        let radius2 = height * height / 12.0;
        let thin = beta.powi(2) / (2.0 * std::f64::consts::PI * length.powi(2))
            * (plane * radius2 / material.density_kg_m3).sqrt();
        // Rayleigh quotient with rotary inertia and shear, first order in (r/L)^2.
        let shear = plane / (5.0 / 6.0 * material.shear_modulus_pa());
        let integral = beta * beta * SLOPE_OVER_DEFLECTION;
        let exact =
            thin * (1.0 - 0.5 * radius2 / length.powi(2) * (integral + shear * beta.powi(2) * CURVE_SHEAR));
        let off = frequency / exact - 1.0;
        println!("{columns} x {rows}: {frequency:.3} Hz, beam {exact:.3} Hz, off by {:.2} %", 100.0 * off);
        assert!(off.abs() < 0.03, "{off}");
        assert!(previous.is_nan() || off.abs() < f64::abs(previous), "no better when finer");
        previous = off;
    }
}
/// Integral of (phi')^2 over beta^2 times that of phi^2, first clamped-free mode (4.648 / 3.516).
const SLOPE_OVER_DEFLECTION: f64 = 4.6478 / 3.5160;
/// The same for the shear term: (phi''')^2 over beta^6, which for this mode equals the slope's ratio.
const CURVE_SHEAR: f64 = 4.6478 / 3.5160;

/// Time between the first and third zero of a velocity, with linear interpolation.
fn crossing_period(body: &mut Body, dt: f64, pick: impl Fn(&Body) -> f64) -> f64 {
    let (mut zeros, mut before, mut t) = (Vec::new(), pick(body), 0.0);
    while zeros.len() < 3 {
        body.advance(dt, 0.0, 1, &mut nothing);
        let now = pick(body);
        if before != 0.0 && before * now <= 0.0 {
            zeros.push(t + dt * before / (before - now));
        }
        (before, t) = (now, t + dt);
        assert!(t < 1e7 * dt, "no oscillation");
    }
    zeros[2] - zeros[0]
}

/// With no viscosity the energy of a shaken block stays what it was.
#[test]
fn energy_of_a_free_vibration_stays() {
    for strain in [Strain::Small, Strain::Objective] {
        let mut body = Body::new(crooked(Material::elastic(1e6, 0.3, 1000.0), 16), strain);
        body.scale_bulk_viscosity(0.0);
        for k in 0..17 * 17 {
            let n = body.node(k % 17, k / 17);
            let (x, y) = body.position_m(n);
            body.set_velocity(n, 1e-2 * (3.0 * x).sin(), 1e-2 * (2.0 * y + x).cos());
        }
        let dt = 0.5 * stable_step(&body);
        let total = |body: &Body| {
            let e = body.energy();
            e.kinetic + e.elastic + e.hourglass
        };
        let first = total(&body);
        let mut worst = 0.0_f64;
        for _ in 0..200 {
            body.advance(dt, 0.0, 50, &mut nothing);
            worst = worst.max((total(&body) / first - 1.0).abs());
        }
        println!("{strain:?}: energy off by at most {:.3} % over 10000 steps", 100.0 * worst);
        // Kinetic and stored energy are read half a step apart: that ripples, it does not drift.
        assert!(worst < 0.02, "{worst}");
    }
}

/// The step found is nearly the largest: a tenth above the bare limit 2/omega the block runs away.
#[test]
fn stable_step_is_stable_and_sharp() {
    let run = |factor: f64| {
        let mut body = Body::new(crooked(Material::elastic(1e6, 0.3, 1000.0), 8), Strain::Small);
        body.scale_bulk_viscosity(0.0);
        let limit = 2.0 / stability::highest_frequency_rad_s(&body, &[]);
        body.set_velocity(body.node(3, 4), 1e-3, 2e-3);
        body.advance(factor * limit, 0.0, 20_000, &mut nothing);
        body.is_finite()
    };
    assert_eq!(run(0.99), Ok(()));
    assert_eq!(run(1.10), Err(RidgeError::Diverged));
}

/// The viscous solid creeps from its fast to its slow modulus with its retardation time.
#[test]
fn confined_column_creeps_with_the_retardation_time() {
    let mut material = Material::elastic(1e6, 0.3, 1000.0);
    material.retardation_time_s = 0.2;
    let mut body = Body::new(block([1e-2, 1e-2], [8, 8], material, true).expect("valid"), Strain::Small);
    body.hold_top();
    let pressure = 10.0;
    for i in 0..=8 {
        body.set_load(body.node(i, 0), 0.0, pressure * 1e-2 / 8.0);
    }
    let dt = stable_step(&body);
    let slow = pressure * 1e-2 / (material.lambda_pa() + 2.0 * material.shear_modulus_pa());
    let mut t = 0.0;
    for _ in 0..4 {
        let count = (0.1 / dt) as usize;
        body.advance(dt, 2e3, count, &mut nothing);
        t += count as f64 * dt;
        let creep = body.position_m(body.node(4, 0)).1 / slow;
        let exact = 1.0 - 0.5 * (-t / 0.2_f64).exp();
        println!("t = {t:.2} s: {creep:.4} of the slow deflection, exact {exact:.4}");
        assert!((creep - exact).abs() < 0.01);
    }
}

/// What cannot be built is refused with a reason.
#[test]
fn bad_input_is_refused() {
    let good = Material::elastic(1e6, 0.3, 1000.0);
    for bad in [
        Material { young_modulus_pa: -1.0, ..good },
        Material { young_modulus_pa: f64::NAN, ..good },
        Material { poisson_ratio: 0.5, ..good },
        Material { density_kg_m3: 0.0, ..good },
        Material { retardation_time_s: -1.0, ..good },
    ] {
        let error = block([1.0, 1.0], [8, 8], bad, false).expect_err("refused");
        assert!(error.to_string().contains("must be"), "{error}");
    }
    assert!(block([-1.0, 1.0], [8, 8], good, false).is_err());
    assert!(block([1.0, 1.0], [7, 8], good, false).is_err());
    let flat = RidgeGeometry { ridge_width_m: f64::NAN, ..RidgeGeometry::TABLE_1 };
    assert!(flat.mesh([good; 3], 1500).is_err());
    assert!(RidgeGeometry::TABLE_1.mesh([good; 3], 10).is_err());
    assert!(Plate::new(vec![1.0], muprime_models::ridge::FrictionRule::Local, f64::NAN).is_err());
}
