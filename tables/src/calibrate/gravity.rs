//! `muprime calibrate gravity`: where the sensor's axes point, by its own weight at known tilts.

use super::{CalibrationResult, Sources, columns};
use calibration::certificate::{Finding, Residuals};
use calibration::force::characteristics::outcome;
use calibration::force::gravity::{TiltReading, orientation};
use std::path::PathBuf;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Calibrated forces at each tilt, as CSV: tilt_rad (about the axis across the stroke, positive where the
    /// lateral share of gravity grows), lateral_force_n, normal_force_n (zeros not taken off)
    tilts: PathBuf,
}

/// Calibrates.
pub fn calibrate(args: &Args, sources: &mut Sources) -> miette::Result<CalibrationResult> {
    let rows = columns(sources, &args.tilts, ["tilt_rad", "lateral_force_n", "normal_force_n"], &[])?;
    let shown = args.tilts.display();
    let readings: Vec<TiltReading> =
        rows.iter().map(|r| TiltReading { tilt_rad: r[0], force_n: [r[1], r[2]] }).collect();
    let found = orientation(&readings).map_err(|e| {
        miette::miette!("{shown}: no certificate: {e}; at least three tilts well apart are needed")
    })?;
    let dof = 2.0 * rows.len() as f64 - 4.0;
    let (angle, weight, [sd, largest]) = (found.angle_rad[0], found.weight_n[0], found.residual_n);
    if angle.abs() > 0.3 || sd > 0.05 * weight {
        miette::bail!(
            help = "check that the two forces are not swapped, and the sign of tilt_rad",
            "{shown}: no certificate: an angle of {angle:.3} rad, and residuals of {sd:.3} N at a weight of {weight:.3} N: up to \
             0.3 rad and a twentieth of the weight are possible"
        );
    }
    let remarks = vec![format!(
        "offsets that gravity has no part in: lateral {:.5} N, normal {:.5} N",
        found.offset_n[0], found.offset_n[1]
    )];
    let findings = [
        Finding::new("orientation.angle", "rad", found.angle_rad, dof),
        Finding::new("orientation.weight", "N", found.weight_n, dof),
    ];
    let count = 2 * rows.len() as u64;
    let residuals = Residuals { count, sd, largest, unit: "N".into(), lack_of_fit_p: None };
    let model = "F_lateral = W sin(tilt + angle) + o_lateral, F_normal = W cos(tilt + angle) + o_normal";
    Ok(outcome(model, &findings, residuals, remarks))
}
