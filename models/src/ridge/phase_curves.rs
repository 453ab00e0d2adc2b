//! Phase shift at given amplitudes against what section 3.3 identifies (`E_sc`, `k`, `tau`): the model is run
//! on a grid of skins at exactly the measured amplitudes, and interpolated between skins only, where it is
//! smooth. A grid of one value along an axis holds that quantity fixed.

use super::{RidgeCase, RidgeError, RunSettings, run};
use crate::quantity::PeakToPeak;
use rayon::prelude::*;
use serde::Serialize;

/// The three quantities of the inverse analysis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Skin {
    /// Young's modulus of the stratum corneum in Pa.
    pub young_modulus_pa: f64,
    /// Contact penalty over that modulus.
    pub penalty_ratio: f64,
    /// Retardation time in s, zero for elastic.
    pub retardation_time_s: f64,
}

impl Skin {
    /// Elastic skin with the default penalty.
    pub fn elastic(young_modulus_pa: f64) -> Self {
        Skin { young_modulus_pa, penalty_ratio: super::case::PENALTY_RATIO, retardation_time_s: 0.0 }
    }
}

/// A rising list of values for each quantity.
#[derive(Clone, Debug, PartialEq)]
pub struct SkinGrid {
    /// Moduli in Pa.
    pub moduli_pa: Vec<f64>,
    /// Penalties over the modulus.
    pub penalty_ratios: Vec<f64>,
    /// Retardation times in s.
    pub retardation_times_s: Vec<f64>,
}

impl SkinGrid {
    /// `count` moduli of equal ratio, elastic, with the default penalty.
    pub fn elastic((low_pa, high_pa): (f64, f64), count: usize) -> Self {
        SkinGrid {
            moduli_pa: ratios(low_pa, high_pa, count),
            penalty_ratios: vec![super::case::PENALTY_RATIO],
            retardation_times_s: vec![0.0],
        }
    }

    /// All three free. The penalty goes from where it makes the contact much softer than the skin to Table
    /// 2's for moist skin, above which it makes no difference; the time from none to where one cycle sees
    /// nothing of the relaxation (`docs/ridge.md`).
    pub fn free((low_pa, high_pa): (f64, f64), count: usize) -> Self {
        SkinGrid {
            moduli_pa: ratios(low_pa, high_pa, count),
            penalty_ratios: vec![0.1, 0.3, 1.0, super::case::PENALTY_RATIO],
            retardation_times_s: vec![0.0, 3e-6, 1e-5, 3e-5, 1e-3],
        }
    }

    /// Number of skins.
    pub fn len(&self) -> usize {
        self.moduli_pa.len() * self.penalty_ratios.len() * self.retardation_times_s.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    fn skins(&self) -> impl Iterator<Item = Skin> + '_ {
        let pairs = self.moduli_pa.iter().flat_map(|e| self.penalty_ratios.iter().map(move |k| (*e, *k)));
        pairs.flat_map(|(young_modulus_pa, penalty_ratio)| {
            let times = self.retardation_times_s.iter();
            times.map(move |tau| Skin { young_modulus_pa, penalty_ratio, retardation_time_s: *tau })
        })
    }

    fn check(&self) -> Result<(), RidgeError> {
        let axes =
            [&self.moduli_pa, &self.penalty_ratios, &self.retardation_times_s].map(|axis| axis.as_slice());
        for (axis, what) in axes.into_iter().zip(["modulus", "penalty ratio", "retardation time"]) {
            let rising = axis.windows(2).all(|v| v[0] < v[1]) && axis.iter().all(|v| v.is_finite());
            if axis.is_empty() || !rising {
                let value = axis.last().copied().unwrap_or(f64::NAN);
                return Err(RidgeError::input(format!("the grid's {what}"), value, "a rising list"));
            }
        }
        Ok(())
    }
}

fn ratios(low: f64, high: f64, count: usize) -> Vec<f64> {
    let last = count.saturating_sub(1).max(1) as f64;
    (0..count).map(|k| low * (high / low).powf(k as f64 / last)).collect()
}

/// Place of a retardation time: even in the time where it is short beside a cycle, in its logarithm beyond.
pub fn retardation_place(time_s: f64) -> f64 {
    (time_s / 2e-6).asinh()
}

/// Phase shift at rest over a grid of skins.
#[derive(Clone, Debug, PartialEq)]
pub struct PhaseCurves {
    amplitudes: Vec<PeakToPeak>,
    grid: SkinGrid,
    /// Places along the three axes, in which the phase is interpolated linearly.
    places: [Vec<f64>; 3],
    /// Degrees, continued below zero, one row for each amplitude, the retardation time fastest.
    phase_deg: Vec<Vec<f64>>,
}

