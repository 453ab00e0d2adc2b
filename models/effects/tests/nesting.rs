//! Every effect nests the baseline: at the zero of its size the prediction is the baseline's, bit for bit.
use models::{Condition, Direction, PeakToPeak};
use muprime_effects::{Active, Baseline, Design, Parameter, known, library};

fn passes() -> Vec<Condition> {
    let mut list = Vec::new();
    for (i, w) in [0.0, 0.1e-6, 0.8e-6, 2e-6, 5e-6].into_iter().enumerate() {
        for (j, u) in [2e-3, 0.02, 0.2].into_iter().enumerate() {
            for f in [0.15, 0.8] {
                for direction in [Direction::Forward, Direction::Backward] {
                    list.push(Condition {
                        time_s: 37.0 * i as f64,
                        run_time_s: Some(11.0 * j as f64),
                        amplitude: PeakToPeak::from_metres(w),
                        frequency_hz: if j == 1 { 25_000.0 } else { 41_000.0 },
                        speed_m_s: u,
                        direction,
                        position_m: 0.003 * (i + j) as f64,
                        normal_force_n: f,
                        ambient_pressure_pa: Some(50_000.0),
                        temperature_c: Some(20.0 + i as f64),
                        mu0: 0.6,
                        relative_humidity_pct: Some(30.0 + 10.0 * i as f64),
                    });
                }
            }
        }
    }
    list
}

/// Signed mean lateral force without any effect, in closed form.
fn alone(baseline: &Baseline, pass: &Condition) -> f64 {
    pass.direction.sign() * muprime_effects::contact::mean_friction(&baseline.contact(pass, &DESIGN))
}

const DESIGN: Design = Design {
    duration_s: 200.0,
    reference_load_n: 0.35,
    reference_speed_m_s: 0.02,
    reference_frequency_hz: 35_000.0,
    reference_temperature_c: 20.0,
    stroke_m: 0.03,
    largest_amplitude_m: 5e-6,
};

#[test]
fn zero_is_the_baseline() {
    let baseline = Baseline { mu0: 0.6, normal_stiffness_n_per_m: 2e6, lateral_stiffness_n_per_m: 0.8e6 };
    for effect in known() {
        for (law, form) in effect.laws.iter().enumerate() {
            assert!(form.parameters[0].zero == Some(0.0), "{}: the size comes first", effect.name);
            for shape in [-2.0, 0.0, 1.7] {
                // What only bends a law may have any value: the size alone takes the effect away.
                let value = |p: &Parameter| p.zero.filter(|_| !p.bends).unwrap_or_else(|| p.value(shape));
                let theta: Vec<f64> = form.parameters.iter().map(value).collect();
                for pass in passes() {
                    let with = muprime_effects::lateral_force(
                        &baseline,
                        &[Active { effect, law, theta: &theta }],
                        &pass,
                        &DESIGN,
                    );
                    let without = alone(&baseline, &pass);
                    assert!(
                        with.to_bits() == without.to_bits(),
                        "{} ({}): {with} is not {without} at {pass:?}",
                        effect.name,
                        form.name
                    );
                }
            }
        }
    }
}

#[test]
fn small_sizes_are_continuous_and_all_predictions_finite() {
    let baseline = Baseline { mu0: 0.6, normal_stiffness_n_per_m: 2e6, lateral_stiffness_n_per_m: 0.8e6 };
    for effect in known() {
        let additive = effect.name == "lateral_offset_drift";
        for (law, form) in effect.laws.iter().enumerate() {
            for size in [1e-6, 0.1, 1.0, 4.0, 8.0] {
                let theta: Vec<f64> = form
                    .parameters
                    .iter()
                    .enumerate()
                    // Offset and drift add up: both are sizes, and both must vanish.
                    .map(|(i, p)| p.value(if i == 0 || (size < 1e-3 && additive) { size } else { 0.3 }))
                    .collect();
                for pass in passes() {
                    let active = [Active { effect, law, theta: &theta }];
                    let with = muprime_effects::lateral_force(&baseline, &active, &pass, &DESIGN);
                    assert!(with.is_finite(), "{} ({}) at {size}: {pass:?}", effect.name, form.name);
                    if size == 1e-6 {
                        let without = alone(&baseline, &pass);
                        assert!(
                            (with - without).abs() < 1.5e-2 * without.abs() + 1e-6,
                            "{} ({}): {with} {without} {pass:?}",
                            effect.name,
                            form.name
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn every_name_of_the_contract_and_each_added_one_is_there_once() {
    let contract = "squeeze_film lateral_recovery ridge_inertia normal_damping load_dependent_friction \
        contact_ageing rate_dependent_friction adhesion moisture_drift multi_asperity subsurface_relaxation \
        stiffness_error amplitude_miscalibration amplitude_droop amplitude_saturation resonance_detuning \
        mode_shape force_crosstalk lateral_offset_drift lateral_gain normal_offset plate_tilt sensor_lag \
        time_misalignment speed_error speed_ripple";
    // The contract lets further effects be added.
    let added = ["normal_gain"];
    let mut wanted: Vec<&str> = contract.split_whitespace().chain(added).collect();
    let mut names: Vec<&str> = library().iter().map(|e| e.name).collect();
    wanted.sort_unstable();
    names.sort_unstable();
    assert_eq!(wanted, names);
}

/// A coordinate within its bounds gives a value within its own, and comes back from it.
#[test]
fn bounds_of_coordinates_are_bounds_of_values() {
    for effect in known() {
        for parameter in effect.laws.iter().flat_map(|law| law.parameters) {
            let (low, high) = parameter.coordinate_bounds();
            assert!(low < high, "{} {}", effect.name, parameter.name);
            for u in [low, 0.5 * (low + high), high] {
                let value = parameter.value(u);
                let back = parameter.coordinate(value);
                assert!((back - u).abs() < 1e-9, "{} {}: {u} is {back}", effect.name, parameter.name);
            }
        }
    }
}

/// At two deviations of its size, its shapes in the middle, every law departs from the baseline somewhere by
/// more than a sweep's error: a law that cannot is no hypothesis. Lags alone leave steady passes as they are.
#[test]
fn every_law_departs_from_the_baseline() {
    let baseline = Baseline { mu0: 0.6, normal_stiffness_n_per_m: 2e6, lateral_stiffness_n_per_m: 0.8e6 };
    let mut idle = Vec::new();
    for effect in known() {
        for (law, form) in effect.laws.iter().enumerate() {
            let middle =
                |(i, p): (usize, &muprime_effects::Parameter)| p.value(if i == 0 { 2.0 } else { 0.0 });
            let theta: Vec<f64> = form.parameters.iter().enumerate().map(middle).collect();
            let active = [Active { effect, law, theta: &theta }];
            let change = |pass: &Condition| {
                let without = alone(&baseline, pass);
                (muprime_effects::lateral_force(&baseline, &active, pass, &DESIGN) / without - 1.0).abs()
            };
            let most = passes().iter().map(change).fold(0.0, f64::max);
            println!("{:26} {:44} {most:.1e}", effect.name, form.name);
            if most < 1e-2 && !["sensor_lag", "time_misalignment"].contains(&effect.name) {
                idle.push(format!("{} ({})", effect.name, form.name));
            }
        }
    }
    assert!(idle.is_empty(), "as the baseline: {idle:?}");
}
