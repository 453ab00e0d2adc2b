//! The loaded ridge: what the paper states in words or numbers, and convergence. Coarse meshes keep it quick;
//! `docs/ridge.md` gives the same figures on fine ones.

use muprime_models::prediction::Regime;
use muprime_models::ridge::{FrictionRule, RidgeCase, RidgeError, RidgeRun, RunSettings, Strain, run};

const QUICK: usize = 300;

fn at(change: impl FnOnce(RidgeCase) -> RidgeCase) -> RidgeRun {
    let case = change(RidgeCase { elements: QUICK, ..RidgeCase::paper() });
    let result = run(&case, &RunSettings::default()).expect("runs");
    assert!(result.steady, "not steady: {case:?}");
    result
}

/// Eq. 4: the mean reaction force equals the applied load at every amplitude.
#[test]
fn mean_reaction_equals_the_load() {
    for um in [0.1, 0.5, 1.0, 2.0, 5.0] {
        let result = at(|c| c.with_amplitude_pp_m(um * 1e-6));
        let ratio = result.mean_reaction_force_n / 0.25;
        println!("{um} um: mean reaction / load = {ratio:.4}");
        assert!((ratio - 1.0).abs() < 0.02, "{um} um: {ratio}");
    }
}

/// Section 5.1: at rest the phase shift rises from near zero to a plateau near 90 degrees, for the stiff dry
/// skin earlier than for the moist one.
#[test]
fn phase_shift_rises_to_its_plateau() {
    let phase = |young_modulus_pa: f64, um: f64| {
        let result =
            at(|c| RidgeCase { speed_m_s: 0.0, young_modulus_pa, ..c }.with_amplitude_pp_m(um * 1e-6));
        let phase = result.phase_shift_deg.expect("it vibrates");
        println!("{:.1} MPa, {um} um: {phase:.1} deg", young_modulus_pa / 1e6);
        if phase > 300.0 { phase - 360.0 } else { phase }
    };
    // Moist: transition within 0.8 to 1.3 um.
    assert!(phase(28.3e6, 0.2).abs() < 15.0);
    let (early, late) = (phase(28.3e6, 0.7), phase(28.3e6, 1.3));
    assert!(early < 20.0 && late > 40.0, "{early} {late}");
    // Dry: within 0.4 to 0.8 um.
    assert!(phase(202.4e6, 0.2).abs() < 15.0);
    let (early, late) = (phase(202.4e6, 0.4), phase(202.4e6, 0.8));
    assert!(early < 20.0 && late > 40.0, "{early} {late}");
    assert!((75.0..105.0).contains(&phase(28.3e6, 2.5)));
    assert!((95.0..125.0).contains(&phase(202.4e6, 2.5)));
}

/// Section 5: mu' falls with w and f, rises with U, and hardly depends on the modulus and the force at
/// large amplitude.
#[test]
fn friction_follows_the_papers_trends() {
    let mu = |change: &dyn Fn(RidgeCase) -> RidgeCase| at(change).mu_relative;
    let ladder: Vec<f64> = [0.5, 1.0, 2.0, 4.0].map(|um| mu(&|c| c.with_amplitude_pp_m(um * 1e-6))).into();
    println!("mu' at 0.5, 1, 2, 4 um: {ladder:.3?}");
    assert!(ladder.windows(2).all(|p| p[1] < p[0] - 0.05));
    let middle = ladder[2];
    assert!(mu(&|c| RidgeCase { frequency_hz: 50e3, ..c }) < 0.8 * middle);
    assert!(mu(&|c| RidgeCase { speed_m_s: 0.05, ..c }) > 1.4 * middle);
    assert!(mu(&|c| RidgeCase { mu0: 1.0, ..c }) < 0.8 * middle);
    let large = |change: &dyn Fn(RidgeCase) -> RidgeCase| mu(&|c| change(c.with_amplitude_pp_m(4e-6)));
    for (a, b) in [
        (
            large(&|c| RidgeCase { young_modulus_pa: 20e6, ..c }),
            large(&|c| RidgeCase { young_modulus_pa: 50e6, ..c }),
        ),
        (large(&|c| c.with_normal_force_n(0.1)), large(&|c| c.with_normal_force_n(1.0))),
    ] {
        println!("at 4 um: {a:.3} and {b:.3}");
        assert!((a - b).abs() < 0.08);
    }
    let still = at(|c| c.with_amplitude_pp_m(0.0));
    assert!((still.mu_relative - 1.0).abs() < 0.01 && still.regime == Regime::FullContact);
}

