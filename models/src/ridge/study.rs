//! Parametric studies: the cases of Fig. 9, and the content key under which a result is stored.

use super::{RidgeCase, RunSettings};

/// Changes whenever the model itself changes its results, so that old results are not mistaken for new ones.
pub const MODEL_VERSION: u32 = 2;

/// The key of a case's result: a hash of the model's version and of everything that defines the run.
pub fn content_key(case: &RidgeCase, settings: &RunSettings) -> String {
    // What every result had before there was a choice: those stay what they are.
    let unsaid = [
        " tangential_penalty_ratio: 1.0,",
        " tangential_stiffness_pa_m: None,",
        " stiffness_damping_s: 0.0,",
    ];
    let inputs = unsaid.iter().fold(format!("{case:?}"), |all, one| all.replace(one, ""));
    // One step for all layers and no mass added is what version 1 was.
    let version = match (settings.one_step, settings.added_mass) {
        (true, 0.0) => "1".to_owned(),
        (false, super::loading::ADDED_MASS) => MODEL_VERSION.to_string(),
        (one_step, added_mass) => format!("{MODEL_VERSION} {one_step} {added_mass}"),
    };
    let start =
        if settings.overshoot > 1.0 { format!(" from {}", settings.overshoot) } else { String::new() };
    format!("{:016x}", fnv1a(format!("{version} {inputs} {:?}{start}", settings.steady).as_bytes()))
}

/// FNV-1a, 64 bits: a fingerprint of inputs, not a defence.
pub fn fnv1a(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(*b)).wrapping_mul(0x100_0000_01b3))
}

/// A panel of Fig. 9.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Panel {
    /// (a) 10, 27.5, 50, 100 kHz.
    Frequency,
    /// (b) 20, 28.3, 50, 200 MPa.
    YoungModulus,
    /// (c) 0.1, 0.5, 1, 2.
    Mu0,
    /// (d) 0.1, 0.25, 0.5, 1 N.
    NormalForce,
    /// (e) 5, 20, 50, 100 mm/s.
    Speed,
}

impl Panel {
    /// All panels in the figure's order.
    pub const ALL: [Panel; 5] =
        [Panel::Frequency, Panel::YoungModulus, Panel::Mu0, Panel::NormalForce, Panel::Speed];

    /// Name of the varied quantity, with its unit.
    pub const fn variable(self) -> &'static str {
        match self {
            Panel::Frequency => "frequency_hz",
            Panel::YoungModulus => "young_modulus_pa",
            Panel::Mu0 => "mu0",
            Panel::NormalForce => "normal_force_n",
            Panel::Speed => "speed_m_s",
        }
    }

    /// The four values of the varied quantity.
    pub const fn values(self) -> [f64; 4] {
        match self {
            Panel::Frequency => [10e3, 27.5e3, 50e3, 100e3],
            Panel::YoungModulus => [20e6, 28.3e6, 50e6, 200e6],
            Panel::Mu0 => [0.1, 0.5, 1.0, 2.0],
            Panel::NormalForce => [0.1, 0.25, 0.5, 1.0],
            Panel::Speed => [0.005, 0.02, 0.05, 0.1],
        }
    }

    /// `base` with the varied quantity set.
    pub fn set(self, base: RidgeCase, value: f64) -> RidgeCase {
        match self {
            Panel::Frequency => RidgeCase { frequency_hz: value, ..base },
            Panel::YoungModulus => RidgeCase { young_modulus_pa: value, ..base },
            Panel::Mu0 => RidgeCase { mu0: value, ..base },
            Panel::NormalForce => base.with_normal_force_n(value),
            Panel::Speed => RidgeCase { speed_m_s: value, ..base },
        }
    }
}

/// The amplitudes of the study, peak-to-peak in m.
pub const FIG_9_AMPLITUDES_PP_M: [f64; 12] =
    [0.1e-6, 0.3e-6, 0.5e-6, 0.75e-6, 1.0e-6, 1.25e-6, 1.5e-6, 2.0e-6, 2.5e-6, 3.0e-6, 4.0e-6, 5.0e-6];

/// A finer ladder: 20 amplitudes from 0.3 to 5 um, those of Fig. 12's caption among them.
pub const FINE_AMPLITUDES_PP_M: [f64; 20] = [
    0.3e-6, 0.4e-6, 0.5e-6, 0.6e-6, 0.7e-6, 0.8e-6, 0.9e-6, 1.0e-6, 1.15e-6, 1.3e-6, 1.5e-6, 1.75e-6, 2.0e-6,
    2.25e-6, 2.5e-6, 2.75e-6, 3.0e-6, 3.5e-6, 4.0e-6, 5.0e-6,
];

/// One point of Fig. 9.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StudyPoint {
    /// The panel it belongs to.
    pub panel: Panel,
    /// Value of the panel's quantity.
    pub value: f64,
    /// The case to run.
    pub case: RidgeCase,
}

/// The complete study of Fig. 9 about `base`: 5 panels of 4 curves of 12 amplitudes. The base curve is in
/// every panel and has one content key, so it is run once.
pub fn fig_9(base: RidgeCase) -> Vec<StudyPoint> {
    fig_9_at(base, &FIG_9_AMPLITUDES_PP_M)
}

/// The same on another ladder of amplitudes, peak-to-peak in m.
pub fn fig_9_at(base: RidgeCase, amplitudes_pp_m: &[f64]) -> Vec<StudyPoint> {
    let curves = Panel::ALL.into_iter().flat_map(|panel| panel.values().map(|value| (panel, value)));
    let of = |(panel, value): (Panel, f64)| {
        let case = panel.set(base, value);
        amplitudes_pp_m.iter().map(move |w| StudyPoint { panel, value, case: case.with_amplitude_pp_m(*w) })
    };
    curves.flat_map(of).collect()
}
