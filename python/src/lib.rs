//! muprime in Python. A call is `muprime/<subject>.py`, its binding `src/<subject>.rs`, its types
//! `_muprime.pyi`. A binding is a thin layer over the crates of the binary. Long work releases the interpreter.
//!
//! | file | binding of |
//! |---|---|
//! | `laws` | friction laws on columns of conditions |
//! | `ridge` | cases of the finite element ridge |
//! | `calibrate` | certificates from files; the skin of a finger from a phase table |
//! | `plans` | plans: read, made, judged on a setup |
//! | `tabulate` | a user's own law as a table |
//! | `diagnose` | the diagnosis of a table |
//! | `runs` | a run's folder; a sweep on the virtual rig in virtual time |

// Messages of refusals go to Python as they are; nothing is printed from here.
#![deny(clippy::print_stdout, clippy::print_stderr)]

mod calibrate;
mod diagnose;
mod laws;
mod plans;
mod ridge;
mod runs;
mod tabulate;

use pyo3::prelude::*;

pyo3::create_exception!(
    muprime,
    MuprimeError,
    pyo3::exceptions::PyValueError,
    "A refusal: what is wrong, where, and what to do about it. Nothing was touched."
);

/// A refusal as Python sees it: the message, its causes, and the remedy.
fn refused(why: miette::Report) -> PyErr {
    let mut text = why.chain().map(ToString::to_string).collect::<Vec<_>>().join(": ");
    if let Some(help) = why.help() {
        text.push_str(&format!("\n  {help}"));
    }
    MuprimeError::new_err(text)
}

/// What the models' answers come from, as JSON: `models` of `muprime --version --json`.
#[pyfunction]
fn models_json() -> PyResult<String> {
    serde_json::to_string(&::runs::version::models()).map_err(|why| MuprimeError::new_err(why.to_string()))
}

#[pymodule]
fn _muprime(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add("__version__", env!("CARGO_PKG_VERSION"))?;
    m.add("MuprimeError", m.py().get_type::<MuprimeError>())?;
    m.add_function(wrap_pyfunction!(models_json, m)?)?;
    m.add_function(wrap_pyfunction!(laws::evaluate, m)?)?;
    m.add_function(wrap_pyfunction!(laws::psi_curve, m)?)?;
    m.add_function(wrap_pyfunction!(laws::fit_psi, m)?)?;
    m.add_function(wrap_pyfunction!(ridge::ridge, m)?)?;
    m.add_function(wrap_pyfunction!(tabulate::law_grid, m)?)?;
    m.add_function(wrap_pyfunction!(tabulate::law_conditions, m)?)?;
    m.add_function(wrap_pyfunction!(tabulate::law_table, m)?)?;
    m.add_function(wrap_pyfunction!(diagnose::diagnose, m)?)?;
    m.add_function(wrap_pyfunction!(calibrate::calibrate, m)?)?;
    m.add_function(wrap_pyfunction!(calibrate::certificate, m)?)?;
    m.add_function(wrap_pyfunction!(calibrate::fit_finger, m)?)?;
    m.add_function(wrap_pyfunction!(plans::plan_load, m)?)?;
    m.add_function(wrap_pyfunction!(plans::plan_parse, m)?)?;
    m.add_function(wrap_pyfunction!(plans::plan_made, m)?)?;
    m.add_function(wrap_pyfunction!(plans::plan_passes, m)?)?;
    m.add_function(wrap_pyfunction!(runs::load, m)?)?;
    m.add_function(wrap_pyfunction!(runs::cycles, m)?)?;
    m.add_function(wrap_pyfunction!(runs::run, m)?)?;
    m.add_function(wrap_pyfunction!(runs::fidelity, m)?)?;
    Ok(())
}
