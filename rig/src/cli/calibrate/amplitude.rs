//! `muprime calibrate amplitude`.

use super::Common;
use super::tables::{Sources, columns};
use calibration::amplitude::apply::AmplitudeFit;
use calibration::amplitude::droop::{Exponent, droop};
use calibration::amplitude::gain::{Form, fit};
use calibration::amplitude::map::mode_shape;
use calibration::amplitude::resonance::sweep;
use calibration::amplitude::{AmplitudeError, AmplitudePoint};
use std::path::PathBuf;
use std::process::ExitCode;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Vibrometer table as CSV: set_point (or the column of --set-point), amplitude_pp_m
    #[arg(long)]
    table: PathBuf,
    /// Column of the table that holds the set-point: set_point_pp_m, or current_a
    #[arg(long, default_value = "set_point_pp_m")]
    set_point: String,
    /// Frequency sweep as CSV: frequency_hz, amplitude_pp_m
    #[arg(long)]
    sweep: Option<PathBuf>,
    /// Map over the stroke as CSV: position_m, amplitude_pp_m
    #[arg(long)]
    map: Option<PathBuf>,
    /// Amplitude under load as CSV: normal_force_n, amplitude_pp_m
    #[arg(long)]
    droop: Option<PathBuf>,
    /// Place of the table on the stroke in m
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    table_at_m: f64,
    /// Form of the gain
    #[arg(long, value_enum, default_value_t = FormChoice::Proportional)]
    form: FormChoice,
    /// Droop with the load itself instead of its 2/3 power
    #[arg(long)]
    linear_droop: bool,
    /// Relative standard uncertainty of the vibrometer (its own certificate)
    #[arg(long, default_value_t = 0.01)]
    vibrometer_relative_sd: f64,
    /// Temperatures at which the certificate holds in deg C [default: not limited]
    #[arg(long, num_args = 2, value_names = ["LOW", "HIGH"], allow_negative_numbers = true)]
    temperature_c: Option<Vec<f64>>,
    #[command(flatten)]
    common: Common,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum FormChoice {
    /// w = g s
    Proportional,
    /// w = g s + o
    Affine,
    /// w = g s + q s^2
    Bent,
}

/// Calibrates.
pub fn run(args: &Args, json: bool) -> miette::Result<ExitCode> {
    let unit = match args.set_point.as_str() {
        "set_point_pp_m" => "m",
        "current_a" => "A",
        other => miette::bail!("--set-point {other}: set_point_pp_m or current_a"),
    };
    let mut sources = Sources::default();
    let mut points = |path: &PathBuf, at: &str| -> miette::Result<Vec<AmplitudePoint>> {
        let rows = columns(&mut sources, path, [at, "amplitude_pp_m"], &[])?;
        Ok(rows.into_iter().map(|[at, amplitude_pp_m]| AmplitudePoint { at, amplitude_pp_m }).collect())
    };
    let said = |path: &PathBuf| {
        let shown = path.display().to_string();
        move |e: AmplitudeError| miette::miette!("{shown}: no certificate: {e}")
    };
    let form = match args.form {
        FormChoice::Proportional => Form::Proportional,
        FormChoice::Affine => Form::Affine,
        FormChoice::Bent => Form::Bent,
    };
    let table = points(&args.table, &args.set_point)?;
    let gain = fit(&table, form, args.vibrometer_relative_sd).map_err(said(&args.table))?;
    let resonance = match &args.sweep {
        None => None,
        Some(path) => Some(sweep(&points(path, "frequency_hz")?).map_err(said(path))?),
    };
    let shape = match &args.map {
        None => None,
        Some(path) => Some(mode_shape(&points(path, "position_m")?).map_err(said(path))?),
    };
    let exponent = if args.linear_droop { Exponent::Linear } else { Exponent::Hertz };
    let drooped = match &args.droop {
        None => None,
        Some(path) => Some(droop(&points(path, "normal_force_n")?, exponent).map_err(said(path))?),
    };
    let found = AmplitudeFit {
        gain,
        set_point_unit: unit.into(),
        table_at_m: args.table_at_m,
        vibrometer_relative_sd: args.vibrometer_relative_sd,
        resonance,
        mode_shape: shape,
        droop: drooped,
    };
    let mut outcome = found.outcome();
    outcome.temperature_c = match args.temperature_c.as_deref() {
        None => None,
        Some([low, high]) if low < high => Some([*low, *high]),
        Some(other) => miette::bail!("--temperature-c {other:?}: two temperatures, the lower one first"),
    };
    args.common.issue(outcome, sources.raw_data(), json)
}