/// Speed and friction matter only through U/mu_0, as far as the surrogate relies on it.
#[test]
fn speed_and_friction_enter_as_their_ratio() {
    let mu = |speed_m_s: f64, mu0: f64| at(|c| RidgeCase { speed_m_s, mu0, ..c }).mu_relative;
    let (low, base, high) = (mu(0.004, 0.1), mu(0.02, 0.5), mu(0.08, 2.0));
    println!("U/mu_0 = 40 mm/s: mu' {low:.4} at mu_0 0.1, {base:.4} at 0.5, {high:.4} at 2");
    assert!((low - base).abs() < 0.005 && (high - base).abs() < 0.01);
}

/// mu' converges with the mesh faster than in first order of the element's size (until the switching of
/// single contact nodes, 0.003), and hardly moves with the step. Stiff skin, where the contact is smallest.
#[test]
fn friction_converges_with_mesh_and_step() {
    let stiff = |c: RidgeCase| RidgeCase { young_modulus_pa: 200e6, ..c }.with_amplitude_pp_m(1e-6);
    let mu = |elements: usize| at(|c| RidgeCase { elements, ..stiff(c) }).mu_relative;
    let (coarse, middle, fine) = (mu(200), mu(600), mu(1500));
    println!("mu' with 200, 600, 1500 elements: {coarse:.4} {middle:.4} {fine:.4}");
    assert!((coarse - fine).abs() < 0.05 && (middle - fine).abs() < 0.4 * (coarse - fine).abs());
    let case = RidgeCase { elements: QUICK, ..RidgeCase::paper() };
    let own = run(&case, &RunSettings::default()).expect("runs");
    let half = RunSettings { step_s: Some(0.5 * own.step_s), ..RunSettings::default() };
    let halved = run(&case, &half).expect("runs").mu_relative;
    println!("mu' with the stable step {:.5}, with half of it {halved:.5}", own.mu_relative);
    assert!((own.mu_relative - halved).abs() < 0.003);
}

/// What should not matter does not: strain measure, friction rule, a stiffer penalty.
#[test]
fn choices_that_should_not_matter() {
    let base = at(|c| c).mu_relative;
    for (what, change) in [
        ("small strain", (|c| RidgeCase { strain: Strain::Small, ..c }) as fn(RidgeCase) -> RidgeCase),
        ("local friction", |c| RidgeCase { friction: FrictionRule::Local, ..c }),
        ("penalty 10 E_sc", |c| RidgeCase { penalty_ratio: 10.0, ..c }),
    ] {
        let mu = at(change).mu_relative;
        println!("{what}: mu' {mu:.4}, base {base:.4}");
        assert!((mu - base).abs() < 0.03, "{what}: {mu} instead of {base}");
    }
}

/// The energy that the plate gives is what damping and viscosity take; nothing comes from nowhere.
#[test]
fn energy_is_balanced() {
    let result = at(|c| c);
    let e = result.energy.expect("counted");
    println!("{e:?}");
    let given = e.plate_work + e.load_work;
    assert!(given > 0.0 && e.inner_loss >= 0.0 && e.inner_loss < 0.2 * given);
    assert!((given - e.damping_loss - e.inner_loss - e.stored).abs() < 0.02 * given);
    assert!(result.memory_bytes < 10_000_000);
}

/// Same input, same bits, whatever ran before.
#[test]
fn results_repeat_bit_by_bit() {
    assert_eq!(at(|c| c), at(|c| c));
}

/// Nonsense is refused with a reason, and an unstable step with the stable one.
#[test]
fn nonsense_is_refused() {
    let good = RidgeCase { elements: QUICK, ..RidgeCase::paper() };
    for bad in [
        good.with_amplitude_pp_m(f64::NAN),
        good.with_amplitude_pp_m(-1e-6),
        RidgeCase { frequency_hz: 0.0, ..good },
        RidgeCase { mu0: -0.5, ..good },
        RidgeCase { normal_force_n: 0.0, ..good },
        RidgeCase { young_modulus_pa: f64::INFINITY, ..good },
        RidgeCase { poisson_ratio: 0.5, ..good },
        RidgeCase { elements: 3, ..good },
        RidgeCase { mass_damping_per_s: -1.0, ..good },
    ] {
        assert!(matches!(run(&bad, &RunSettings::default()), Err(RidgeError::Input { .. })), "{bad:?}");
    }
    let wild = RunSettings { step_s: Some(1e-6), ..RunSettings::default() };
    assert!(matches!(run(&good, &wild), Err(RidgeError::UnstableStep { .. })));
}
