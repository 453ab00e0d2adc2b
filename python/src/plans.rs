//! Plans: read, made, judged on a setup.

use crate::{MuprimeError, refused};
use miette::IntoDiagnostic;
use models::{FrictionModel, SpringSlider};
use pyo3::prelude::*;
use runs::{Job, Plan, Setup};
use std::path::PathBuf;
use std::sync::Arc;

/// Name (as messages say it), text and document (JSON) of a plan: a bundled one, or a file.
#[pyfunction]
pub fn plan_load(name: &str) -> PyResult<(String, String, String)> {
    Plan::load(name).and_then(parts).map_err(refused)
}

/// The same of a plan's text.
#[pyfunction]
pub fn plan_parse(name: &str, text: &str) -> PyResult<(String, String, String)> {
    Plan::parse(name, text).and_then(parts).map_err(refused)
}

/// The same of a plan's document (JSON): it is written as text first, so that what is refused has its place there.
#[pyfunction]
pub fn plan_made(document: &str) -> PyResult<(String, String, String)> {
    let table: Result<toml::Table, _> = serde_json::from_str(document);
    let table = table.map_err(|why| MuprimeError::new_err(format!("the plan: {why}")))?;
    let name = table.get("name").and_then(toml::Value::as_str).unwrap_or("the plan");
    Plan::parse(name, &table.to_string()).and_then(parts).map_err(refused)
}

fn parts(plan: Plan) -> miette::Result<(String, String, String)> {
    let document = serde_json::to_string(&plan.file).into_diagnostic()?;
    Ok((plan.origin, plan.text, document))
}

/// The passes of a plan on a setup, in the order of measurement, as JSON: everything that a run looks at
/// before it touches the rig. Nothing is opened.
#[pyfunction]
#[pyo3(signature = (name, text, setup, seed))]
pub fn plan_passes(name: &str, text: &str, setup: &str, seed: Option<u64>) -> PyResult<String> {
    let passes = || -> miette::Result<String> {
        let (setup, plan) = (Setup::load(setup)?, Plan::parse(name, text)?);
        let model: Arc<dyn FrictionModel> = Arc::new(SpringSlider::new(setup.tip.finger).into_diagnostic()?);
        let seed = seed.unwrap_or(plan.file.seed);
        let (model_file, defects, out, notes) = (None, None, PathBuf::new(), Default::default());
        let job =
            Job { setup, plan, seed, model, model_file, defects, out, fast: true, notes, answers: None };
        serde_json::to_string(&job.points()?).into_diagnostic()
    };
    passes().map_err(refused)
}
