//! The verdict as a document: the JSON of `muprime diagnose --json`, and its predictions.

use crate::certificates::{AtFault, InDoubt, at_fault, in_doubt};
use crate::data::{self, Table};
use crate::format::three_digits;
use crate::unstated::Unstated;
use crate::verdict::{Diagnosis, Report};
use models::covariate::{COVARIATES, Covariate, Role};
use models::rig_file::RigFile;
use serde::Serialize;

/// Schema `muprime.verdict/1`: what `muprime diagnose --json` prints.
#[derive(Debug, Serialize, schemars::JsonSchema)]
pub struct Document<'a> {
    #[serde(flatten)]
    report: &'a Report,
    /// What is damaged in the run's folder; left out where nothing is.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    damage: &'a [String],
    /// Certificates that bound the leading cause, against the data; left out where there is none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    certificates_at_fault: Vec<AtFault>,
    /// Certificates whose error would pull a stiffness as this table does; left out where there is none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    certificates_in_doubt: Vec<InDoubt>,
}

/// The verdict as `--json` prints it: a [`Document`] with its keys in the order of the alphabet.
///
/// # Errors
/// Only if a number cannot be written as JSON.
pub fn document(result: &Diagnosis, rig: &RigFile, damage: &[String]) -> serde_json::Result<String> {
    let report = &result.report;
    let (certificates_at_fault, certificates_in_doubt) =
        (at_fault(result, rig), in_doubt(rig, &report.stiffness_pulls));
    let whole = Document { report, damage, certificates_at_fault, certificates_in_doubt };
    serde_json::to_string(&serde_json::to_value(whole)?)
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
        let known = !f.baseline.is_nan();
        let cells = [f.baseline, f.corrected, f.corrected_sd, f.in_run, f.in_run_sd];
        let cells = cells.map(|c| if known { format!("{c:e}") } else { String::new() }).join(",");
        text.push_str(&format!("{point},{cells}\n"));
    }
    Ok(text)
}

/// Share of a range beyond which a setting is outside it.
const BEYOND: f64 = 0.1;

/// Says which settings of the conditions lie outside those of the table: nothing was seen there.
pub fn outside(table: &Table, conditions: &Table) -> Option<String> {
    let range = |c: &Covariate, of: &Table| {
        let [low, high] = data::range(of.passes.iter().filter_map(|p| c.of(p)));
        (low <= high).then_some([low, high])
    };
    let beyond = COVARIATES.iter().filter(|c| c.role != Role::Time).filter_map(|c| {
        let ([low, high], [least, most]) = (range(c, table)?, range(c, conditions)?);
        let room = BEYOND * (high - low).max(high.abs());
        let (factor, unit) = c.shown;
        let shown = |v: f64| three_digits(v * factor);
        (least < low - room || most > high + room).then(|| {
            let [low, high, least, most] = [low, high, least, most].map(shown);
            format!("{} {least} to {most} {unit} (table: {low} to {high})", c.words)
        })
    });
    let all: Vec<String> = beyond.collect();
    (!all.is_empty()).then(|| {
        format!("Conditions to predict lie outside the table, where no pass was seen: {}.", all.join("; "))
    })
}

#[cfg(test)]
mod tests {
    use super::outside;
    use crate::tests::{Deviates, table};

    /// Conditions of the table are within it; a speed of ten times the largest is outside.
    #[test]
    fn a_speed_beyond_the_table_is_remarked() {
        let table = table(&mut Deviates(5), 0.0);
        let mut conditions = table.clone();
        assert_eq!(outside(&table, &conditions), None);
        conditions.passes[3].speed_m_s = 0.9;
        let remark = outside(&table, &conditions).unwrap();
        assert!(remark.contains("speed 10 to 900 mm/s (table: 10 to 90)"), "{remark}");
    }
}
