//! Each defect shows in a table if it says so, grows from nothing, and leaves forces bounded.

use muprime_sim::defects::{ALL, Defect, Defects, Surroundings, Values};
use muprime_sim::finger::{FingerConfig, VirtualFinger};
use muprime_sim::noise::Noise;
use muprime_sim::world::{Point, steady_forces};

/// Points over the bundled sweep's operating space, both directions, along the stroke and the run.
fn points(n: usize) -> Vec<Point> {
    let mut noise = Noise::new(5, "points");
    (0..n)
        .map(|i| {
            let still = i % 5 == 0;
            let force = noise.log_between(0.1, 1.0);
            Point {
                at: Surroundings {
                    time_s: 3.0 * i as f64,
                    contact_time_s: 3.0 * i as f64,
                    position_m: noise.between(-0.02, 0.02),
                    direction: if i % 2 == 0 { 1.0 } else { -1.0 },
                    frequency_hz: if i % 3 == 0 { 40e3 } else { 27.5e3 },
                    normal_force_n: force,
                    ambient_pressure_pa: if i % 4 == 0 { 2e4 } else { 101_325.0 },
                    temperature_c: 22.0 + 6.0 * (1.0 - (-3.0 * i as f64 / 100.0).exp()),
                },
                known_pp_m: if still { 0.0 } else { noise.log_between(0.5e-6, 5e-6) },
                speed_m_s: noise.log_between(5e-3, 0.2),
            }
        })
        .collect()
}

fn finger() -> VirtualFinger {
    VirtualFinger::new(&FingerConfig { stiffness_relative_sd: 0.0, ..FingerConfig::default() }, 0)
}

/// Rms change of the measured friction over mu0 F, against the ideal world.
fn change(defects: &Defects) -> f64 {
    let finger = finger();
    let points = points(60);
    let square: f64 = points
        .iter()
        .map(|point| {
            let ideal = steady_forces(&finger, &Defects::none(), point);
            let got = steady_forces(&finger, defects, point);
            assert!(
                got.lateral_n.is_finite() && got.lateral_n.abs() < 10.0 * point.at.normal_force_n,
                "{defects:?}"
            );
            let normal = 0.5 * (got.normal_n - ideal.normal_n);
            ((got.lateral_n - ideal.lateral_n).powi(2) + normal * normal)
                / (0.5 * point.at.normal_force_n).powi(2)
        })
        .sum();
    (square / points.len() as f64).sqrt()
}

/// The defect with its size at a share of its range and the other parameters at a share of theirs.
fn sized(kind: &'static muprime_sim::defects::DefectKind, share: f64, shape: f64) -> Defects {
    use muprime_sim::defects::Draw;
    let mut values = Values::default();
    for (i, (value, p)) in values.iter_mut().zip(kind.parameters).enumerate() {
        let share = if i == 0 { share } else { shape };
        let log = |low: f64, high: f64| (low.ln() + share * (high.ln() - low.ln())).exp();
        *value = match p.draw {
            Draw::Linear => p.low + share * (p.high - p.low),
            Draw::Log | Draw::Signed => log(p.low, p.high),
            Draw::Factor if i > 0 => 1.0,
            Draw::Factor => 1.0 + log(p.low, p.high),
        };
    }
    Defects { defects: vec![Defect { kind, values }], channels: Vec::new() }
}

#[test]
fn sizes_run_from_under_the_noise_to_far_above_it() {
    for kind in ALL.iter().filter(|kind| kind.in_tables) {
        let [small, middle] = [0.0, 0.5].map(|share| change(&sized(kind, share, 0.5)));
        // Shapes in the middle of their ranges may undo what the size does: two stiffnesses that change alike.
        let large =
            [0.0, 0.5, 1.0].map(|shape| change(&sized(kind, 1.0, shape))).into_iter().fold(0.0, f64::max);
        println!("{:24} {small:.4} {middle:.4} {large:.4}", kind.name);
        assert!(small < 0.025, "{} at its smallest changes friction by {small}", kind.name);
        assert!(large > 0.055, "{} at its largest changes friction by {large}", kind.name);
    }
}

#[test]
fn drawn_parameters_lie_in_their_ranges_and_are_those_of_their_seed() {
    for kind in ALL {
        let one = Defects::sealed(kind.name, 11).unwrap();
        assert_eq!(one, Defects::sealed(kind.name, 11).unwrap());
        assert!(
            kind.parameters.is_empty() || one != Defects::sealed(kind.name, 12).unwrap(),
            "{}",
            kind.name
        );
        assert!(kind.parameters.len() <= 4 && !kind.summary.is_empty());
        assert_eq!(
            ALL.iter().filter(|other| other.name == kind.name).count(),
            1,
            "{} stands twice",
            kind.name
        );
    }
    assert!(ALL.iter().filter(|kind| !kind.in_library).count() >= 5);
}

#[test]
fn every_effect_of_the_contract_has_its_cause_here() {
    for name in "squeeze_film lateral_recovery ridge_inertia normal_damping load_dependent_friction contact_ageing \
                 rate_dependent_friction adhesion moisture_drift multi_asperity subsurface_relaxation stiffness_error \
                 amplitude_miscalibration amplitude_droop amplitude_saturation resonance_detuning mode_shape \
                 force_crosstalk lateral_offset_drift lateral_gain normal_offset plate_tilt sensor_lag \
                 time_misalignment speed_error speed_ripple"
        .split_whitespace()
    {
        assert!(ALL.iter().any(|kind| kind.name == name && kind.in_library), "{name}");
    }
}

#[test]
fn no_text_makes_the_reader_of_defects_files_panic() {
    use proptest::prelude::*;
    let key = prop_oneof![
        Just("[[defect]]\n".to_string()),
        Just("[[channel]]\n".to_string()),
        Just("name = \"squeeze_film\"\n".to_string()),
        Just("seed = 18446744073709551615\n".to_string()),
        Just("parameters = { film_area_m2 = 1e400 }\n".to_string()),
        Just("channel = \"force\"\nfault = \"slow\"\nstrength = -1.0\n".to_string()),
        "[ -~]{0,40}\n",
    ];
    let mut runner = proptest::test_runner::TestRunner::new(ProptestConfig {
        cases: 2000,
        failure_persistence: None,
        ..ProptestConfig::default()
    });
    runner
        .run(&proptest::collection::vec(key, 0..8), |parts| {
            if let Err(error) = Defects::parse(&parts.concat()) {
                prop_assert!(!error.to_string().is_empty());
            }
            Ok(())
        })
        .unwrap();
}
