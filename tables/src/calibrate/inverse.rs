//! The inverse analysis behind `calibrate finger PHASES.csv`: the ridge is run at the table's amplitudes,
//! first over the whole range of moduli as elastic skin, then about what was found with penalty and
//! retardation time free as well.

use calibration::identify::skin::{IdentifiedSkin, identify_skin};
use calibration::identify::{Identified, Search, identify};
use calibration::phase::table::PhasePoint;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use miette::IntoDiagnostic;
use models::PeakToPeak;
use models::ridge::{PhaseCurves, RidgeCase, Skin, SkinGrid};
use runs::say;

/// Standard error in degrees that the default mesh leaves in a computed phase (`docs/ridge.md`).
const MODEL_SD_DEG: f64 = 2.0;
/// Moduli on which the model is run over the whole range, and about what was found.
const MODULI: [usize; 2] = [14, 7];
/// How far about the elastic modulus the skin is searched: skin that does not relax within a cycle fits with
/// half of it, a soft contact with about twice.
const ABOUT: (f64, f64) = (0.4, 2.4);

/// Options of the analysis.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Frequency for a table without that column, Hz.
    pub frequency_hz: Option<f64>,
    /// Normal force for a table without that column, N.
    pub normal_force_n: Option<f64>,
    /// Moduli searched, Pa.
    pub modulus_range_pa: (f64, f64),
    /// Elements of the mesh.
    pub elements: usize,
    /// Leave penalty and time alone.
    pub modulus_only: bool,
    /// Print the progress on standard error.
    pub shown: bool,
}

/// The modulus of elastic skin, and all three quantities unless only the modulus is wanted.
///
/// # Errors
/// Rows or options that contradict each other or make no sense, by name; a model that gives no number.
pub fn analyse(
    options: &Options,
    points: &[PhasePoint],
) -> miette::Result<(Identified, Option<IdentifiedSkin>)> {
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
    let frequency_hz = one("frequency-hz", |p| p.frequency_hz, options.frequency_hz, 27_500.0)?;
    let force = one("normal-force-n", |p| p.normal_force_n, options.normal_force_n, 0.25)?;
    let (low, high) = options.modulus_range_pa;
    let conditions: std::collections::BTreeSet<&str> =
        points.iter().filter_map(|p| p.condition.as_deref()).collect();
    if conditions.len() > 1 {
        let names: Vec<&str> = conditions.into_iter().collect();
        miette::bail!("the table has several conditions ({}): identify one at a time", names.join(", "));
    }
    // Without vibration there is no phase.
    let points: Vec<PhasePoint> = points.iter().filter(|p| p.amplitude.metres() > 0.0).cloned().collect();
    let mut amplitudes: Vec<PeakToPeak> = points.iter().map(|p| p.amplitude).collect();
    amplitudes.sort_by(|a, b| a.metres().total_cmp(&b.metres()));
    amplitudes.dedup();
    let base = RidgeCase { frequency_hz, elements: options.elements, ..RidgeCase::paper() };
    let base = base.with_normal_force_n(force);
    let search = Search { lowest_pa: low, highest_pa: high, model_sd_deg: MODEL_SD_DEG };
    let curves =
        compute("the modulus", options.shown, base, &amplitudes, SkinGrid::elastic((low, high), MODULI[0]))?;
    let elastic = identify(&points, &search, |e, w| curves.at(&Skin::elastic(e), w)).into_diagnostic()?;
    if options.modulus_only {
        return Ok((elastic, None));
    }
    let about = (ABOUT.0 * elastic.young_modulus_pa, ABOUT.1 * elastic.young_modulus_pa);
    let grid = SkinGrid::free(about, MODULI[1]);
    let half = RidgeCase { elements: options.elements / 2, ..base };
    let curves = compute("penalty and retardation time", options.shown, half, &amplitudes, grid.clone())?;
    let skin = identify_skin(&points, &grid, &search, &elastic, |skin, w| curves.at(skin, w));
    Ok((elastic, Some(skin.into_diagnostic()?)))
}

fn compute(
    what: &str,
    shown: bool,
    base: RidgeCase,
    amplitudes: &[PeakToPeak],
    grid: SkinGrid,
) -> miette::Result<PhaseCurves> {
    let runs = (amplitudes.len() * grid.len()) as u64;
    if shown {
        say!("{what}: running the ridge {runs} times ({} amplitudes)", amplitudes.len());
    }
    let target = if shown { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
    let bar = ProgressBar::with_draw_target(Some(runs), target);
    let style = ProgressStyle::with_template("{bar:40} {pos}/{len} runs, {elapsed} gone, {eta} to go");
    bar.set_style(style.into_diagnostic()?);
    let curves = PhaseCurves::compute(base, amplitudes, grid, || bar.inc(1)).into_diagnostic();
    bar.finish_and_clear();
    curves
}
