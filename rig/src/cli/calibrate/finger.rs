//! `muprime calibrate finger`.

use super::Common;
use super::tables::{Sources, columns};
use calibration::finger::friction;
use calibration::finger::stiffness::{Stiffness, UltrasonicPoint, quasi_static, ultrasonic};
use calibration::finger::{FingerError, FingerFit};
use calibration::identify::{Identified, Search, identify};
use calibration::phase::table::{PhasePoint, read_phases};
use miette::IntoDiagnostic;
use models::ridge::{PhaseCurves, RidgeCase};
use std::path::PathBuf;
use std::process::ExitCode;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Phase table as CSV (amplitude_pp_m, phase_shift_deg, ...): the stratum corneum's modulus by Eq. 2
    phases: Option<PathBuf>,
    /// Frequency of the phase table, if it has no such column [default: 27500]
    #[arg(long)]
    frequency_hz: Option<f64>,
    /// Range of moduli searched, in Pa
    #[arg(long, num_args = 2, value_names = ["LOWEST", "HIGHEST"], default_values_t = [10e6, 1e9])]
    modulus_range_pa: Vec<f64>,
    /// Slow normal loop as CSV: displacement_m, force_n, up (1 or 0)
    #[arg(long)]
    normal_loop: Option<PathBuf>,
    /// Slow lateral loop as CSV: displacement_m, force_n, up (1 or 0)
    #[arg(long)]
    lateral_loop: Option<PathBuf>,
    /// Displacement about which the loops' stiffness is stated, in m
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    about_m: f64,
    /// Ultrasonic normal data as CSV: amplitude_m (zero-to-peak), in_phase_n, quadrature_n
    #[arg(long)]
    normal_ultrasonic: Option<PathBuf>,
    /// Ultrasonic lateral data as CSV: amplitude_m (zero-to-peak), in_phase_n, quadrature_n
    #[arg(long)]
    lateral_ultrasonic: Option<PathBuf>,
    /// Normal force during the ultrasonic measurement: contact must not be lost
    #[arg(long)]
    normal_force_n: Option<f64>,
    /// Passes without vibration as CSV: normal_force_n, speed_m_s, lateral_force_n, optional contact_time_s
    #[arg(long)]
    friction: Option<PathBuf>,
    /// Relative standard uncertainty of force over displacement (from their certificates)
    #[arg(long, default_value_t = 0.02)]
    scale_relative_sd: f64,
    #[command(flatten)]
    common: Common,
}

/// Calibrates.
pub fn run(args: &Args, json: bool) -> miette::Result<ExitCode> {
    let mut sources = Sources::default();
    let mut found = FingerFit::default();
    let said = |path: &PathBuf, e: FingerError| miette::miette!("{}: no certificate: {e}", path.display());
    for (name, path) in
        [("normal_quasi_static", &args.normal_loop), ("lateral_quasi_static", &args.lateral_loop)]
    {
        let Some(path) = path else { continue };
        let rows = columns(&mut sources, path, ["displacement_m", "force_n", "up"], &["up"])?;
        let points: Vec<(f64, f64, bool)> = rows.iter().map(|r| (r[0], r[1], r[2] != 0.0)).collect();
        let stiffness =
            quasi_static(&points, args.about_m, args.scale_relative_sd).map_err(|e| said(path, e))?;
        found.stiffness.push((name.into(), stiffness));
    }
    for (name, path) in
        [("normal_ultrasonic", &args.normal_ultrasonic), ("lateral_ultrasonic", &args.lateral_ultrasonic)]
    {
        let Some(path) = path else { continue };
        let rows = columns(&mut sources, path, ["amplitude_m", "in_phase_n", "quadrature_n"], &[])?;
        let points: Vec<UltrasonicPoint> = rows
            .iter()
            .map(|r| UltrasonicPoint { amplitude_m: r[0], in_phase_n: r[1], quadrature_n: r[2] })
            .collect();
        let load = if name == "normal_ultrasonic" {
            args.normal_force_n.ok_or_else(|| {
                miette::miette!(
                    "--normal-ultrasonic needs --normal-force-n: whether contact was kept depends on it"
                )
            })?
        } else {
            f64::INFINITY
        };
        let stiffness: Stiffness =
            ultrasonic(&points, load, args.scale_relative_sd).map_err(|e| said(path, e))?;
        found.stiffness.push((name.into(), stiffness));
    }
    if let Some(path) = &args.friction {
        let bytes = sources.read(path)?;
        let points = friction::read(bytes.as_slice()).map_err(|e| said(path, e))?;
        found.friction = Some(friction::friction(&points).map_err(|e| said(path, e))?);
    }
    if let Some(path) = &args.phases {
        let bytes = sources.read(path)?;
        let points = read_phases(bytes.as_slice()).map_err(|e| miette::miette!("{}: {e}", path.display()))?;
        let found_modulus = modulus(args, &points).map_err(|e| e.wrap_err(path.display().to_string()))?;
        found.modulus = Some(found_modulus);
    }
    if found.stiffness.is_empty() && found.friction.is_none() && found.modulus.is_none() {
        miette::bail!(
            "nothing to calibrate: give a phase table, a loop, ultrasonic data, or friction passes"
        );
    }
    args.common.issue(found.outcome(), sources.raw_data(), json)
}

/// Error in degrees that the mesh leaves in a computed phase (`docs/ridge.md`).
const MODEL_SD_DEG: f64 = 2.0;
/// Moduli on which the model is run.
const MODULI: usize = 14;

/// Inverse analysis of a phase table: the finite element model is run at its amplitudes.
fn modulus(args: &Args, points: &[PhasePoint]) -> miette::Result<Identified> {
    let one = |name: &str, of: fn(&PhasePoint) -> Option<f64>, flag: Option<f64>, default: f64| {
        let mut given: Vec<f64> = points.iter().filter_map(of).collect();
        given.dedup();
        match (given[..].len(), flag) {
            (0, flag) => Ok(flag.unwrap_or(default)),
            (1, None) => Ok(given[0]),
            (1, Some(flag)) if flag == given[0] => Ok(flag),
            (1, Some(flag)) => miette::bail!("--{name} {flag} contradicts the table's {}", given[0]),
            _ => miette::bail!("the table has several values of {name}: identify one condition at a time"),
        }
    };
    let frequency_hz = one("frequency-hz", |p: &PhasePoint| p.frequency_hz, args.frequency_hz, 27_500.0)?;
    let force = one("normal-force-n", |p: &PhasePoint| p.normal_force_n, args.normal_force_n, 0.25)?;
    let [low, high] = args.modulus_range_pa[..] else {
        miette::bail!("--modulus-range-pa takes the lowest and the highest modulus");
    };
    // Without vibration there is no phase.
    let points: Vec<PhasePoint> = points.iter().filter(|p| p.amplitude.metres() > 0.0).cloned().collect();
    let mut amplitudes: Vec<_> = points.iter().map(|p| p.amplitude).collect();
    amplitudes.dedup();
    let base = RidgeCase { frequency_hz, ..RidgeCase::paper().with_normal_force_n(force) };
    eprintln!("running the ridge for {} amplitudes and {MODULI} moduli", amplitudes.len());
    let curves = PhaseCurves::compute(base, &amplitudes, (low, high), MODULI).into_diagnostic()?;
    let search = Search { lowest_pa: low, highest_pa: high, model_sd_deg: MODEL_SD_DEG };
    identify(&points, &search, |modulus_pa, amplitude| curves.at(modulus_pa, amplitude)).into_diagnostic()
}
