//! A part of Fig. 12 that takes a few seconds on a coarse mesh: Psi* of a ridge, for surveys of what moves it.

use super::static_stiffness::{HeldAt, of_case};
use super::study::{Panel, fig_9};
use super::{RidgeCase, RidgeError, RunSettings, run};
use crate::finger::Finger;
use crate::psi_fit::{PsiFit, fit};
use crate::reading::Reading;
use crate::spring_slider;
use rayon::prelude::*;

/// Amplitudes that are taken, in um: of the caption of Fig. 12, and one between.
pub const TAKEN_UM: [f64; 4] = [1.0, 2.0, 3.0, 5.0];

/// One point of the short study.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShortPoint {
    /// Number of its curve.
    pub curve: usize,
    /// What the paper calls w, m.
    pub w_m: f64,
    /// Psi of Eq. 17 at that w.
    pub psi: f64,
    /// The case at the stroke that the reading has.
    pub case: RidgeCase,
}

/// Frequencies, frictions and speeds of Fig. 9 at four amplitudes, the base curve once: 40 points.
pub fn points(base: RidgeCase, reading: Reading) -> Vec<ShortPoint> {
    let drawn = |panel: Panel| matches!(panel, Panel::Frequency | Panel::Mu0 | Panel::Speed);
    let taken = |w_m: f64| TAKEN_UM.iter().any(|um| (w_m - um * 1e-6).abs() < 1e-12);
    fig_9(base)
        .into_iter()
        .filter(|p| drawn(p.panel) && taken(p.case.amplitude.metres()))
        .filter(|p| p.panel == Panel::Frequency || p.panel.set(base, p.value) != base)
        .map(|p| {
            let w_m = p.case.amplitude.metres();
            let case = p.case.at_w(reading, w_m);
            let panel = Panel::ALL.iter().position(|panel| *panel == p.panel).unwrap_or(0);
            let curve = 4 * panel + p.panel.values().iter().position(|v| *v == p.value).unwrap_or(0);
            let psi = case.speed_m_s / (w_m * case.frequency_hz * case.mu0 * (1.0 + case.poisson_ratio));
            ShortPoint { curve, w_m, psi, case }
        })
        .collect()
}

/// Psi* of the short study on all cores, `mu` giving the relative friction of a case; none where nothing fits.
///
/// # Errors
/// What `mu` cannot run.
pub fn psi_star_with(
    base: RidgeCase,
    reading: Reading,
    mu: impl Fn(&RidgeCase) -> Result<f64, RidgeError> + Sync,
) -> Result<Option<PsiFit>, RidgeError> {
    let solved: Result<Vec<_>, RidgeError> = points(base, reading)
        .par_iter()
        .map(|p| mu(&p.case).map(|mu_relative| (p.curve, p.psi, mu_relative)))
        .collect();
    solved.map(|solved| fit(&solved))
}

/// Psi* of the short study.
///
/// # Errors
/// A case that cannot be run.
pub fn psi_star(base: RidgeCase, reading: Reading) -> Result<Option<PsiFit>, RidgeError> {
    let settings = RunSettings { energy: false, ..RunSettings::default() };
    psi_star_with(base, reading, |case| run(case, &settings).map(|r| r.mu_relative))
}

/// Load over the mean one at which [`springs`] are taken: what the contact carries while it lasts, about.
pub const SPRING_LOADS: f64 = 3.0;

/// The finger of the massless spring-slider whose springs are the ridge's own: `k_l` and the secant `k_n` of
/// a static solve with the base of the stratum corneum held, under [`SPRING_LOADS`] mean loads.
///
/// # Errors
/// A case that makes no sense.
pub fn springs(case: &RidgeCase) -> Result<Finger, RidgeError> {
    let found = of_case(case, SPRING_LOADS * case.line_load_n_m(), HeldAt::CorneumBase)?;
    let finger = case.finger_per_ridge_m();
    Ok(Finger {
        normal_stiffness_n_per_m: finger * found.normal_secant_pa,
        lateral_stiffness_n_per_m: finger * found.lateral_pa,
        poisson_ratio: case.poisson_ratio,
        ..Finger::paper()
    })
}

/// Psi* of the short study by that slider: what statics alone say of the ridge's law.
///
/// # Errors
/// A case that makes no sense.
pub fn slider_psi_star(base: RidgeCase, reading: Reading) -> Result<Option<PsiFit>, RidgeError> {
    let finger = springs(&base)?;
    psi_star_with(base, reading, |case| {
        let outside =
            |_| RidgeError::input("condition of the slider", case.amplitude.metres(), "within its domain");
        spring_slider::solve(&case.condition(), &finger).map(|cycle| cycle.mu_relative).map_err(outside)
    })
}
