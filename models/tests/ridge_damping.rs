//! Stiffness-proportional damping against closed forms, and two states of one lightly damped case. Each test prints what it judges.

#[path = "ridge/block.rs"]
mod block;

use block::block;
use muprime_models::ridge::{Body, Material, RidgeCase, RidgeError, RunSettings, Strain, run, stability};
use std::f64::consts::PI;

const SKIN: Material = Material::elastic(28.3e6, 0.33, 750.0);
const LENGTH_M: f64 = 1e-3;
const ROWS: usize = 24;

/// A confined column, held at its top, with damping `beta_s`, moving in its lowest mode.
fn column(beta_s: f64, strain: Strain) -> Body {
    let mesh = block([1e-4, LENGTH_M], [8, ROWS], SKIN, true).expect("valid");
    let mut body = Body::new(mesh, strain);
    body.scale_bulk_viscosity(0.0);
    body.hold_top();
    body.damp_stiffness(beta_s);
    for j in 0..ROWS {
        for i in 0..=8 {
            let shape = (0.5 * PI * j as f64 / ROWS as f64).cos();
            body.set_velocity(body.node(i, j), 0.0, 1e-3 * shape);
        }
    }
    body
}

/// A mode of frequency omega has the damping ratio beta omega / 2: its energy falls as exp(-beta omega^2 t).
#[test]
fn a_column_loses_energy_at_the_modes_rate() {
    let omega = 0.5 * PI * SKIN.wave_speed_m_s() / LENGTH_M;
    for (xi, strain) in [(0.01, Strain::Small), (0.05, Strain::Small), (0.05, Strain::Objective)] {
        let beta = 2.0 * xi / omega;
        let mut body = column(beta, strain);
        let limit = stability::damped_step_s(stability::highest_frequency_rad_s(&body, &[]), beta);
        // Whole periods: the shares of kinetic and stored energy are then alike.
        let period = 2.0 * PI / (omega * (1.0 - xi * xi).sqrt());
        let steps = (period / (0.5 * limit)).ceil() as usize;
        let total = |body: &Body| body.energy().kinetic + body.energy().elastic;
        body.advance(period / steps as f64, 0.0, steps, &mut |_| {});
        let first = total(&body);
        body.advance(period / steps as f64, 0.0, 4 * steps, &mut |_| {});
        let found = (first / total(&body)).ln() / (4.0 * period);
        println!(
            "{strain:?}, ratio {xi}: energy falls at {found:.2} /s, beta omega^2 = {:.2} /s",
            beta * omega * omega
        );
        assert!((found / (beta * omega * omega) - 1.0).abs() < 0.01);
    }
}

/// The stable step is that of 2/omega (sqrt(1 + xi^2) - xi): sound just below it, and run away just above.
#[test]
fn the_damped_step_is_stable_and_sharp() {
    let beta = 1e-7;
    let mut rough = column(beta, Strain::Small);
    let omega = stability::highest_frequency_rad_s(&rough, &[]);
    let limit = stability::damped_step_s(omega, beta) / stability::STEP_SAFETY;
    let undamped = 2.0 / omega;
    for j in 0..ROWS {
        for i in 0..=8 {
            let kick = ((i % 8 * 31 + j * 17) as f64).sin();
            rough.set_velocity(rough.node(i, j), 0.0, 1e-3 * kick);
        }
    }
    let after = |share: f64| {
        let mut body = rough.clone();
        body.advance(share * limit, 0.0, 3000, &mut |_| {});
        body.energy().kinetic
    };
    let (start, below, above) = (rough.energy().kinetic, after(0.95), after(1.15));
    println!(
        "damping divides the step by {:.1}; energy {start:.2e} to {below:.2e} at 0.95 of it, {above:.2e} at 1.15",
        undamped / limit
    );
    assert!(limit < 0.5 * undamped && below < start && (above.is_nan() || above > 1e3 * start));
}

/// A run with stiffness damping balances its energy; with relaxing tissue it is refused.
#[test]
fn a_damped_ridge_runs_and_nonsense_is_refused() {
    let base = RidgeCase { elements: 128, mass_damping_per_s: 1e5, ..RidgeCase::paper() };
    let damped = RidgeCase { stiffness_damping_s: 1e-8, ..base };
    let [plain, damped] = [base, damped].map(|case| run(&case, &RunSettings::default()).expect("runs"));
    let e = damped.energy.expect("counted");
    println!(
        "mu' {:.4}, with 1e-8 s {:.4}; steps {:.2e} and {:.2e} s; {e:?}",
        plain.mu_relative, damped.mu_relative, plain.step_s, damped.step_s
    );
    assert!(damped.step_s < plain.step_s && e.inner_loss > 0.0);
    let given = e.plate_work + e.load_work;
    assert!((given - e.damping_loss - e.inner_loss - e.stored).abs() < 1e-6 * given.abs());
    for bad in [
        RidgeCase { stiffness_damping_s: -1.0, ..base },
        RidgeCase { stiffness_damping_s: 1e-8, retardation_time_s: 1e-6, ..base },
        RidgeCase { tangential_stiffness_pa_m: Some(-1.0), ..base },
    ] {
        assert!(matches!(run(&bad, &RunSettings::default()), Err(RidgeError::Input { .. })));
    }
}

/// One lightly damped case ends in two states: unbroken contact, where it comes from rest, and lost for most
/// of the time, where it comes down from twice the amplitude. With the default damping both starts end alike.
#[test]
fn a_lightly_damped_case_has_two_states() {
    let base = RidgeCase { elements: 200, ..RidgeCase::paper() }.with_amplitude_pp_m(1e-6);
    let both = |case: &RidgeCase| {
        [1.0, 2.0].map(|overshoot| {
            let settings = RunSettings { energy: false, overshoot, ..RunSettings::default() };
            let found = run(case, &settings).expect("runs");
            println!(
                "{:e} /s from {overshoot} times the amplitude: mu' {:.3}, contact {:.2}",
                case.mass_damping_per_s, found.mu_relative, found.contact_fraction
            );
            (found.mu_relative, found.contact_fraction)
        })
    };
    let [closed, lost] = both(&RidgeCase { mass_damping_per_s: 6e3, ..base });
    assert!(closed.0 > 0.95 && closed.1 > 0.999 && lost.0 < 0.3 && lost.1 < 0.5, "{closed:?} {lost:?}");
    let [rest, above] = both(&base);
    assert!((rest.0 - above.0).abs() < 0.01, "{rest:?} {above:?}");
    let wild = RunSettings { overshoot: 0.5, ..RunSettings::default() };
    assert!(matches!(run(&base, &wild), Err(RidgeError::Input { .. })));
}
