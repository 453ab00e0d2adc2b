//! The verdict as a document: the JSON of `muprime diagnose --json`, and its predictions.

use crate::certificates;
use crate::data::Table;
use crate::unstated::Unstated;
use crate::verdict::Diagnosis;
use models::rig_file::RigFile;

/// The verdict as `--json` prints it: the report, what is damaged in the run's folder, and the certificates that it speaks against.
///
/// # Errors
/// Only if a number cannot be written as JSON.
pub fn document(result: &Diagnosis, rig: &RigFile, damage: &[String]) -> serde_json::Result<String> {
    let mut report = serde_json::to_value(&result.report)?;
    let faults = certificates::at_fault(result, rig);
    let doubts = certificates::in_doubt(rig, &result.report.stiffness_pulls);
    if !damage.is_empty() {
        report["damage"] = serde_json::to_value(damage)?;
    }
    if !faults.is_empty() {
        report["certificates_at_fault"] = serde_json::to_value(&faults)?;
    }
    if !doubts.is_empty() {
        report["certificates_in_doubt"] = serde_json::to_value(&doubts)?;
    }
    serde_json::to_string(&report)
}

/// What `--predictions` holds: CSV, a row a condition; empty cells where the base law cannot tell.
///
/// # Errors
/// A condition that lacks a column by which the verdict's model predicts.
pub fn predictions(result: &Diagnosis, conditions: &Table) -> Result<String, Unstated> {
    let mut text = String::from(
        "point,lateral_force_baseline_n,lateral_force_corrected_n,lateral_force_corrected_sd_n,\
         lateral_force_in_run_n,lateral_force_in_run_sd_n\n",
    );
    for (point, f) in conditions.points.iter().zip(result.predict(conditions)?) {
        let cells = if f.baseline.is_nan() {
            ",,,,".to_string()
        } else {
            let cells = [f.baseline, f.corrected, f.corrected_sd, f.in_run, f.in_run_sd];
            cells.map(|c| format!("{c:e}")).join(",")
        };
        text.push_str(&format!("{point},{cells}\n"));
    }
    Ok(text)
}
