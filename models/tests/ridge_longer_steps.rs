//! Soft layers in longer steps, and mass added about the tip: against a closed form, for what they feed, and beside one step for all.

use muprime_models::ridge::{Body, Material, Mesh, RidgeCase, RunSettings, Strain, Surface, run, stability};

fn nothing(_: Surface<'_>) {}

/// A stiff layer in front of a soft one, `rows` of elements each.
fn layered(stiff: Material, soft: Material, rows: usize, periodic: bool) -> Body {
    let mut material = vec![stiff; rows];
    material.extend(vec![soft; rows]);
    let size = 1e-4;
    let mesh =
        Mesh::from_nodes(8, material, periodic, |i, j| (size * i as f64, size * j as f64)).expect("valid");
    let mut body = Body::new(mesh, Strain::Small);
    body.hold_top();
    body
}

fn stable(body: &Body) -> f64 {
    stability::stable_step_s(stability::highest_frequency_rad_s(body, &[]))
}

/// A column of two layers, free below and held above: M1 k1 tan(k1 L1) = M2 k2 cot(k2 L2), k = omega / c;
/// mass damping c makes it sqrt(omega^2 - c^2/4).
#[test]
fn layered_column_swings_at_its_frequency() {
    let (stiff, soft) = (Material::elastic(28.3e6, 0.33, 750.0), Material::elastic(0.3e6, 0.33, 750.0));
    let (rows, length) = (8, 8.0 * 1e-4);
    let (c1, c2) = (stiff.wave_speed_m_s(), soft.wave_speed_m_s());
    let off = |omega: f64| {
        stiff.fast_p_modulus_pa() / c1 * (omega * length / c1).tan()
            - soft.fast_p_modulus_pa() / c2 / (omega * length / c2).tan()
    };
    let (mut low, mut high) = (1.0, 0.5 * std::f64::consts::PI * c2 / length);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if off(middle) < 0.0 { low = middle } else { high = middle }
    }
    let body = layered(stiff, soft, rows, true);
    let dt = stable(&body);
    let every = stability::longer_steps(&body, dt, f64::MAX)[0].1;
    let damping = stability::DAMPING_IN_A_LONGER_STEP / (every as f64 * dt);
    let exact = 2.0 * std::f64::consts::PI / (low * low - 0.25 * damping * damping).sqrt();
    let period = |longer: bool| {
        let mut body = body.clone();
        if longer {
            let layers = stability::longer_steps(&body, dt, f64::MAX);
            assert!(layers[0].0 == rows && layers[0].1 >= 4, "{layers:?}");
            body.move_in_longer_steps(&layers);
        }
        let join = (low * length / c1).cos() / (low * length / c2).sin();
        for j in 0..2 * rows {
            let y = 1e-4 * j as f64;
            let shape =
                if j <= rows { (low * y / c1).cos() } else { join * (low * (2.0 * length - y) / c2).sin() };
            (0..=8).for_each(|i| body.set_velocity(body.node(i, j), 0.0, 1e-3 * shape));
        }
        let (mut zeros, mut before, mut t) = (Vec::new(), 1.0, 0.0);
        while zeros.len() < 3 {
            body.advance(dt, damping, 1, &mut nothing);
            let now = body.position_m(0).1;
            if before * now <= 0.0 {
                zeros.push(t + dt * before / (before - now));
            }
            (before, t) = (now, t + dt);
            assert!(t < 10.0 * exact, "no oscillation");
        }
        zeros[2] - zeros[0]
    };
    let (one, longer) = (period(false), period(true));
    for (name, period) in [("one step", one), ("longer steps", longer)] {
        println!(
            "{name}: period {period:e} s, exact {exact:e} s, off by {:.4} %",
            100.0 * (period / exact - 1.0)
        );
        assert!((period / exact - 1.0).abs() < 0.01);
    }
    assert!((longer / one - 1.0).abs() < 0.003, "{one:e} {longer:e}");
}

/// Where longer steps are allowed, mass damping takes more than the impulses feed: of a shake nothing is left, in a column and a block,
/// for soft layers of any contrast. (With no damping they would feed a fast motion whose half period is the longer step.)
#[test]
fn longer_steps_feed_no_motion() {
    for periodic in [true, false] {
        for soft_pa in [1.5e6, 0.3e6, 0.15e6, 0.02e6] {
            let (stiff, soft) =
                (Material::elastic(28.3e6, 0.33, 750.0), Material::elastic(soft_pa, 0.33, 750.0));
            let left = |share: f64| {
                let mut body = layered(stiff, soft, 8, periodic);
                for k in 0..9 * 16 {
                    let n = body.node(k % 9, k / 9);
                    let (x, y) = body.position_m(n);
                    let across = if periodic { 0.0 } else { 1e-2 * (5e4 * x).sin() };
                    body.set_velocity(n, across, 1e-2 * (3e4 * y).cos());
                }
                let dt = stable(&body);
                let layers = stability::longer_steps(&body, dt, f64::MAX);
                assert_eq!(layers.len(), 1);
                body.move_in_longer_steps(&layers);
                let damping = share / (layers[0].1 as f64 * dt);
                let start = body.energy().kinetic;
                body.advance(dt, damping, 5000 * layers[0].1, &mut nothing);
                let e = body.energy();
                ((e.kinetic + e.elastic + e.hourglass) / start, layers)
            };
            let shares = [0.0, 0.25, 1.0];
            let all: Vec<f64> =
                shares.iter().map(|s| left(s * stability::DAMPING_IN_A_LONGER_STEP).0).collect();
            println!(
                "periodic {periodic}, {soft_pa} Pa, {:?}: left {all:?} at shares {shares:?} of the least damping",
                left(0.5).1
            );
            assert!(all[1] < 1e-6 && all[2] < 1e-6, "{all:?}");
        }
    }
}

/// The default beside one step for all layers and no mass added: mu' within 0.002, in fewer steps.
#[test]
fn friction_is_that_of_one_step() {
    for (um, mu0, mass_damping_per_s) in [(0.3, 0.5, 1e6), (1.0, 0.5, 1e6), (2.0, 0.5, 1e6), (2.0, 0.5, 1e5)]
    {
        let case = RidgeCase { elements: 300, mu0, mass_damping_per_s, ..RidgeCase::paper() };
        let case = case.with_amplitude_pp_m(um * 1e-6);
        let longer = RunSettings::default();
        let one = RunSettings { one_step: true, added_mass: 0.0, ..longer };
        let (a, b) = (run(&case, &one).expect("runs"), run(&case, &longer).expect("runs"));
        println!(
            "{um} um, mu_0 {mu0}: mu' {:.5} and {:.5}, {} and {} steps",
            a.mu_relative, b.mu_relative, a.steps, b.steps
        );
        assert!((a.mu_relative - b.mu_relative).abs() < 0.002, "{} {}", a.mu_relative, b.mu_relative);
        assert!(b.steps <= a.steps && b.steady);
    }
}
