//! The diagnosis of a table.

use crate::{MuprimeError, refused};
use diagnosis::report::document::{document, predictions};
use diagnosis::{Options, Table};
use miette::{Context, IntoDiagnostic};
use models::pass::read_passes;
use pyo3::prelude::*;
use runs::verdict_text::{corrected_model, words};
use std::path::{Path, PathBuf};
use tables::diagnose::Subject;
use tables::joined::{JoinedTable, joined, start_of};
use tables::law::{for_finger, of_text, own_effects};
use tables::passes::parse_passes;

/// A diagnosis: the document of `muprime diagnose --json`, text, page, requested predictions as CSV, and the
/// corrected model as TOML.
type Texts = (String, String, String, Option<String>, Option<String>);

/// A base law: its name or path, and its text where it is not a file.
type Model = (String, Option<String>);

/// A point table in memory: how messages call it, its bytes, and the folder of its run.
type InMemory = (String, Vec<u8>, Option<PathBuf>);

/// Diagnoses point tables in memory, several as one, under a rig.toml in memory; the record of a single run
/// is read too.
#[pyfunction]
#[pyo3(signature = (tables, rig_name, rig, pairs, without, predict, damage, model, effects))]
#[allow(clippy::too_many_arguments)]
pub fn diagnose(
    py: Python<'_>,
    tables: Vec<InMemory>,
    rig_name: &str,
    rig: &str,
    pairs: bool,
    without: Vec<String>,
    predict: Option<Vec<u8>>,
    damage: Vec<String>,
    model: Option<Model>,
    effects: Vec<PathBuf>,
) -> PyResult<Texts> {
    if let Some(unknown) = without.iter().find(|name| ::effects::by_name(name).is_none()) {
        return Err(MuprimeError::new_err(format!("without {unknown:?}: no such effect")));
    }
    py.detach(|| {
        let own = own_effects(&effects)?;
        let choice = Options { pairs, without, own, ..Options::default() };
        texts(tables, rig_name, rig, choice, predict, &damage, model)
    })
    .map_err(refused)
}

fn texts(
    tables: Vec<InMemory>,
    rig_name: &str,
    rig: &str,
    choice: Options,
    predict: Option<Vec<u8>>,
    damage: &[String],
    model: Option<Model>,
) -> miette::Result<Texts> {
    let rig = runs::input::rig_text(rig_name, rig)?;
    let shown = tables.iter().map(|(name, ..)| name.as_str()).collect::<Vec<_>>().join(", ");
    let run = tables.first().filter(|_| tables.len() == 1).and_then(|(_, _, run)| run.clone());
    let (mut parts, mut all) = (Vec::new(), Vec::new());
    for (name, bytes, run) in tables {
        let passes = parse_passes(Path::new(&name), &bytes)?;
        let start_unix_s = run.as_ref().and_then(|run| start_of(run));
        parts.push(JoinedTable {
            name: run.map_or(name, |run| run.display().to_string()),
            passes,
            start_unix_s,
        });
        all.extend(bytes);
    }
    let mut subject =
        Subject::of(joined(parts)?, &all, rig).into_diagnostic().wrap_err_with(|| shown.clone())?;
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
    let result = subject.diagnose(choice, run.as_deref())?;
    let page = subject.page_of_table(&result, &shown, rig_name)?;
    let predicted = conditions.as_ref().map(|conditions| predictions(&result, conditions)).transpose();
    let predicted = predicted.into_diagnostic().wrap_err("conditions to predict")?;
    let (model, rig) = (corrected_model(&result)?, &subject.rig);
    Ok((document(&result, rig, damage).into_diagnostic()?, words(&result, rig), page, predicted, model))
}
