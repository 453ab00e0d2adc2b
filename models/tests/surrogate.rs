//! The shipped table against the finite element model, and against what it says of itself.

use muprime_models::prediction::{FrictionModel, Validity};
use muprime_models::ridge::run;
use muprime_models::surrogate::{Surrogate, SurrogateGrid, TableError};
use muprime_models::{Condition, PeakToPeak};

#[test]
fn the_shipped_table_belongs_to_this_model() {
    let surrogate = Surrogate::shipped().expect("reads");
    assert_eq!(surrogate.grid, SurrogateGrid::SHIPPED);
    assert_eq!(
        surrogate.inputs_hash,
        SurrogateGrid::SHIPPED.inputs_hash(),
        "recompute it: muprime model table --surrogate"
    );
    println!("{:?}", surrogate.error);
    assert!(surrogate.error.mu_rms < 0.03 && surrogate.error.cases >= 100);
}

#[test]
fn a_few_held_out_cases_agree_with_the_model_itself() {
    let surrogate = Surrogate::shipped().expect("reads");
    for point in SurrogateGrid::SHIPPED.held_out(24).into_iter().filter(|p| !p.at_rest) {
        let c = point.case;
        let fe = run(&c, &SurrogateGrid::settings()).expect("runs").mu_relative;
        let s = surrogate.at(
            c.amplitude,
            c.frequency_hz,
            c.speed_m_s / c.mu0,
            c.normal_force_n,
            c.young_modulus_pa,
        );
        assert!(
            (s.mu_relative - fe).abs() < 1.05 * surrogate.error.mu_max + 0.002,
            "{} and {fe}",
            s.mu_relative
        );
    }
}

#[test]
fn predictions_are_bounded_and_say_where_they_hold() {
    let surrogate = Surrogate::shipped().expect("reads");
    let at = |um: f64, f: f64, u: f64| {
        let amplitude = PeakToPeak::from_metres(um * 1e-6);
        surrogate
            .predict(&Condition { amplitude, frequency_hz: f, speed_m_s: u, ..Condition::paper() })
            .expect("inside")
    };
    assert_eq!(at(0.0, 27.5e3, 0.02).mu_relative, 1.0);
    for um in [0.05, 0.3, 1.0, 3.0, 5.0] {
        for u in [0.002, 0.02, 0.2] {
            let p = at(um, 27.5e3, u);
            assert!((0.0..=1.0).contains(&p.mu_relative) && p.mu_relative_sd > 0.0);
            assert_eq!(p.validity, Validity::Inside);
        }
    }
    assert_eq!(at(20.0, 27.5e3, 0.02).validity, Validity::Extrapolated);
    assert_eq!(at(2.0, 5e3, 0.02).validity, Validity::Extrapolated);
    assert!(surrogate.predict(&Condition { mu0: f64::NAN, ..Condition::paper() }).is_err());
}

#[test]
fn a_damaged_table_is_refused_with_its_line() {
    for (text, line) in
        [("", 1), ("muprime ridge table 9\n", 1), ("muprime ridge table 2\ninputs x\naxis y 1 2 3\n", 3)]
    {
        let why = Surrogate::from_text(text).expect_err("refused");
        assert!(matches!(why, TableError::Line { line: at, .. } if at == line), "{why}");
    }
}
