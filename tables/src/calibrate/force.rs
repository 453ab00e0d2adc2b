//! `muprime calibrate force`.

use super::{Bench, CalibrationResult, Common, SeriesOptions, Sources, with_columns};
use calibration::force::matrix::{Linearity, Options, fit};
use calibration::force::series::{self, Weighing};
use runs::say;
use std::path::PathBuf;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Series of readings as CSV: time_s, axis (zero, lateral, normal), mass_kg or load_n, lateral_counts,
    /// normal_counts; optional branch (up, down), temperature_c, saturated. Left out: guided at the terminal
    series: Option<PathBuf>,
    #[command(flatten)]
    pub common: Common,
    /// Guided: read the counts from the force instruments of this setup (bundled name or file)
    #[arg(long)]
    setup: Option<String>,
    /// Guided: averaging time of a reading in s
    #[arg(long, default_value_t = 2.0)]
    average_s: f64,
    /// Guided: how long a link that went down is waited for, in s
    #[arg(long, default_value_t = 60.0)]
    reconnect_s: f64,
    /// Guided: file for the series [default: beside the certificate, .csv]
    #[arg(long)]
    save_series: Option<PathBuf>,
    /// Local acceleration of free fall
    #[arg(long, default_value_t = series::STANDARD_GRAVITY_M_S2)]
    gravity_m_s2: f64,
    /// Its relative standard uncertainty
    #[arg(long, default_value_t = 1e-3)]
    gravity_relative_sd: f64,
    /// Relative standard uncertainty of the masses, common to all
    #[arg(long, default_value_t = 2e-4)]
    mass_relative_sd: f64,
    /// Standard uncertainty of the lateral pull's direction
    #[arg(long, default_value_t = 2e-3)]
    lateral_alignment_sd_rad: f64,
    /// Standard uncertainty of the normal pull's direction
    #[arg(long, default_value_t = 2e-3)]
    normal_alignment_sd_rad: f64,
    /// Fit the square of each load too
    #[arg(long)]
    quadratic: bool,
    /// Ends of the converter in counts
    #[arg(long, num_args = 2, value_names = ["LOW", "HIGH"], allow_negative_numbers = true)]
    count_limits: Option<Vec<f64>>,
    /// Largest drift of the zero over the series, as a share of the span
    #[arg(long, default_value_t = 0.01)]
    zero_drift_limit: f64,
}

/// Calibrates.
pub fn calibrate(args: &Args, bench: &dyn Bench, sources: &mut Sources) -> miette::Result<CalibrationResult> {
    let weighing = Weighing {
        gravity_m_s2: args.gravity_m_s2,
        gravity_relative_sd: args.gravity_relative_sd,
        mass_relative_sd: args.mass_relative_sd,
        alignment_sd_rad: [args.lateral_alignment_sd_rad, args.normal_alignment_sd_rad],
        ..Weighing::default()
    };
    if !(9.7..9.9).contains(&weighing.gravity_m_s2) {
        miette::bail!("--gravity-m-s2 {}: on the ground it is between 9.76 and 9.84", args.gravity_m_s2);
    }
    let (name, bytes) = match &args.series {
        Some(path) => (path.display().to_string(), sources.read(path)?),
        None => {
            let keep = &args.save_series.clone().unwrap_or_else(|| args.common.beside("force"));
            let (setup, &Args { average_s, reconnect_s, .. }) = (args.setup.as_deref(), args);
            let text = bench.series(&SeriesOptions { setup, average_s, reconnect_s, keep })?;
            let name = keep.display().to_string();
            say!("the series is in {name}");
            let bytes = sources.add(&name, text.into_bytes())?;
            (name, bytes)
        }
    };
    with_columns(&name, &bytes, &["time_s", "axis", "lateral_counts", "normal_counts"])?;
    let readings = series::read(bytes.as_slice(), &weighing).map_err(|e| miette::miette!("{name}: {e}"))?;
    let options = Options {
        linearity: if args.quadratic { Linearity::Quadratic } else { Linearity::Linear },
        count_limits: args.count_limits.as_deref().map(|l| [l[0], l[1]]),
        zero_drift_limit: args.zero_drift_limit,
        ..Options::default()
    };
    let found =
        fit(&readings, &weighing, &options).map_err(|e| miette::miette!("{name}: no certificate: {e}"))?;
    Ok(found.outcome(&weighing))
}
