//! Certificates from files, and the skin of a finger from a phase table.

use crate::{MuprimeError, refused};
use calibration::phase::table::read_phases;
use pyo3::prelude::*;
use tables::calibrate::{from_files, inverse};

/// The certificate of a command line of `muprime calibrate` (words after `calibrate`) as TOML, and its document as JSON.
#[pyfunction]
pub fn calibrate(py: Python<'_>, words: Vec<String>) -> PyResult<(String, String)> {
    let issued = py.detach(|| from_files(&words)).map_err(refused)?;
    Ok((issued.certificate.to_toml(), issued.document().to_string()))
}

/// What holds of a certificate's text now, as JSON: its shape, its hash and its time are checked.
#[pyfunction]
pub fn certificate(name: &str, text: &str) -> PyResult<String> {
    tables::calibrate::check(name, text).map_err(refused)?;
    let read = calibration::certificate::Certificate::from_toml(text)
        .map_err(|why| MuprimeError::new_err(format!("{name}: {why}")))?;
    Ok(tables::calibrate::document(&read).to_string())
}

/// The inverse analysis of a phase table (CSV in memory): `skin` of `muprime calibrate finger --json`.
#[pyfunction]
#[pyo3(signature = (phases, frequency_hz, normal_force_n, modulus_range_pa, elements, modulus_only))]
pub fn fit_finger(
    py: Python<'_>,
    phases: Vec<u8>,
    frequency_hz: Option<f64>,
    normal_force_n: Option<f64>,
    modulus_range_pa: (f64, f64),
    elements: usize,
    modulus_only: bool,
) -> PyResult<String> {
    let points = read_phases(&phases[..]).map_err(|why| MuprimeError::new_err(why.to_string()))?;
    let options = inverse::Options {
        frequency_hz,
        normal_force_n,
        modulus_range_pa,
        elements,
        modulus_only,
        shown: false,
    };
    let (elastic, skin) = py.detach(|| inverse::analyse(&options, &points)).map_err(refused)?;
    Ok(serde_json::json!({ "elastic": elastic, "all_free": skin }).to_string())
}
