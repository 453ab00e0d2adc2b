//! Friction laws on columns: one call, all cores, the interpreter free.

use crate::MuprimeError;
use models::condition::Condition;
use models::finger::Finger;
use models::prediction::{EmpiricalPsi, FrictionModel, RelativeFriction, SpringSlider, Validity};
use models::quantity::PeakToPeak;
use models::reading::Reading;
use models::surrogate::Surrogate;
use pyo3::buffer::PyBuffer;
use pyo3::prelude::*;
use rayon::prelude::*;

/// Rows that one thread takes at a time.
const SHARE: usize = 1024;

fn law(name: &str, finger: Finger, reading: Option<&str>) -> Result<Box<dyn FrictionModel>, String> {
    let reading = match reading {
        None => None,
        Some(word) => Some(
            Reading::ALL
                .into_iter()
                .find(|r| r.name() == word)
                .ok_or_else(|| format!("reading {word:?}: 'peak-to-peak' or 'sine-amplitude'"))?,
        ),
    };
    if reading.is_some() && name != "psi" {
        return Err(format!("reading belongs to the law 'psi', not to {name:?}"));
    }
    Ok(match (name, reading) {
        ("spring-slider", _) => Box::new(SpringSlider::new(finger).map_err(|e| e.to_string())?),
        ("psi", None) => Box::new(EmpiricalPsi::paper(finger).map_err(|e| e.to_string())?),
        ("psi", Some(one)) => Box::new(EmpiricalPsi::read(finger, one).map_err(|e| e.to_string())?),
        ("surrogate", _) => {
            finger.check().map_err(|e| e.to_string())?;
            Box::new(Surrogate::shipped().map_err(|e| e.to_string())?.for_finger(&finger))
        }
        _ => return Err(format!("law {name:?}: 'spring-slider', 'psi' or 'surrogate'")),
    })
}

/// `columns`: amplitude_pp_m, frequency_hz, speed_m_s, normal_force_n, mu0, all of one length. `finger`: normal and lateral
/// stiffness in N/m, their relative standard deviation, Poisson's ratio, Young's modulus in Pa, lateral recovery in m/s or None. `out`:
/// mu', its standard uncertainty, and 1.0 inside the law's range.
#[pyfunction]
#[pyo3(signature = (name, columns, finger, reading, out))]
#[allow(clippy::type_complexity)]
pub fn evaluate(
    py: Python<'_>,
    name: &str,
    columns: [PyBuffer<f64>; 5],
    finger: (f64, f64, f64, f64, f64, Option<f64>),
    reading: Option<&str>,
    out: [PyBuffer<f64>; 3],
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
    let [w, f, u, n, mu0] = {
        let mut told = Vec::with_capacity(5);
        for column in &columns {
            told.push(column.to_vec(py)?);
        }
        <[Vec<f64>; 5]>::try_from(told).map_err(|_| MuprimeError::new_err("five columns"))?
    };
    let answers = py.detach(|| {
        let row = |i: usize| {
            let condition = Condition {
                amplitude: PeakToPeak::from_metres(w[i]),
                frequency_hz: f[i],
                speed_m_s: u[i],
                normal_force_n: n[i],
                mu0: mu0[i],
                ..Condition::paper()
            };
            law.relative_friction(&condition).map_err(|why| format!("row {i}: {why}"))
        };
        (0..w.len()).into_par_iter().with_min_len(SHARE).map(row).collect::<Result<Vec<_>, _>>()
    });
    let answers = answers.map_err(MuprimeError::new_err)?;
    let column =
        |value: &dyn Fn(&RelativeFriction) -> f64| -> Vec<f64> { answers.iter().map(value).collect() };
    out[0].copy_from_slice(py, &column(&|p| p.mu_relative))?;
    out[1].copy_from_slice(py, &column(&|p| p.sd))?;
    out[2].copy_from_slice(py, &column(&|p| f64::from(u8::from(p.validity == Validity::Inside))))
}
