//! `muprime calibrate finger`.

use super::inverse::{self, Options};
use super::{CalibrationResult, More, Sources, columns};
use calibration::finger::stiffness::{UltrasonicPoint, quasi_static, ultrasonic};
use calibration::finger::{FingerError, FingerFit, friction, springs};
use calibration::phase::table::read_phases;
use models::PassNoise;
use std::path::PathBuf;

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
    /// Identify the modulus alone, of elastic skin with the default penalty: quicker
    #[arg(long)]
    modulus_only: bool,
    /// Elements of the ridge's mesh, about; half as many where penalty and retardation time are free too
    #[arg(long, default_value_t = models::ridge::case::ELEMENTS)]
    elements: usize,
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
    /// A run's point table as CSV (points.csv): both stiffnesses and their ratio from its passes with vibration, by the spring-slider
    #[arg(long)]
    passes: Option<PathBuf>,
    /// What the rig repeats to from pass to pass, relative (for --passes)
    #[arg(long, default_value_t = models::rig_file::PassNoise::default().pass_relative_sd)]
    pass_relative_sd: f64,
    /// Standard deviation of a pass's mean force in N (for --passes)
    #[arg(long, default_value_t = models::rig_file::PassNoise::default().force_sd_n)]
    pass_force_sd_n: f64,
    /// Relative standard uncertainty of force over displacement (from their certificates)
    #[arg(long, default_value_t = 0.02)]
    scale_relative_sd: f64,
}

/// Calibrates; the skin and the springs that were identified go into `more`.
pub fn calibrate(args: &Args, sources: &mut Sources, more: &mut More) -> miette::Result<CalibrationResult> {
    let mut found = FingerFit::default();
    let refused = |path: &PathBuf, e: FingerError| miette::miette!("{}: no certificate: {e}", path.display());
    for (name, path) in
        [("normal_quasi_static", &args.normal_loop), ("lateral_quasi_static", &args.lateral_loop)]
    {
        let Some(path) = path else { continue };
        let rows = columns(sources, path, ["displacement_m", "force_n", "up"], &["up"])?;
        let points: Vec<(f64, f64, bool)> = rows.iter().map(|r| (r[0], r[1], r[2] != 0.0)).collect();
        let stiffness = quasi_static(&points, args.about_m, args.scale_relative_sd);
        found.stiffness.push((name.into(), stiffness.map_err(|e| refused(path, e))?));
    }
    // Normal contact must not be lost; along the plate there is no such limit.
    for (name, path, load_n) in [
        ("normal_ultrasonic", &args.normal_ultrasonic, args.normal_force_n),
        ("lateral_ultrasonic", &args.lateral_ultrasonic, Some(f64::INFINITY)),
    ] {
        let Some(path) = path else { continue };
        let rows = columns(sources, path, ["amplitude_m", "in_phase_n", "quadrature_n"], &[])?;
        let point =
            |r: &[f64; 3]| UltrasonicPoint { amplitude_m: r[0], in_phase_n: r[1], quadrature_n: r[2] };
        let points: Vec<UltrasonicPoint> = rows.iter().map(point).collect();
        let lacks = "--normal-ultrasonic needs --normal-force-n: it decides whether contact was lost";
        let load_n = load_n.ok_or_else(|| miette::miette!("{lacks}"))?;
        let stiffness = ultrasonic(&points, load_n, args.scale_relative_sd);
        found.stiffness.push((name.into(), stiffness.map_err(|e| refused(path, e))?));
    }
    if let Some(path) = &args.friction {
        let bytes = sources.read(path)?;
        let points = friction::read(bytes.as_slice()).map_err(|e| refused(path, e))?;
        found.friction = Some(friction::friction(&points).map_err(|e| refused(path, e))?);
    }
    if let Some(path) = &args.passes {
        let noise = PassNoise { pass_relative_sd: args.pass_relative_sd, force_sd_n: args.pass_force_sd_n };
        if !(noise.pass_relative_sd >= 0.0 && noise.force_sd_n > 0.0) {
            miette::bail!("--pass-relative-sd must be zero or more, and --pass-force-sd-n above zero");
        }
        let bytes = sources.read(path)?;
        let passes = models::pass::read_passes(bytes.as_slice())
            .map_err(|e| miette::miette!("{}: {e}", path.display()))?;
        let fitted = springs::springs(&passes, &noise).and_then(springs::Springs::of_a_law_that_holds);
        found.springs = Some(fitted.map_err(|e| refused(path, e))?);
    }
    if let Some(path) = &args.phases {
        let bytes = sources.read(path)?;
        let points = read_phases(bytes.as_slice()).map_err(|e| miette::miette!("{}: {e}", path.display()))?;
        let &Args { frequency_hz, normal_force_n, elements, modulus_only, .. } = args;
        let (modulus_range_pa, shown) = ((args.modulus_range_pa[0], args.modulus_range_pa[1]), true);
        let options =
            Options { frequency_hz, normal_force_n, modulus_range_pa, elements, modulus_only, shown };
        let (modulus, skin) =
            inverse::analyse(&options, &points).map_err(|e| e.wrap_err(path.display().to_string()))?;
        (found.modulus, found.skin) = (Some(modulus), skin);
    }
    let measured = !found.stiffness.is_empty() || found.friction.is_some();
    if !measured && found.modulus.is_none() && found.springs.is_none() {
        miette::bail!(
            "nothing to calibrate: give a phase table, a loop, ultrasonic data, friction passes, or a run's passes"
        );
    }
    more.push(("skin", serde_json::json!({ "elastic": found.modulus, "all_free": found.skin })));
    more.push(("springs", serde_json::json!(found.springs)));
    Ok(found.outcome())
}
