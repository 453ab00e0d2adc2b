//! Convergence of Psi* itself with the time step, and what a softer spring along the plate does to it, on a
//! part of Fig. 12: 200 elements, its frequencies, frictions and speeds at two of four amplitudes. The mesh's
//! convergence takes minutes: `muprime model reproduce fig12 --elements N` prints it (docs/ridge.md).

use muprime_models::Reading;
use muprime_models::psi_fit::{PsiFit, fit};
use muprime_models::ridge::study::{Panel, fig_9};
use muprime_models::ridge::{RidgeCase, RunSettings, run};
use rayon::prelude::*;

/// Amplitudes in um: of the caption of Fig. 12, and one between. Two of the four are taken by default.
const ALL_UM: [f64; 4] = [1.0, 3.0, 2.0, 5.0];

/// Psi* of the part of Fig. 12 under a reading, at each of some shares of the stable step.
fn psi_star<const N: usize>(base: RidgeCase, reading: Reading, shares: [f64; N]) -> [PsiFit; N] {
    let drawn = |panel: Panel| matches!(panel, Panel::Frequency | Panel::Mu0 | Panel::Speed);
    let count = if std::env::var_os("MUPRIME_LONG").is_some() { ALL_UM.len() } else { 2 };
    let taken = |w_m: f64| ALL_UM[..count].iter().any(|um| (w_m - um * 1e-6).abs() < 1e-12);
    let points: Vec<_> = fig_9(RidgeCase { elements: 200, ..base })
        .into_iter()
        .filter(|p| drawn(p.panel) && taken(p.case.amplitude.metres()))
        // The base curve is in every panel: it counts once.
        .filter(|p| p.panel == Panel::Frequency || !is_base(p.panel, p.value))
        .collect();
    let solved: Vec<[(usize, f64, f64); N]> = points
        .par_iter()
        .map(|p| {
            let w_m = p.case.amplitude.metres();
            let case = p.case.at_w(reading, w_m);
            let own = run(&case, &RunSettings::default()).expect("runs");
            let place = Panel::ALL.iter().position(|panel| *panel == p.panel).unwrap_or(0);
            let curve = 4 * place + p.panel.values().iter().position(|v| *v == p.value).unwrap_or(0);
            let psi = case.speed_m_s / (w_m * case.frequency_hz * case.mu0 * (1.0 + case.poisson_ratio));
            shares.map(|share| {
                let settings = RunSettings { step_s: Some(share * own.step_s), ..RunSettings::default() };
                let mu = match share {
                    1.0 => own.mu_relative,
                    _ => run(&case, &settings).expect("runs").mu_relative,
                };
                (curve, psi, mu)
            })
        })
        .collect();
    std::array::from_fn(|k| fit(&solved.iter().map(|at| at[k]).collect::<Vec<_>>()).expect("a Psi*"))
}

fn is_base(panel: Panel, value: f64) -> bool {
    let base = RidgeCase::paper();
    panel.set(base, value) == base
}

fn show(what: &str, found: &PsiFit) {
    println!(
        "{what}: Psi* {:.4} +- {:.3}, rmse {:.4}, {} points",
        found.psi_star, found.psi_star_sd, found.rmse, found.points
    );
}

#[test]
fn psi_star_does_not_depend_on_the_step() {
    for reading in Reading::ALL {
        let [own, half] = psi_star(RidgeCase::paper(), reading, [1.0, 0.5]);
        show(&format!("{}, the stable step", reading.name()), &own);
        show(&format!("{}, half of it", reading.name()), &half);
        // A hundredth of the paper's own uncertainty of 9 %.
        assert!((half.psi_star / own.psi_star - 1.0).abs() < 1e-3, "{own:?} {half:?}");
    }
}

/// The rival of the second reading: a contact softer along the plate also doubles Psi*, with w as the captions have it.
#[test]
fn a_contact_softer_along_the_plate_moves_psi_star_as_a_reading_does() {
    let soft = RidgeCase { tangential_penalty_ratio: 0.03, ..RidgeCase::paper() };
    let [stiff, soft] = [RidgeCase::paper(), soft].map(|base| psi_star(base, Reading::PeakToPeak, [1.0])[0]);
    show("peak-to-peak, one spring both ways", &stiff);
    show("peak-to-peak, 0.03 of it along the plate", &soft);
    assert!((1.4..2.2).contains(&(soft.psi_star / stiff.psi_star)), "{soft:?} {stiff:?}");
    assert!(RidgeCase { tangential_penalty_ratio: 0.0, ..RidgeCase::paper() }.check().is_err());
}
