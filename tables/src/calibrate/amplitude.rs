//! `muprime calibrate amplitude`.

use super::{Bench, CalibrationResult, LiveTable, Of, Sources, columns, displacement};
use calibration::amplitude::apply::AmplitudeFit;
use calibration::amplitude::droop::{Exponent, droop};
use calibration::amplitude::gain::{GainForm, fit};
use calibration::amplitude::map::mode_shape;
use calibration::amplitude::resonance::sweep;
use calibration::amplitude::{AmplitudeError, AmplitudePoint};
use runs::{Setup, say};
use std::path::{Path, PathBuf};

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Vibrometer table as CSV: set_point (or the column of --set-point), amplitude_pp_m (or velocity_v, see
    /// --velocity-volts). Left out: taken live, see --live
    #[arg(long)]
    table: Option<PathBuf>,
    /// The table holds velocity_v, the amplitude of the velocity signal in V (zero to peak), in place of
    /// amplitude_pp_m; range and band are read back from the vibrometer of --setup
    #[arg(long, requires = "setup")]
    velocity_volts: bool,
    /// Setup with a [vibrometer]; with --live, its amplifier is driven
    #[arg(long)]
    setup: Option<String>,
    /// Take the table live: drive these set-points (peak-to-peak, m) and ask for the velocity's amplitude at each
    #[arg(long, num_args = 1.., value_name = "W_PP_M", requires = "setup", conflicts_with = "table")]
    live: Vec<f64>,
    /// Frequency of the drive where velocities are measured
    #[arg(long, default_value_t = 27_500.0)]
    frequency_hz: f64,
    /// Live: times through the set-points, up and down by turns
    #[arg(long, default_value_t = 3)]
    passes: u32,
    /// Live: wait before each reading in s
    #[arg(long, default_value_t = 0.5)]
    settle_s: f64,
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

/// Calibrates; a table that is taken live goes beside the certificate.
pub fn calibrate(
    of: &Of<Args>,
    bench: &dyn Bench,
    sources: &mut Sources,
) -> miette::Result<CalibrationResult> {
    let (args, keep) = (&of.args, &*of.common.beside("amplitude"));
    let unit = match args.set_point.as_str() {
        "set_point_pp_m" => "m",
        "current_a" => "A",
        other => miette::bail!("--set-point {other}: set_point_pp_m or current_a"),
    };
    let refused = |path: &Path| {
        let shown = path.display().to_string();
        move |e: AmplitudeError| miette::miette!("{shown}: no certificate: {e}")
    };
    let form = match args.form {
        FormChoice::Proportional => GainForm::Proportional,
        FormChoice::Affine => GainForm::Affine,
        FormChoice::Bent => GainForm::Bent,
    };
    let (path, table, vibrometer) = match (&args.table, args.velocity_volts) {
        (None, _) if args.live.is_empty() => miette::bail!("give a --table, or --live with set-points"),
        (None, _) if unit != "m" => {
            miette::bail!("--live drives amplitudes in m: take the table of a drive of current by hand")
        }
        (None, _) => {
            let settings = live_table(args, bench, keep)?;
            (keep, points_of(sources, keep, &args.set_point)?, Some(settings))
        }
        (Some(path), false) => (path.as_path(), points_of(sources, path, &args.set_point)?, None),
        (Some(path), true) => {
            let settings = bench.vibrometer(&with_vibrometer(args)?, args.frequency_hz)?;
            say!("vibrometer: {settings}");
            let rows = columns(sources, path, [args.set_point.as_str(), "velocity_v"], &[])?;
            let convert = |(row, [at, volts]): (usize, [f64; 2])| {
                displacement(volts, settings.range_m_s_per_v, args.frequency_hz)
                    .map(|w| AmplitudePoint { at, amplitude_pp_m: w.metres() })
                    .map_err(|e| miette::miette!("{}: row {}: {e}", path.display(), row + 1))
            };
            let table = rows.into_iter().enumerate().map(convert).collect::<miette::Result<Vec<_>>>()?;
            (path.as_path(), table, Some(settings.to_string()))
        }
    };
    let gain = fit(&table, form, args.vibrometer_relative_sd).map_err(refused(path))?;
    let mut points = |path: &PathBuf, at: &str| points_of(sources, path, at);
    let resonance = |path| sweep(&points(path, "frequency_hz")?).map_err(refused(path));
    let resonance = args.sweep.as_ref().map(resonance).transpose()?;
    let shape = |path| mode_shape(&points(path, "position_m")?).map_err(refused(path));
    let shape = args.map.as_ref().map(shape).transpose()?;
    let exponent = if args.linear_droop { Exponent::Linear } else { Exponent::Hertz };
    let drooped = |path| droop(&points(path, "normal_force_n")?, exponent).map_err(refused(path));
    let drooped = args.droop.as_ref().map(drooped).transpose()?;
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
    outcome.remarks.extend(vibrometer.map(|settings| {
        format!("velocity at {:.1} Hz, settings read back from the vibrometer: {settings}", args.frequency_hz)
    }));
    outcome.temperature_c = match args.temperature_c.as_deref() {
        None => None,
        Some([low, high]) if -40.0 <= *low && low < high && *high <= 100.0 => Some([*low, *high]),
        Some(other) => {
            miette::bail!("--temperature-c {other:?}: two of -40 to 100 deg C, the lower one first")
        }
    };
    Ok(outcome)
}

fn points_of(sources: &mut Sources, path: &Path, at: &str) -> miette::Result<Vec<AmplitudePoint>> {
    let rows = columns(sources, path, [at, "amplitude_pp_m"], &[])?;
    Ok(rows.into_iter().map(|[at, amplitude_pp_m]| AmplitudePoint { at, amplitude_pp_m }).collect())
}

fn with_vibrometer(args: &Args) -> miette::Result<Setup> {
    let name = args.setup.as_deref().ok_or_else(|| miette::miette!("--setup is needed"))?;
    Setup::load(name)
}

/// Takes the table live and keeps it; the vibrometer's settings in words.
fn live_table(args: &Args, bench: &dyn Bench, keep: &Path) -> miette::Result<String> {
    let setup = with_vibrometer(args)?;
    let &Args { ref live, frequency_hz, passes, settle_s, .. } = args;
    let table = LiveTable { set_points_pp_m: live, frequency_hz, passes, settle_s };
    let text = bench.amplitudes(&setup, &table)?;
    runs::files::write_whole(keep, &text)?;
    say!("the table is in {}", keep.display());
    let settings = text.lines().next().and_then(|l| l.strip_prefix("# vibrometer: ")).unwrap_or_default();
    Ok(settings.to_string())
}
