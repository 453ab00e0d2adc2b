//! A verdict in the folder of its run: the page, the document, the corrected model and the next plan,
//! under names that the catalogue knows.

use diagnosis::Diagnosis;
use diagnosis::report::document::document;
use miette::IntoDiagnostic;
use models::RigFile;
use std::path::Path;

/// The page for people.
pub const PAGE: &str = "diagnosis.html";
/// The verdict as `muprime --json diagnose` prints it.
pub const DOCUMENT: &str = "diagnosis.json";
/// The corrected model, for `muprime run --model`.
pub const CORRECTED_MODEL: &str = "corrected-model.toml";
/// The plan of the best next experiment, for `muprime run`.
pub const NEXT_PLAN: &str = "next-plan.toml";

/// Writes a verdict into the folder of its run. A model or a plan of an earlier verdict goes where this
/// one has none.
pub fn write(
    run: &Path,
    result: &Diagnosis,
    rig: &RigFile,
    html: &str,
    damage: &[String],
) -> miette::Result<()> {
    let all = [
        (PAGE, Some(html.to_string())),
        (DOCUMENT, Some(document(result, rig, damage).into_diagnostic()?)),
        (CORRECTED_MODEL, super::corrected_model(result)?),
        (NEXT_PLAN, super::next_plan(result, &[run.to_path_buf()])),
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
