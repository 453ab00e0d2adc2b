//! A cause that goes with temperature, and that no effect of the library is, shows as such in the open set.
use models::{Condition, Direction, Pass, PeakToPeak, RigFile};
use muprime_diagnosis::regression::kernel::Coordinates;
use muprime_diagnosis::verdict::Verdict;
use muprime_diagnosis::{Options, Table, diagnose};
use std::f64::consts::PI;

const RIG: &str = "[finger]\nnormal_stiffness_n_per_m = 3.9e6\nlateral_stiffness_n_per_m = 1.5e6\n\
                   stiffness_relative_sd = 0.05\n[noise]\npass_relative_sd = 0.01\nforce_sd_n = 0.0005\n";

/// Passes in a room whose temperature goes up and down (or drifts with time), under friction that depends on
/// it in a way that no effect has: highest in the middle of the range.
fn passes(temperature: fn(f64, f64) -> f64) -> Vec<Pass> {
    let mut state = 11u64;
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let design = effects::Design {
        duration_s: 600.0,
        reference_load_n: 0.3,
        reference_speed_m_s: 0.03,
        reference_frequency_hz: 27_500.0,
        reference_temperature_c: 20.0,
        stroke_m: 0.0,
        largest_amplitude_m: 3e-6,
    };
    let baseline =
        effects::Baseline { mu0: 0.5, normal_stiffness_n_per_m: 3.9e6, lateral_stiffness_n_per_m: 1.5e6 };
    (0..160u64)
        .map(|i| {
            let mut pick = |list: &[f64]| list[(uniform() * list.len() as f64) as usize];
            let mut condition = Condition {
                amplitude: PeakToPeak::from_metres(if i % 6 == 0 {
                    0.0
                } else {
                    pick(&[0.5e-6, 1e-6, 2e-6, 3e-6])
                }),
                speed_m_s: pick(&[0.01, 0.02, 0.04, 0.08]),
                normal_force_n: pick(&[0.1, 0.2, 0.4, 0.7]),
                direction: if pick(&[1.0, -1.0]) > 0.0 { Direction::Forward } else { Direction::Backward },
                time_s: 4.0 * i as f64,
                ..Condition::paper()
            };
            let warm = temperature(i as f64 / 160.0, uniform());
            condition.temperature_c = Some(20.0 + warm);
            let factor = 1.0 + 0.25 * (-0.5 * ((warm - 3.0) / 1.2).powi(2)).exp();
            let noise = 0.01 * ((0..12).map(|_| uniform()).sum::<f64>() - 6.0);
            let force = effects::lateral_force(&baseline, &[], &condition, &design) * factor * (1.0 + noise);
            Pass::at(i, &condition, Some(force))
        })
        .collect()
}

#[test]
fn a_cause_that_goes_with_temperature_is_predicted_by_temperature() {
    let passes = passes(|_, any| 6.0 * any);
    let table = Table::measured(&passes).unwrap();
    assert!(Coordinates::of(&table).climate().next().is_some());
    let rig = RigFile::parse(RIG).unwrap();
    let options = Options { pairs: false, ..Options::default() };
    let found = diagnose(&table, &rig, &options, String::new());
    let gap = &found.report.gap;
    assert_eq!(found.report.verdict, Verdict::Unknown, "{}", found.report.text);
    // On held-out passes, whose neighbours in time had other temperatures.
    let closed = gap.shrinkage.unwrap();
    assert!(closed > 0.5, "{closed:.2}: {gap:?}");

    // A condition without a temperature is none that the map can predict: it does not get the mean one.
    let mut wanted = passes[..20].to_vec();
    let conditions = |rows: &[Pass]| Table::conditions(rows, &table.origin(&passes)).unwrap();
    assert_eq!(found.predict(&conditions(&wanted)).unwrap().len(), 20);
    wanted[7].temperature_c = None;
    let why = found.predict(&conditions(&wanted)).unwrap_err();
    assert_eq!((why.point, why.column), (wanted[7].point, "temperature_c"), "{why}");
    let reduced: Vec<Pass> = passes.iter().cloned().map(|p| Pass { temperature_c: None, ..p }).collect();
    let blind = diagnose(&Table::measured(&reduced).unwrap(), &rig, &options, String::new());
    assert!(blind.predict(&conditions(&wanted)).is_ok(), "a map without temperature asks for none");
}

/// A room that warms with the hour says nothing that time does not say.
#[test]
fn temperature_that_goes_with_time_is_time() {
    let table = Table::measured(&passes(|time, any| 6.0 * time * (2.0 - time) + 0.05 * any)).unwrap();
    assert!(Coordinates::of(&table).climate().next().is_none());
    let swinging = Table::measured(&passes(|time, _| 3.0 * (8.0 * PI * time).sin())).unwrap();
    assert!(Coordinates::of(&swinging).climate().next().is_some());
}
