//! `muprime calibrate creep`: how a reading goes on changing under a load that does not.

use super::{CalibrationResult, Sources, columns};
use calibration::certificate::{Finding, Residuals};
use calibration::force::characteristics::outcome;
use calibration::force::creep::Creep;
use std::path::PathBuf;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Readings after a load was put on, as CSV: time_s (since then), net_counts (zero taken off)
    readings: PathBuf,
}

/// Calibrates.
pub fn calibrate(args: &Args, sources: &mut Sources) -> miette::Result<CalibrationResult> {
    let rows = columns(sources, &args.readings, ["time_s", "net_counts"], &[])?;
    let shown = args.readings.display();
    if rows.iter().any(|r| r[0] < 0.0) || rows.windows(2).any(|w| w[1][0] <= w[0][0]) {
        miette::bail!("{shown}: time_s counts from the load on and must rise from row to row");
    }
    let (time, counts): (Vec<f64>, Vec<f64>) = rows.iter().map(|r| (r[0], r[1])).unzip();
    let found = Creep::fit(&time, &counts).map_err(|e| {
        miette::miette!(
            "{shown}: no certificate: {e}; is the record longer than the creep, and loaded at all?"
        )
    })?;
    let tau = found.time_constant_s[0];
    let dof = rows.len() as f64 - 3.0;
    let mut remarks = Vec::new();
    if tau > 0.5 * (time[time.len() - 1] - time[0]) {
        remarks.push(format!(
            "the record is shorter than two time constants ({tau:.0} s): the end is extrapolated"
        ));
    }
    if found.relative[0].abs() < 2.0 * found.relative[1] {
        remarks.push("no creep stands out of the noise: only its bound is known".into());
    }
    let findings = [
        Finding::new("creep.relative", "1", found.relative, dof),
        Finding::new("creep.time_constant", "s", found.time_constant_s, dof),
    ];
    let (count, [sd, largest]) = (rows.len() as u64, found.residual);
    let residuals = Residuals { count, sd, largest, unit: "counts".into(), lack_of_fit_p: None };
    let model = "counts(t) = c0 (1 + relative (1 - exp(-t / time_constant)))";
    Ok(outcome(model, &findings, residuals, remarks))
}
