//! The diagnosis of a table.

use crate::{MuprimeError, refused};
use diagnosis::data::Table;
use diagnosis::document::{document, predictions};
use diagnosis::hypotheses::Options;
use miette::{Context, IntoDiagnostic};
use models::pass::read_passes;
use pyo3::prelude::*;
use runs::verdict::{corrected_model, words};
use std::path::Path;
use tables::law::{for_finger, of_text};
use tables::passes::parse_passes;
use tables::verdict::Subject;

/// A diagnosis: the document of `muprime diagnose --json`, text, page, requested predictions as CSV, and the
/// corrected model as TOML.
type Texts = (String, String, String, Option<String>, Option<String>);

/// A base law: its name or path, and its text where it is not a file.
type Model = (String, Option<String>);

/// Diagnoses a point table in memory (`name` is how messages call it) under a rig.toml in memory; the
/// record in the folder `run` is read too.
#[pyfunction]
#[pyo3(signature = (name, table, rig_name, rig, pairs, without, predict, damage, model, run, effects))]
#[allow(clippy::too_many_arguments)]
pub fn diagnose(
    py: Python<'_>,
    name: &str,
    table: Vec<u8>,
    rig_name: &str,
    rig: &str,
    pairs: bool,
    without: Vec<String>,
    predict: Option<Vec<u8>>,
    damage: Vec<String>,
    model: Option<Model>,
    run: Option<std::path::PathBuf>,
    effects: Vec<std::path::PathBuf>,
) -> PyResult<Texts> {
    if let Some(unknown) = without.iter().find(|name| ::effects::by_name(name).is_none()) {
        return Err(MuprimeError::new_err(format!("without {unknown:?}: no such effect")));
    }
    py.detach(|| {
        let own = tables::law::own_effects(&effects)?;
        let choice = Options { pairs, without, own, ..Options::default() };
        texts(name, &table, rig_name, rig, choice, predict, &damage, model, run.as_deref())
    })
    .map_err(refused)
}

#[allow(clippy::too_many_arguments)]
fn texts(
    name: &str,
    bytes: &[u8],
    rig_name: &str,
    rig: &str,
    choice: Options,
    predict: Option<Vec<u8>>,
    damage: &[String],
    model: Option<Model>,
    run: Option<&Path>,
) -> miette::Result<Texts> {
    let rig = runs::input::rig_text(rig_name, rig)?;
    let passes = parse_passes(Path::new(name), bytes)?;
    let mut subject = Subject::of(passes, bytes, rig).into_diagnostic().wrap_err_with(|| name.to_string())?;
    if let Some((what, text)) = model {
        let base = match text {
            Some(text) => of_text(&what, what.clone(), text, &subject.rig.finger)?,
            None => for_finger(Path::new(&what), &subject.rig.finger)?,
        };
        subject = subject.on(base).into_diagnostic().wrap_err(what)?;
    }
    let conditions = predict.map(|bytes| {
        let (rows, origin) =
            (read_passes(&bytes[..]).into_diagnostic()?, subject.table.origin(&subject.passes));
        Table::conditions(&rows, &origin).into_diagnostic()
    });
    let conditions = conditions.transpose().wrap_err("conditions to predict")?;
    let result = subject.diagnose(choice, run)?;
    let page = subject.page_of_table(&result, name, rig_name)?;
    let predicted = conditions.as_ref().map(|conditions| predictions(&result, conditions)).transpose();
    let predicted = predicted.into_diagnostic().wrap_err("conditions to predict")?;
    let (model, rig) = (corrected_model(&result)?, &subject.rig);
    Ok((document(&result, rig, damage).into_diagnostic()?, words(&result, rig), page, predicted, model))
}
