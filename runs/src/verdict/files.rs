//! A verdict in the folder of its run: the page, the document, the corrected model and the next plan,
//! under names that the catalogue knows.

use crate::input::{MAX_TABLE_BYTES, bytes_of, rig_file};
use crate::report::{about, diagnosis::page};
use crate::run_dir::{damage_in, is_held, record_facts};
use calibration::certificate::sha256_hex;
use diagnosis::data::Table;
use diagnosis::document::document;
use diagnosis::hypotheses::Options;
use diagnosis::verdict::{Diagnosis, diagnose};
use miette::{IntoDiagnostic, WrapErr};
use models::rig_file::RigFile;
use std::path::Path;

/// The page for people.
pub const PAGE: &str = "diagnosis.html";
/// The verdict as `muprime --json diagnose` prints it.
pub const DOCUMENT: &str = "diagnosis.json";
/// The corrected model, for `muprime run --model`.
pub const CORRECTED_MODEL: &str = "corrected-model.toml";
/// The plan of the best next experiment, for `muprime run`.
pub const NEXT_PLAN: &str = "next-plan.toml";

/// Diagnoses a run that is over and writes what comes of it into its folder.
///
/// # Errors
/// A run that goes on, a folder without one, a table that cannot be diagnosed.
pub fn diagnose_run(run: &Path) -> miette::Result<()> {
    if is_held(run) {
        miette::bail!("{}: the run goes on; diagnose it when it is over", run.display());
    }
    let path = run.join("points.csv");
    let bytes = bytes_of(&path, MAX_TABLE_BYTES)?;
    let passes = models::pass::read_passes(&bytes[..]).into_diagnostic();
    let passes = passes.wrap_err_with(|| path.display().to_string())?;
    let table = Table::measured(&passes).into_diagnostic().wrap_err_with(|| path.display().to_string())?;
    let rig = rig_file(&run.join("rig.toml"))?;
    let mut result = diagnose(&table, &rig, &Options::default(), sha256_hex(&bytes));
    super::add_record(&mut result, run, &rig)?;
    let facts = record_facts(run).unwrap_or_default();
    let html = page(&result, &table, &about::of_run(run, &facts, Some(&rig)))?;
    write(run, &result, &rig, &html, &damage_in(run)?)
}

/// Writes a verdict into the folder of its run. A model or a plan of an earlier verdict goes where this
/// one has none.
pub fn write(
    run: &Path,
    result: &Diagnosis,
    rig: &RigFile,
    html: &str,
    damage: &[String],
) -> miette::Result<()> {
    let model = result.saved_model().map(|model| toml::to_string(&model)).transpose().into_diagnostic()?;
    let all = [
        (PAGE, Some(html.to_string())),
        (DOCUMENT, Some(document(result, rig, damage).into_diagnostic()?)),
        (CORRECTED_MODEL, model),
        (NEXT_PLAN, super::next_plan(result)),
    ];
    for (name, text) in all {
        let file = run.join(name);
        match text {
            Some(text) => crate::files::write_whole(&file, text)?,
            None if file.exists() => std::fs::remove_file(&file).into_diagnostic()?,
            None => {}
        }
    }
    Ok(())
}