impl PhaseCurves {
    /// Runs `base` at rest at each amplitude and each skin of the grid, on all cores; `done` is called after
    /// each run.
    ///
    /// # Errors
    /// A grid that does not rise; a case that is refused or diverged.
    pub fn compute(
        base: RidgeCase,
        amplitudes: &[PeakToPeak],
        grid: SkinGrid,
        done: impl Fn() + Sync,
    ) -> Result<PhaseCurves, RidgeError> {
        grid.check()?;
        let settings = RunSettings { energy: false, ..RunSettings::default() };
        let phase = |(amplitude, skin): (PeakToPeak, Skin)| {
            let case = RidgeCase {
                amplitude,
                young_modulus_pa: skin.young_modulus_pa,
                penalty_ratio: skin.penalty_ratio,
                retardation_time_s: skin.retardation_time_s,
                speed_m_s: 0.0,
                ..base
            };
            let phase = run(&case, &settings)?.phase_shift_deg.unwrap_or(0.0);
            done();
            Ok(if phase > 270.0 { phase - 360.0 } else { phase })
        };
        let cases: Vec<_> = amplitudes.iter().flat_map(|w| grid.skins().map(|skin| (*w, skin))).collect();
        let flat: Vec<f64> = cases.into_par_iter().map(phase).collect::<Result<_, RidgeError>>()?;
        let phase_deg = flat.chunks(grid.len()).map(<[f64]>::to_vec).collect();
        let places = [
            grid.moduli_pa.iter().map(|v| v.ln()).collect(),
            grid.penalty_ratios.iter().map(|v| v.ln()).collect(),
            grid.retardation_times_s.iter().map(|v| retardation_place(*v)).collect(),
        ];
        Ok(PhaseCurves { amplitudes: amplitudes.to_vec(), grid, places, phase_deg })
    }

    /// Phase in degrees for a skin at one of the amplitudes; not a number at any other amplitude. Beyond an
    /// end of the grid it is that at the end.
    pub fn at(&self, skin: &Skin, amplitude: PeakToPeak) -> f64 {
        let Some(row) = self.amplitudes.iter().position(|w| *w == amplitude) else {
            return f64::NAN;
        };
        let wanted =
            [skin.young_modulus_pa.ln(), skin.penalty_ratio.ln(), retardation_place(skin.retardation_time_s)];
        let at: [(usize, f64); 3] = std::array::from_fn(|axis| cell(&self.places[axis], wanted[axis]));
        let counts: [usize; 3] = std::array::from_fn(|axis| self.places[axis].len());
        let value = |e: usize, k: usize, tau: usize| {
            let [e, k, tau] = [(e, 0), (k, 1), (tau, 2)]
                .map(|(up, axis): (usize, usize)| (at[axis].0 + up).min(counts[axis] - 1));
            self.phase_deg[row][(e * counts[1] + k) * counts[2] + tau]
        };
        let mix = |a: f64, b: f64, share: f64| a + share * (b - a);
        let along_tau = |e, k| mix(value(e, k, 0), value(e, k, 1), at[2].1);
        let along_k = |e| mix(along_tau(e, 0), along_tau(e, 1), at[1].1);
        mix(along_k(0), along_k(1), at[0].1)
    }
}

/// The cell of a rising list that holds `value`, and the share of the way through it.
fn cell(places: &[f64], value: f64) -> (usize, f64) {
    if places.len() < 2 {
        return (0, 0.0);
    }
    let cell = places.partition_point(|p| *p <= value).clamp(1, places.len() - 1) - 1;
    let share = (value - places[cell]) / (places[cell + 1] - places[cell]);
    (cell, share.clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_are_the_model_and_beyond_the_ends_is_the_end() {
        let base = RidgeCase { elements: 150, ..RidgeCase::paper() };
        let amplitudes = [2e-6, 3e-6].map(PeakToPeak::from_metres);
        let grid = SkinGrid {
            moduli_pa: vec![20e6, 40e6],
            penalty_ratios: vec![0.3, 3.0],
            retardation_times_s: vec![0.0, 1e-5],
        };
        let count = std::sync::atomic::AtomicUsize::new(0);
        let done = || {
            count.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        };
        let curves = PhaseCurves::compute(base, &amplitudes, grid.clone(), done).expect("computed");
        assert_eq!(count.into_inner(), 2 * grid.len());
        let settings = RunSettings { energy: false, ..RunSettings::default() };
        for skin in grid.skins() {
            let case = RidgeCase {
                amplitude: amplitudes[1],
                young_modulus_pa: skin.young_modulus_pa,
                penalty_ratio: skin.penalty_ratio,
                retardation_time_s: skin.retardation_time_s,
                speed_m_s: 0.0,
                ..base
            };
            let exact = run(&case, &settings).expect("runs").phase_shift_deg.expect("it vibrates");
            assert!((curves.at(&skin, amplitudes[1]) - exact).abs() < 1e-9, "{skin:?}");
        }
        let end = Skin { young_modulus_pa: 40e6, penalty_ratio: 3.0, retardation_time_s: 0.0 };
        let beyond = Skin { young_modulus_pa: 90e6, penalty_ratio: 50.0, ..end };
        assert!((curves.at(&end, amplitudes[0]) - curves.at(&beyond, amplitudes[0])).abs() < 1e-9);
        assert!(curves.at(&end, PeakToPeak::from_metres(1e-6)).is_nan());
    }

    #[test]
    fn a_grid_that_does_not_rise_is_refused() {
        let base = RidgeCase { elements: 150, ..RidgeCase::paper() };
        let grid = SkinGrid { moduli_pa: vec![40e6, 20e6], ..SkinGrid::elastic((1e7, 1e8), 2) };
        let why = PhaseCurves::compute(base, &[], grid, || {}).expect_err("refused").to_string();
        assert!(why.contains("modulus") && why.contains("rising"), "{why}");
    }
}
