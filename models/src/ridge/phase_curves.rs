//! Phase shift against modulus at given amplitudes, for the inverse analysis: the model is run on a grid of
//! moduli at exactly the measured amplitudes, and interpolated in the modulus only, where it is smooth.

use super::{RidgeCase, RidgeError, RunSettings, run};
use crate::quantity::PeakToPeak;
use rayon::prelude::*;

/// Phase shift at rest over a grid of moduli.
#[derive(Clone, Debug, PartialEq)]
pub struct PhaseCurves {
    amplitudes: Vec<PeakToPeak>,
    moduli_pa: Vec<f64>,
    /// Degrees, continued below zero, one row for each amplitude.
    phase_deg: Vec<Vec<f64>>,
}

impl PhaseCurves {
    /// Runs `base` at rest at each amplitude and each of `count` moduli of equal ratio from `low` to `high`.
    ///
    /// # Errors
    /// A case that is refused or diverged.
    pub fn compute(
        base: RidgeCase,
        amplitudes: &[PeakToPeak],
        (low_pa, high_pa): (f64, f64),
        count: usize,
    ) -> Result<PhaseCurves, RidgeError> {
        if !(low_pa > 0.0 && low_pa < high_pa && high_pa.is_finite()) || count < 2 {
            let what = format!("range of moduli in Pa ({count} from {low_pa} to");
            return Err(RidgeError::Input { what, value: high_pa, range: "rising, with two or more".into() });
        }
        let moduli_pa: Vec<f64> =
            (0..count).map(|k| low_pa * (high_pa / low_pa).powf(k as f64 / (count - 1) as f64)).collect();
        let settings = RunSettings { energy: false, ..RunSettings::default() };
        let phase = |(amplitude, young_modulus_pa): (PeakToPeak, f64)| {
            let case = RidgeCase { amplitude, young_modulus_pa, speed_m_s: 0.0, ..base };
            let phase = run(&case, &settings)?.phase_shift_deg.unwrap_or(0.0);
            Ok(if phase > 270.0 { phase - 360.0 } else { phase })
        };
        let cases: Vec<(PeakToPeak, f64)> =
            amplitudes.iter().flat_map(|w| moduli_pa.iter().map(|e| (*w, *e))).collect();
        let flat: Vec<f64> = cases.into_par_iter().map(phase).collect::<Result<_, RidgeError>>()?;
        let phase_deg = flat.chunks(count).map(<[f64]>::to_vec).collect();
        Ok(PhaseCurves { amplitudes: amplitudes.to_vec(), moduli_pa, phase_deg })
    }

    /// Least and greatest modulus in Pa.
    pub fn range_pa(&self) -> (f64, f64) {
        (self.moduli_pa[0], self.moduli_pa[self.moduli_pa.len() - 1])
    }

    /// Phase in degrees at a modulus and one of the amplitudes; not a number at any other amplitude.
    pub fn at(&self, modulus_pa: f64, amplitude: PeakToPeak) -> f64 {
        let Some(row) = self.amplitudes.iter().position(|w| *w == amplitude) else {
            return f64::NAN;
        };
        let (low, high) = self.range_pa();
        let last = self.moduli_pa.len() - 1;
        let place = ((modulus_pa / low).ln() / (high / low).ln()).clamp(0.0, 1.0) * last as f64;
        let cell = (place as usize).min(last - 1);
        let (a, b) = (self.phase_deg[row][cell], self.phase_deg[row][cell + 1]);
        a + (place - cell as f64) * (b - a)
    }
}
