//! A run's folder, and a sweep on the virtual rig in virtual time.

use crate::{MuprimeError, refused};
use models::BuiltIn;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use runs::job::{Job, Notes, Signals};
use runs::{Plan, Setup};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// The run of a folder: its passes as an Arrow IPC file, then as JSON the facts of its record, its summary, its damage.
#[pyfunction]
pub fn load(py: Python<'_>, folder: PathBuf) -> PyResult<(Py<PyBytes>, String)> {
    let loaded = py.detach(|| -> miette::Result<_> {
        let run = runs::run_data::read(&folder)?;
        let about = serde_json::json!({ "facts": run.facts, "summary": run.summary, "damage": run.damage });
        Ok((tables::export::arrow_bytes(&run)?, about.to_string()))
    });
    let (bytes, about) = loaded.map_err(refused)?;
    Ok((PyBytes::new(py, &bytes).unbind(), about))
}

/// The cycles of a run's records as an Arrow IPC file; `points`: of these passes alone, of all where it is
/// empty.
#[pyfunction]
pub fn cycles(py: Python<'_>, folder: PathBuf, points: Vec<u32>) -> PyResult<Py<PyBytes>> {
    let bytes = py
        .detach(|| tables::export::cycles_bytes(&folder, &runs::run_data::read(&folder)?, &points))
        .map_err(refused)?;
    Ok(PyBytes::new(py, &bytes).unbind())
}

/// How faithfully the run of a folder rendered its target, made from its records, as JSON.
#[pyfunction]
pub fn fidelity(py: Python<'_>, folder: PathBuf) -> PyResult<String> {
    let found = py.detach(|| runs::fidelity::of_run(&folder)).map_err(refused)?;
    let nothing = || {
        let help = "give the plan a [render] section, as the bundled 'render-grating' has";
        refused(miette::miette!(help = help, "{} rendered nothing", folder.display()))
    };
    serde_json::to_string(&found.ok_or_else(nothing)?).map_err(|why| MuprimeError::new_err(why.to_string()))
}

/// A sweep of a plan (its name and its text) on the virtual rig of a setup, in virtual time, into `out`; the summary as JSON.
#[pyfunction]
#[pyo3(signature = (plan, text, setup, out, seed, defects, model, operator, sample, licence))]
#[allow(clippy::too_many_arguments)]
pub fn run(
    py: Python<'_>,
    plan: &str,
    text: &str,
    setup: &str,
    out: PathBuf,
    seed: Option<u64>,
    defects: Option<PathBuf>,
    model: Option<PathBuf>,
    operator: Option<String>,
    sample: Option<String>,
    licence: Option<String>,
) -> PyResult<String> {
    let notes = Notes { operator, subject: None, sample, licence };
    let plan = Plan::parse(plan, text).map_err(refused)?;
    let job = job(plan, setup, out, seed, defects.as_deref(), model.as_deref(), notes).map_err(refused)?;
    let signals = Signals::default();
    let stops = Arc::clone(&signals.stops);
    // A key that interrupts the interpreter ends the sweep as a stop does: checked at every pass.
    let mut interrupted = None;
    let summary = py.detach(|| {
        job.run_in_virtual_time(&signals, &mut |_| {
            if interrupted.is_none() {
                interrupted = Python::attach(|py| py.check_signals()).err();
                stops.fetch_add(usize::from(interrupted.is_some()), Ordering::Relaxed);
            }
        })
    });
    if let Some(why) = interrupted {
        return Err(why);
    }
    let summary = summary.map_err(refused)?;
    serde_json::to_string(&summary).map_err(|why| MuprimeError::new_err(why.to_string()))
}

fn job(
    plan: Plan,
    setup: &str,
    out: PathBuf,
    seed: Option<u64>,
    defects: Option<&Path>,
    model: Option<&Path>,
    notes: Notes,
) -> miette::Result<Job> {
    let setup = Setup::load(setup)?;
    if setup.file.virtual_rig.is_none() {
        miette::bail!(
            help = "`muprime run` leads a real rig: it takes the machine's real-time class and its signals",
            "'{}' is a real rig: from here only a virtual one can be run, in virtual time",
            setup.file.name
        );
    }
    let defects = defects.map(|path| {
        let read = sim::defects::Defects::parse(&runs::input::text_of(path)?);
        read.map_err(|why| miette::miette!("{}: {why}", path.display()))
    });
    let defects = defects.transpose()?;
    let slider = Path::new(BuiltIn::SpringSlider.name());
    let tables::law::Loaded { model, file: model_file } =
        tables::law::for_run(model.unwrap_or(slider), &setup)?;
    let seed = seed.unwrap_or(plan.file.seed);
    Ok(Job { setup, plan, seed, model, model_file, defects, out, fast: true, notes, answers: None })
}
