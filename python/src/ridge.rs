//! One case of the finite element ridge.

use crate::MuprimeError;
use models::quantity::PeakToPeak;
use models::ridge::{RidgeCase, RunSettings, case, run as solve};
use pyo3::prelude::*;

/// Runs a case to its steady state and answers with the document of `muprime model ridge --json`, without its times.
#[pyfunction]
#[pyo3(signature = (amplitude_pp_m, frequency_hz, speed_m_s, normal_force_n, mu0, young_modulus_pa, poisson_ratio, elements))]
#[allow(clippy::too_many_arguments)]
pub fn ridge(
    py: Python<'_>,
    amplitude_pp_m: f64,
    frequency_hz: f64,
    speed_m_s: f64,
    normal_force_n: f64,
    mu0: f64,
    young_modulus_pa: f64,
    poisson_ratio: f64,
    elements: usize,
) -> PyResult<String> {
    let case = RidgeCase {
        amplitude: PeakToPeak::from_metres(amplitude_pp_m),
        frequency_hz,
        speed_m_s,
        normal_force_n,
        mu0,
        young_modulus_pa,
        poisson_ratio,
        elements,
        mean_pressure_pa: case::hertz_mean_pressure_pa(normal_force_n),
        ..RidgeCase::paper()
    };
    let run = py.detach(|| solve(&case, &RunSettings::default()));
    let run = run.map_err(|why| MuprimeError::new_err(why.to_string()))?;
    serde_json::to_string(&run).map_err(|why| MuprimeError::new_err(why.to_string()))
}
