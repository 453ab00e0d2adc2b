//! Cases of the finite element ridge, on all cores.

use crate::MuprimeError;
use crate::laws::columns_of;
use models::PeakToPeak;
use models::ridge::{RidgeCase, RunSettings, case, run as solve};
use pyo3::buffer::PyBuffer;
use pyo3::prelude::*;
use rayon::prelude::*;

/// Runs cases to their steady states. `columns`: amplitude_pp_m, frequency_hz, speed_m_s, normal_force_n, mu0, young_modulus_pa,
/// poisson_ratio, all of one length. Answers with a document of `muprime model ridge --json` for each, as one JSON list.
#[pyfunction]
#[pyo3(signature = (columns, elements))]
pub fn ridge(py: Python<'_>, columns: [PyBuffer<f64>; 7], elements: usize) -> PyResult<String> {
    let values = columns_of(py, &columns)?;
    let one = |row: usize| {
        let at = |column: usize| values[column][row];
        let case = RidgeCase {
            amplitude: PeakToPeak::from_metres(at(0)),
            frequency_hz: at(1),
            speed_m_s: at(2),
            normal_force_n: at(3),
            mu0: at(4),
            young_modulus_pa: at(5),
            poisson_ratio: at(6),
            elements,
            mean_pressure_pa: case::hertz_mean_pressure_pa(at(3)),
            ..RidgeCase::paper()
        };
        solve(&case, &RunSettings::default()).map_err(|why| format!("row {row}: {why}"))
    };
    let runs = py.detach(|| (0..values[0].len()).into_par_iter().map(one).collect::<Result<Vec<_>, _>>());
    let runs = runs.map_err(MuprimeError::new_err)?;
    serde_json::to_string(&runs).map_err(|why| MuprimeError::new_err(why.to_string()))
}
