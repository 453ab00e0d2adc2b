//! `muprime calibrate gravity`: where the sensor's axes point, by its own weight at known tilts.

use super::tables::{Sources, columns};
use super::{Common, Issued};
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
    #[command(flatten)]
    common: Common,
}

/// Calibrates.
pub fn certified(args: &Args) -> miette::Result<Issued> {
    let mut sources = Sources::default();
    let rows = columns(&mut sources, &args.tilts, ["tilt_rad", "lateral_force_n", "normal_force_n"], &[])?;
    let shown = args.tilts.display();
    if rows.iter().any(|r| r[0].abs() > 1.6) {
        miette::bail!("{shown}: a tilt over 1.6: tilt_rad is in radians");
    }
    let readings: Vec<TiltReading> =
        rows.iter().map(|r| TiltReading { tilt_rad: r[0], force_n: [r[1], r[2]] }).collect();
    let found = orientation(&readings).map_err(|e| {
        miette::miette!("{shown}: no certificate: {e}; at least three tilts well apart are needed")
    })?;
    let dof = 2.0 * rows.len() as f64 - 4.0;
    let (angle, weight) = (found.angle_rad[0], found.weight_n[0]);
    let left = |r: &TiltReading| {
        let (s, c) = (r.tilt_rad + angle).sin_cos();
        [r.force_n[0] - weight * s - found.offset_n[0], r.force_n[1] - weight * c - found.offset_n[1]]
    };
    let largest = readings.iter().flat_map(left).fold(0.0, |m: f64, r| m.max(r.abs()));
    let remarks = vec![format!(
        "offsets that gravity has no part in: lateral {:.5} N, normal {:.5} N",
        found.offset_n[0], found.offset_n[1]
    )];
    let findings = [
        Finding::new("orientation.angle", "rad", found.angle_rad, dof),
        Finding::new("orientation.weight", "N", found.weight_n, dof),
    ];
    let (count, sd) = (2 * rows.len() as u64, found.residual_sd_n);
    let residuals = Residuals { count, sd, largest, unit: "N".into(), lack_of_fit_p: None };
    let model = "F_lateral = W sin(tilt + angle) + o_lateral, F_normal = W cos(tilt + angle) + o_normal";
    args.common.certify(outcome(model, &findings, residuals, remarks), sources.raw_data())
}
