//! The verdict as a document: the JSON of `muprime diagnose --json`, and its predictions.

use crate::data::{self, Table};
use crate::report::certificates::{AtFault, InDoubt, at_fault, in_doubt};
use crate::report::format::three_digits;
use crate::report::unstated_covariates::Unstated;
use crate::{Diagnosis, Forecast, Report};
use models::RigFile;
use models::covariate::{COVARIATES, Covariate, CovariateRole};
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

/// What `--predictions` holds: CSV, a row a condition; empty cells where the base law, or the table of an
/// effect in the verdict's model, cannot tell.
///
/// # Errors
/// A condition that lacks a column by which the verdict's model predicts.
pub fn predictions(result: &Diagnosis, conditions: &Table) -> Result<String, Unstated> {
    let mut text = String::from(
        "point,lateral_force_baseline_n,lateral_force_corrected_n,lateral_force_corrected_sd_n,\
         lateral_force_in_run_n,lateral_force_in_run_sd_n\n",
    );
    for (point, f) in conditions.points.iter().zip(result.predict(conditions)?) {
        text.push_str(&format!("{point},{}\n", cells(&f)));
    }
    Ok(text)
}

/// The cells of a prediction: none where there is no number, nor for the deviation of one that is none.
fn cells(f: &Forecast) -> String {
    let (corrected, in_run) = ([f.corrected, f.corrected_sd], [f.in_run, f.in_run_sd]);
    let all = [[f.baseline; 2], [f.corrected; 2], corrected, [f.in_run; 2], in_run];
    let known = |of: f64, value: f64| !(f.baseline + of + value).is_nan();
    all.map(|[of, value]| if known(of, value) { format!("{value:e}") } else { String::new() }).join(",")
}

/// Share of a range beyond which a setting is outside it.
const BEYOND: f64 = 0.1;

/// Says which settings of the conditions lie outside those of the table: nothing was seen there.
pub fn outside(table: &Table, conditions: &Table) -> Option<String> {
    let range = |c: &Covariate, of: &Table| {
        let [low, high] = data::range(of.passes.iter().filter_map(|p| c.of(p)));
        (low <= high).then_some([low, high])
    };
    let beyond = COVARIATES.iter().filter(|c| c.role != CovariateRole::Time).filter_map(|c| {
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
    use super::{cells, outside};
    use crate::report::predict::Forecast;
    use crate::tests::{Deviates, table};

    /// `NaN` stood in the cells beyond the table of an effect.
    #[test]
    fn what_is_unknown_is_an_empty_cell() {
        let whole = Forecast {
            baseline: 0.1,
            recalibrated: 0.1,
            corrected: 0.2,
            form: 0.2,
            corrected_sd: 0.01,
            scatter_sd: 0.01,
            in_run: 0.25,
            in_run_sd: 0.02,
        };
        assert_eq!(cells(&whole), "1e-1,2e-1,1e-2,2.5e-1,2e-2");
        // Beyond the table of an effect the law still tells; a deviation of no number is none.
        let beyond = Forecast { corrected: f64::NAN, in_run: f64::NAN, ..whole };
        assert_eq!(cells(&beyond), "1e-1,,,,");
        assert_eq!(cells(&Forecast { corrected_sd: f64::NAN, ..whole }), "1e-1,2e-1,,2.5e-1,2e-2");
        // A law that cannot tell is the base of all of them.
        assert_eq!(cells(&Forecast { baseline: f64::NAN, ..whole }), ",,,,");
    }

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
