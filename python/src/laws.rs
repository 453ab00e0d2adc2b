//! Friction laws on columns: one call, all cores, the interpreter free.

use crate::MuprimeError;
use models::prediction::{EmpiricalPsi, FrictionModel, Validity};
use models::psi::{self, PsiEq17};
use models::{BuiltIn, Condition, Finger, PeakToPeak, Reading, psi_fit};
use pyo3::buffer::PyBuffer;
use pyo3::prelude::*;
use rayon::prelude::*;
use std::sync::Arc;

/// Rows that one thread takes at a time.
const SHARE: usize = 1024;

fn law(name: &str, finger: Finger, reading: Option<&str>) -> Result<Arc<dyn FrictionModel>, String> {
    let Some(word) = reading else {
        let no_law = || format!("law {name:?}: 'spring-slider', 'psi' or 'surrogate'");
        return BuiltIn::by_name(name).ok_or_else(no_law)?.law(&finger).map_err(|e| e.to_string());
    };
    let no_reading = || format!("reading {word:?}: 'peak-to-peak' or 'sine-amplitude'");
    let reading = Reading::ALL.into_iter().find(|r| r.name() == word).ok_or_else(no_reading)?;
    if name != "psi" {
        return Err(format!("reading belongs to the law 'psi', not to {name:?}"));
    }
    Ok(Arc::new(EmpiricalPsi::read(finger, reading).map_err(|e| e.to_string())?))
}

/// A condition by the columns that [`evaluate`] takes.
fn condition(at: impl Fn(usize) -> f64) -> Condition {
    Condition {
        amplitude: PeakToPeak::from_metres(at(0)),
        frequency_hz: at(1),
        speed_m_s: at(2),
        normal_force_n: at(3),
        mu0: at(4),
        ..Condition::paper()
    }
}

/// A column of conditions, or the one value that holds in every row: a number that was given once is not copied a million times.
enum Column {
    Same(f64),
    Each(Vec<f64>),
}

impl Column {
    fn of(py: Python<'_>, given: &PyBuffer<f64>, rows: usize) -> PyResult<Self> {
        let values = given.to_vec(py)?;
        match values.len() {
            1 => Ok(Column::Same(values[0])),
            length if length == rows => Ok(Column::Each(values)),
            _ => Err(MuprimeError::new_err("columns of one length are needed")),
        }
    }

    fn at(&self, row: usize) -> f64 {
        match self {
            Column::Same(value) => *value,
            Column::Each(values) => values[row],
        }
    }
}

/// `columns`: amplitude_pp_m, frequency_hz, speed_m_s, normal_force_n, mu0, each as long as `out` or a single value. `finger`: normal and lateral
/// stiffness in N/m, their relative standard deviation, Poisson's ratio, Young's modulus in Pa, lateral recovery in m/s or None. `out`:
/// mu' and its standard uncertainty; `inside`: 1 inside the law's range.
#[pyfunction]
#[pyo3(signature = (name, columns, finger, reading, out, inside))]
#[allow(clippy::type_complexity)]
pub fn evaluate(
    py: Python<'_>,
    name: &str,
    columns: [PyBuffer<f64>; 5],
    finger: (f64, f64, f64, f64, f64, Option<f64>),
    reading: Option<&str>,
    out: [PyBuffer<f64>; 2],
    inside: PyBuffer<u8>,
) -> PyResult<()> {
    let finger = Finger {
        normal_stiffness_n_per_m: finger.0,
        lateral_stiffness_n_per_m: finger.1,
        stiffness_relative_sd: finger.2,
        poisson_ratio: finger.3,
        young_modulus_pa: Some(finger.4),
        lateral_recovery_m_per_s: finger.5,
    };
    let law = law(name, finger, reading).map_err(MuprimeError::new_err)?;
    let rows = inside.item_count();
    let given = columns.iter().map(|given| Column::of(py, given, rows)).collect::<PyResult<Vec<_>>>()?;
    let [mut mu, mut sd] = [(); 2].map(|()| vec![0.0; rows]);
    let mut within = vec![0_u8; rows];
    let answered = py.detach(|| {
        let share = |(nth, ((mu, sd), within)): (usize, ((&mut [f64], &mut [f64]), &mut [u8]))| {
            for (k, ((mu, sd), within)) in mu.iter_mut().zip(sd).zip(within).enumerate() {
                let row = nth * SHARE + k;
                let condition = condition(|column| given[column].at(row));
                let answer = law.relative_friction(&condition).map_err(|why| format!("row {row}: {why}"))?;
                (*mu, *sd) = (answer.mu_relative, answer.sd);
                *within = u8::from(answer.validity == Validity::Inside);
            }
            Ok::<(), String>(())
        };
        let columns = mu.par_chunks_mut(SHARE).zip(sd.par_chunks_mut(SHARE));
        // Of several rows that are refused, the first share's is reported, whatever the number of threads.
        let all: Vec<_> = columns.zip(within.par_chunks_mut(SHARE)).enumerate().map(share).collect();
        all.into_iter().find(Result::is_err).unwrap_or(Ok(()))
    });
    answered.map_err(MuprimeError::new_err)?;
    out[0].copy_from_slice(py, &mu)?;
    out[1].copy_from_slice(py, &sd)?;
    inside.copy_from_slice(py, &within)
}

