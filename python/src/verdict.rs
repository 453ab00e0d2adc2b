//! The diagnosis of a table.

use crate::{MuprimeError, refused};
use calibration::certificate::sha256_hex;
use diagnosis::data::Table;
use diagnosis::document::{document, predictions};
use diagnosis::hypotheses::Options;
use diagnosis::law::Law;
use miette::{Context, IntoDiagnostic};
use models::pass::read_passes;
use pyo3::prelude::*;
use runs::verdict::words;
use std::path::Path;
use std::sync::Arc;
use tables::law::{for_finger, of_text};
use tables::passes::parse_passes;

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
    let mut table = Table::measured(&passes).into_diagnostic().wrap_err_with(|| name.to_string())?;
    let mut law = None;
    if let Some((what, text)) = model {
        let loaded = match text {
            Some(text) => of_text(&what, what.clone(), text, &rig.finger)?,
            None => for_finger(Path::new(&what), &rig.finger)?,
        };
        let (base, within) =
            Law::on(loaded.model, loaded.file.map(|f| f.1), &table).into_diagnostic().wrap_err(what)?;
        (law, table) = (Some(Arc::new(base)), within);
    }
    let conditions = match predict {
        None => None,
        Some(bytes) => {
            let rows = read_passes(&bytes[..]).into_diagnostic().wrap_err("conditions to predict")?;
            let origin = table.origin(&passes);
            Some(Table::conditions(&rows, &origin).into_diagnostic().wrap_err("conditions to predict")?)
        }
    };
    let options = Options { law, ..choice };
    let mut result = diagnosis::verdict::diagnose(&table, &rig, &options, sha256_hex(bytes));
    if let Some(run) = run {
        runs::verdict::add_record(&mut result, run, &rig)?;
    }
    let about =
        [vec![("table", name.to_string()), ("rig", rig_name.to_string())], runs::report::about::of_rig(&rig)]
            .concat();
    let page = runs::report::diagnosis::page(&result, &table, &about)?;
    let predicted = conditions.as_ref().map(|conditions| predictions(&result, conditions));
    let model = result.saved_model().map(|model| toml::to_string(&model)).transpose().into_diagnostic()?;
    Ok((document(&result, &rig, damage).into_diagnostic()?, words(&result, &rig), page, predicted, model))
}
