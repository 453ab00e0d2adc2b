//! Contact and friction against closed forms and published benchmarks.

#[path = "ridge/block.rs"]
mod block;

use block::block;
use muprime_models::ridge::{
    Body, FrictionRule, Material, Mesh, Plate, RidgeGeometry, RidgeProfile, Strain, Surface, stability,
};

fn springs(mesh: &Mesh, per_metre: f64) -> Vec<f64> {
    let width = mesh.tributary_width_m(0);
    let count = if mesh.periodic { mesh.nx } else { mesh.nx + 1 };
    width[..count].iter().map(|w| per_metre * w).collect()
}

/// Doyen, Ern and Piperno (2011): an elastic bar falls on a rigid floor (E 900, rho 1, L 10, g 10, from
/// height 5). Two bounces take 5.333 s; each contact lasts 2 L / c = 0.6667 s.
#[test]
fn bouncing_bar() {
    let material = Material::elastic(900.0, 0.0, 1.0);
    let (length, rows) = (10.0, 400);
    let mesh = block([1.0, length], [8, rows], material, true).expect("valid");
    let penalty = springs(&mesh, 1e5);
    let mut body = Body::new(mesh, Strain::Small);
    body.scale_bulk_viscosity(0.0);
    let mut plate = Plate::new(penalty, FrictionRule::Local, 0.0).expect("valid");
    for j in 0..=rows {
        for i in 0..=8 {
            let n = body.node(i, j);
            let (x, y) = body.position_m(n);
            body.set_position(n, x, y + 5.0);
            body.set_load(n, 0.0, -10.0 * body.mass_kg_m(n));
        }
    }
    let dt = stability::contact_step_s(&body, &plate.penalty);
    let dt = 0.7 * dt;
    let (mut t, mut touching, mut touches, mut leaves) = (0.0, false, Vec::new(), Vec::new());
    let mut quiet = 0.0;
    while touches.len() < 3 {
        let mut force = 0.0;
        body.advance(dt, 0.0, 1, &mut |mut s: Surface<'_>| force = plate.touch(&mut s, 0.0, 0.0).normal);
        t += dt;
        if force > 0.0 {
            if !touching && quiet > 0.3 {
                touches.push(t);
            }
            (touching, quiet) = (true, 0.0);
        } else {
            if touching {
                leaves.push(t);
            }
            (touching, quiet) = (false, quiet + dt);
        }
        assert!(t < 8.0, "{touches:?}");
    }
    let lasts = leaves.iter().filter(|l| **l < touches[1]).fold(0.0_f64, |a, b| a.max(*b)) - touches[0];
    let two = touches[2] - touches[0];
    println!(
        "first touch {:.4} s (exact 1), contact {lasts:.4} s (exact 0.6667), two bounces {two:.4} s (5.3333)",
        touches[0]
    );
    assert!((touches[0] - 1.0).abs() < 1e-3);
    assert!((lasts / 0.666_67 - 1.0).abs() < 0.02);
    assert!((two / 5.333_33 - 1.0).abs() < 0.01);
}

/// Contact patch: a block pressed on the plate carries the same pressure at every node.
#[test]
fn contact_patch_is_uniform() {
    let material = Material::elastic(1e6, 0.3, 1000.0);
    let mesh = block([1.0, 1.0], [8, 8], material, false).expect("valid");
    let width = mesh.tributary_width_m(0);
    let penalty = springs(&mesh, 1e8);
    let mut body = Body::new(mesh, Strain::Objective);
    let mut plate = Plate::new(penalty, FrictionRule::Local, 0.0).expect("valid");
    for (i, w) in width.iter().enumerate() {
        body.set_load(body.node(i, 8), 0.0, -1e4 * w);
    }
    let dt = stability::contact_step_s(&body, &plate.penalty);
    body.advance(dt, 30.0, 60_000, &mut |mut s| {
        plate.touch(&mut s, 0.0, 0.0);
    });
    for (i, w) in width.iter().enumerate() {
        let pressure = plate.load[i] / w;
        assert!((pressure / 1e4 - 1.0).abs() < 0.01, "node {i}: {pressure} Pa");
    }
    // Free sides: the block shortens by p L (1 - nu^2) / E in plane strain.
    let (_, top) = body.position_m(body.node(4, 8));
    let want = 1.0 - 1e4 * (1.0 - 0.09) / 1e6 - 1e4 / 1e8;
    println!("height {top:.6} m, closed form {want:.6} m");
    assert!((top - want).abs() < 2e-4);
}

/// Hertz: the ridge's tip in one material on the plate, graded mesh. Half-width b = sqrt(4 P R / pi E*) and
/// peak pressure p0 = sqrt(P E* / pi R) of the line contact.
#[test]
fn hertz_pressure_under_the_tip() {
    let material = Material::elastic(28.3e6, 0.33, 750.0);
    // Thin below, so that it comes to rest soon; thick beside the contact all the same.
    let geometry = RidgeGeometry {
        profile: RidgeProfile::Parabola,
        dermis_m: 100e-6,
        subcutaneous_m: 100e-6,
        ..RidgeGeometry::TABLE_1
    };
    let star = material.young_modulus_pa / (1.0 - 0.33 * 0.33);
    // Of a parabola's tip.
    let radius = (0.5 * geometry.ridge_width_m).powi(2) / (2.0 * geometry.ridge_height_m);
    let load = 3.5;
    let (p0, b) = (
        (load * star / (std::f64::consts::PI * radius)).sqrt(),
        (4.0 * load * radius / (std::f64::consts::PI * star)).sqrt(),
    );
    for elements in [1500, 4000] {
        let built = geometry.mesh([material; 3], elements).expect("valid");
        let (row, tip) = (built.corneum_rows, built.tip_spacing_m);
        let width = built.mesh.tributary_width_m(0);
        let base = built.mesh.tributary_width_m(row);
        let penalty = width[..built.mesh.nx].iter().map(|w| 80.0 * star * w / tip).collect::<Vec<_>>();
        let mut body = Body::new(built.mesh, Strain::Small);
        let mut plate = Plate::new(penalty, FrictionRule::Global, 0.0).expect("valid");
        for (i, w) in base.iter().enumerate() {
            body.set_load(body.node(i, row), 0.0, -load * w / 500e-6);
        }
        // Nothing holds the block but the plate.
        let dt = stability::contact_step_s(&body, &plate.penalty);
        body.advance(dt, 4e5, (120e-6 / dt) as usize, &mut |mut s| {
            plate.touch(&mut s, 0.0, 0.0);
        });
        let total: f64 = plate.load.iter().sum();
        let pressure: Vec<f64> = plate.load.iter().zip(&width).map(|(f, w)| f / w).collect();
        let peak = pressure.iter().fold(0.0_f64, |a, p| a.max(*p));
        // Half-width from the second moment of the pressure, b^2/4 for Hertz's half ellipse.
        let moment: f64 = plate.load.iter().enumerate().map(|(i, f)| f * body.position_m(i).0.powi(2)).sum();
        let half = 2.0 * (moment / total).sqrt();
        println!(
            "{elements}: load {total:.4} N/m, peak {:.1} kPa (Hertz {:.1}), half-width {:.3} um (Hertz {:.3})",
            peak / 1e3,
            p0 / 1e3,
            half * 1e6,
            b * 1e6
        );
        assert!((total / load - 1.0).abs() < 0.01);
        // Point loads on nodes widen the second moment by about a third of the spacing squared.
        let tolerance = if elements == 1500 { 0.10 } else { 0.05 };
        assert!((peak / p0 - 1.0).abs() < 0.03 && (half / b - 1.0).abs() < tolerance);
    }
}

/// Coulomb: a block thrown along the plate stops after v^2 / (2 mu g); pulled with less than mu N it
/// stays, with more it speeds up by the difference.
#[test]
fn coulomb_block_slides_stops_and_sticks() {
    let material = Material::elastic(1e6, 0.3, 1000.0);
    let (g, mu) = (10.0, 0.3);
    for rule in [FrictionRule::Global, FrictionRule::Local] {
        let set_up = |pull: f64| {
            let mesh = block([0.1, 0.025], [16, 4], material, false).expect("valid");
            let penalty = springs(&mesh, 1e8);
            let mut body = Body::new(mesh, Strain::Small);
            for j in 0..=4 {
                for i in 0..=16 {
                    let n = body.node(i, j);
                    let m = body.mass_kg_m(n);
                    body.set_load(n, pull * mu * g * m, -g * m);
                }
            }
            let plate = Plate::new(penalty, rule, mu).expect("valid");
            let dt = stability::contact_step_s(&body, &plate.penalty);
            (body, plate, dt)
        };
        let run = |pull: f64, start: f64, time: f64| {
            let (mut body, mut plate, dt) = set_up(pull);
            // First let it settle on the plate, pressed but not pulled.
            let (mut settle, ..) = set_up(0.0);
            settle.advance(dt, 2e3, (0.02 / dt) as usize, &mut |mut s| {
                plate.touch(&mut s, 0.0, 0.0);
            });
            let pulled = body.clone();
            body = settle;
            for j in 0..=4 {
                for i in 0..=16 {
                    let n = body.node(i, j);
                    let m = pulled.mass_kg_m(n);
                    body.set_load(n, pull * mu * g * m, -g * m);
                    body.set_velocity(n, start, 0.0);
                }
            }
            let middle = body.node(8, 2);
            let from = body.position_m(middle).0;
            body.advance(dt, 0.0, (time / dt) as usize, &mut |mut s| {
                plate.touch(&mut s, 0.0, 0.0);
            });
            (body.position_m(middle).0 - from, body.velocity_m_s(middle).0)
        };
        let (way, speed) = run(0.0, 0.5, 0.3);
        let exact = 0.25 / (2.0 * mu * g);
        println!("{rule:?}: stops after {way:.5} m, exact {exact:.5} m");
        assert!((way / exact - 1.0).abs() < 0.02 && speed.abs() < 5e-3);
        // Not near mu N: a sudden pull overshoots to twice itself, and would slip in truth as well.
        let (way, _) = run(0.45, 0.0, 0.1);
        assert!(way.abs() < 1e-5, "{rule:?}: crept {way} m under 0.45 mu N");
        let (way, _) = run(1.5, 0.0, 0.2);
        let exact = 0.5 * 0.5 * mu * g * 0.04;
        println!("{rule:?}: pulled with 1.5 mu N it goes {way:.6} m, exact {exact:.6} m");
        assert!((way / exact - 1.0).abs() < 0.02);
    }
}