/// Psi of Eq. 17 of columns: amplitude_pp_m, frequency_hz, speed_m_s, normal_force_n, mu0.
fn groups(columns: &[Vec<f64>], poisson_ratio: f64) -> Result<Vec<PsiEq17>, String> {
    let of = |i: usize| {
        let condition = condition(|column| columns[column][i]);
        condition.check().map_err(|why| format!("row {i}: {why}"))?;
        Ok(PsiEq17::at(&condition, poisson_ratio))
    };
    (0..columns[0].len()).map(of).collect()
}

/// Columns as numbers, if all are of one length.
pub(crate) fn columns_of(py: Python<'_>, columns: &[PyBuffer<f64>]) -> PyResult<Vec<Vec<f64>>> {
    let values = columns.iter().map(|column| column.to_vec(py)).collect::<PyResult<Vec<_>>>()?;
    if values.iter().any(|column| column.len() != values[0].len()) {
        return Err(MuprimeError::new_err("columns of one length are needed"));
    }
    Ok(values)
}

/// Eq. 20 with a Psi* of one's own on columns (as of [`evaluate`]): mu'.
#[pyfunction]
#[pyo3(signature = (columns, poisson_ratio, psi_star, out))]
pub fn psi_curve(
    py: Python<'_>,
    columns: [PyBuffer<f64>; 5],
    poisson_ratio: f64,
    psi_star: f64,
    out: PyBuffer<f64>,
) -> PyResult<()> {
    let groups = groups(&columns_of(py, &columns)?, poisson_ratio).map_err(MuprimeError::new_err)?;
    // Without vibration Psi is infinite and mu' is one.
    let mu: Vec<f64> = groups.into_iter().map(|group| psi::relative_friction(group, psi_star)).collect();
    out.copy_from_slice(py, &mu)
}

/// Least-squares Psi* of columns and their mu': its value, its standard uncertainty by leaving out one curve
/// (`curves` numbers them) at a time, and the root mean square residual.
#[pyfunction]
#[pyo3(signature = (columns, mu_relative, curves, poisson_ratio))]
pub fn fit_psi(
    py: Python<'_>,
    columns: [PyBuffer<f64>; 5],
    mu_relative: PyBuffer<f64>,
    curves: Vec<usize>,
    poisson_ratio: f64,
) -> PyResult<(f64, f64, f64)> {
    let values = columns_of(py, &columns)?;
    let mu = mu_relative.to_vec(py)?;
    if mu.len() != values[0].len() || curves.len() != mu.len() {
        return Err(MuprimeError::new_err("columns of one length are needed"));
    }
    let found = py.detach(|| {
        let groups = groups(&values, poisson_ratio)?;
        let points: Vec<(usize, f64, f64)> = curves
            .iter()
            .zip(groups.iter().zip(&mu))
            .filter(|(_, (group, _))| group.0.is_finite())
            .map(|(curve, (group, mu))| (*curve, group.0, *mu))
            .collect();
        psi_fit::fit(&points).ok_or_else(|| {
            format!(
                "{} rows with vibration: no Psi* between 0.01 and 100 fits better than its neighbours",
                points.len()
            )
        })
    });
    let found = found.map_err(MuprimeError::new_err)?;
    Ok((found.psi_star, found.psi_star_sd, found.rmse))
}
