//! The kernel against its twin in C (`benches/peers/ridge_twin.c`), which was written from the equations in another manner:
//! the ridge under a vibrating plate that it loses and meets again, every node and stress after some thousand steps.

#[path = "../benches/peers/twin.rs"]
mod twin;

use muprime_models::ridge::{Body, FrictionRule, Instructions, Plate, RidgeCase, Strain, stability};
use twin::{Frame, Lane, Twin, Variant};

/// Greatest difference over greatest value.
fn apart(a: &[f64], b: &[f64]) -> f64 {
    let size = b.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    a.iter().zip(b).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs())) / size
}

#[test]
fn twin_in_c_agrees_to_rounding() {
    for strain in [Strain::Objective, Strain::Small] {
        let case = RidgeCase { elements: 300, strain, ..RidgeCase::paper() };
        let built = case.geometry.mesh(case.materials(), case.elements).expect("Table 1");
        let mesh = built.mesh;
        let penalty = vec![93e6; mesh.nx];
        let share = vec![1.0 / mesh.nx as f64; mesh.nx];
        let mut body = Body::new(mesh.clone(), strain);
        body.hold_top();
        let dt = stability::contact_step_s(&body, &penalty);
        let mut plate = Plate::new(penalty.clone(), FrictionRule::Global, case.mu0).expect("valid");
        let (sine_m, frequency_hz, damping) = (1e-6, 100e3, 1e6);
        let frame =
            Frame { mesh: &mesh, dt, damping, base: (built.corneum_rows, share), spot: vec![0.0; mesh.nx] };
        let lane = Lane {
            sine_m,
            frequency_hz,
            speed_m_s: case.speed_m_s,
            mu0: case.mu0,
            penalty,
            material: mesh.row_material.clone(),
        };
        let mut twin = Twin::start(Variant::plain(strain, Instructions::Avx512.here()), &frame, &[lane]);
        let (normal, lateral) = (case.line_load_n_m(), 0.5 * case.line_load_n_m());
        twin.load(normal, lateral);
        for i in 0..mesh.nx {
            let part = 1.0 / mesh.nx as f64;
            body.set_load(body.node(i, built.corneum_rows), -lateral * part, -normal * part);
        }
        let steps = 4000;
        let (mut k, mut normal, mut touching) = (0, 0.0, 0);
        body.advance(dt, damping, steps, &mut |mut surface| {
            let turn = 2.0 * std::f64::consts::PI * frequency_hz;
            let height = sine_m * (turn * k as f64 * dt).sin();
            let force = plate.touch(&mut surface, height, case.speed_m_s);
            normal += force.normal;
            touching += usize::from(force.nodes > 0);
            k += 1;
        });
        let (_, forces) = twin.run(steps, 0);
        let state = twin.state(0);
        let nodes: Vec<usize> = (0..=mesh.ny)
            .flat_map(|j| (0..=mesh.nx).map(move |i| (i, j)))
            .map(|(i, j)| body.node(i, j))
            .collect();
        let of = |pick: &dyn Fn(usize) -> f64| -> Vec<f64> { nodes.iter().map(|n| pick(*n)).collect() };
        let ours = [
            of(&|n| body.position_m(n).0),
            of(&|n| body.position_m(n).1),
            of(&|n| body.velocity_m_s(n).0),
            of(&|n| body.velocity_m_s(n).1),
        ];
        let mut worst = 0.0_f64;
        for (name, a, b) in
            [("x", 0), ("y", 1), ("vx", 2), ("vy", 3)].map(|(name, k)| (name, &ours[k], &state.nodes[k]))
        {
            println!("{strain:?}: {name} apart by {:.1e} of its greatest", apart(a, b));
            worst = worst.max(apart(a, b));
        }
        for k in 0..3 {
            let stress: Vec<f64> =
                (0..mesh.elements()).map(|e| body.stress_pa(e % mesh.nx, e / mesh.nx)[k]).collect();
            println!("{strain:?}: stress {k} apart by {:.1e}", apart(&stress, &state.stress[k]));
            worst = worst.max(apart(&stress, &state.stress[k]));
        }
        let mean = normal / steps as f64;
        println!(
            "{strain:?}: mean normal force {mean:.4} and {:.4} N/m, touching {touching} steps",
            forces[0].normal
        );
        // Contact is lost and met again, so the test has seen both; rounding grows a little at each meeting.
        assert!(touching > steps / 20 && touching < steps, "{touching}");
        assert!(worst < 1e-9, "{strain:?}: {worst:e}");
        assert!((forces[0].normal / mean - 1.0).abs() < 1e-9);
    }
}
